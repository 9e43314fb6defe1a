#!/usr/bin/env bash
# Fails unless GCC 12 makes vectors of every loop in lanes (backends/cpu/plain_vertices.cpp), of 16 floats and of 8.
# Compiles the file as the build does, by ninja. Other compilers and -march make what they make, and their reports may
# read otherwise: what was found is printed, and the exit status is 77, that of a skipped test.
# Usage: scripts/checks/lanes.sh BUILD
set -euo pipefail
cd "$1"
loops=9  # one for each instantiation
commands=$(ninja -t commands render/libambilux_render.a)
command=$(grep -m1 -- "/plain_vertices.cpp.o -c " <<< "$commands" | sed "s/^.*ccache //; s/ -MD .* -c / -c /")
version=$(${command%% *} -dumpversion)
report=$($command -o /dev/null -fopt-info-vec-optimized 2>&1) || { echo "$report"; exit 1; }
wide=$(grep -c "loop vectorized using 64 byte vectors" <<< "$report" || true)
all=$(grep -c "loop vectorized using 32 byte vectors" <<< "$report" || true)  # and what a wide one leaves over
echo "GCC $version: $wide of $loops loops with vectors of 16, $((all - wide)) with vectors of 8"
if [ "$wide" -eq $loops ] && [ "$all" -eq $((2 * loops)) ]; then exit 0; fi
case "${version%%.*} $command " in
    12\ *\ -march=x86-64-v3\ *) exit 1 ;;
    *) echo "skipped: this was tried with GCC 12 and -march=x86-64-v3 alone; renders are the same, perhaps slower"; exit 77 ;;
esac

#!/usr/bin/env bash
# Fails unless GCC makes vectors of every loop in lanes (backends/cpu/plain_*.cpp), of 16 floats and of 8. Compiles these
# files as the build does, by ninja.
# Usage: scripts/checks/lanes.sh BUILD
set -euo pipefail
cd "$1"
commands=$(ninja -t commands render/libambilux_render.a)

check() {  # FILE LOOPS, one for each instantiation
  local command report wide all
  command=$(grep -- "$1.cpp.o -c " <<< "$commands" | head -1 | sed "s/^.*ccache //; s/ -MD .* -c / -c /")
  report=$($command -o /dev/null -fopt-info-vec-optimized 2>&1)
  wide=$(grep -c "loop vectorized using 64 byte vectors" <<< "$report" || true)
  all=$(grep -c "loop vectorized using 32 byte vectors" <<< "$report" || true)  # and what a wide one leaves over
  echo "$1: $wide of $2 loops with vectors of 16, $((all - wide)) with vectors of 8"
  [ "$wide" -eq "$2" ] && [ "$all" -eq $((2 * $2)) ]
}
check plain_vertices 8
check plain_connections 1

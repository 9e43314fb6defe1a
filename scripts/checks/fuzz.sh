#!/usr/bin/env bash
# Feeds a reader with input that libFuzzer makes, under the address and undefined-behaviour sanitizers.
# scripts/checks/fuzz.sh TARGET MINUTES: TARGET is the NAME of a tests/fuzz/fuzz_NAME.cpp, or all; MINUTES of each, such as 0.2.
# Starts from tests/fuzz/seeds/NAME and what earlier runs found new (build-fuzz/corpus/NAME). A finding ends it with a
# status other than 0, when the targets that run beside it are done; its input lies in build-fuzz/findings. Needs Debian's
# clang-19 (or CXX, such as clang++-14).
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
if (($# != 2)); then
  say "usage: scripts/checks/fuzz.sh TARGET MINUTES; targets are all and: $(cd tests/fuzz && echo fuzz_*.cpp | sed 's/fuzz_//g; s/\.cpp//g')"
  exit 2
fi
: "${CXX:=clang++-19}"
if ! command -v "$CXX" >/dev/null; then
  say "fuzz: $CXX not found; install it with: sudo apt-get install -y clang-19 libclang-rt-19-dev"
  exit 4
fi
if [[ $1 == all ]]; then
  names=(tests/fuzz/fuzz_*.cpp)
  names=("${names[@]##*/fuzz_}")
  names=("${names[@]%.cpp}")
else
  names=("$1")
fi
fuzz="$root/build-fuzz"
cmake --preset fuzz -DCMAKE_CXX_COMPILER="$CXX" >/dev/null
cmake --build "$fuzz" -j "$(jobs)" --target "${names[@]/#/fuzz_}"
seconds=$(awk -v minutes="$2" 'BEGIN {print int(60 * minutes + 0.5)}')
if ((seconds < 1)); then
  say "fuzz: '$2' minutes are less than a second, which libFuzzer takes for no end"
  exit 2
fi
mkdir -p "$fuzz/findings"

fuzz_one() {
  local name=$1 corpus="$fuzz/corpus/$1"
  local options=(-max_total_time="$seconds" -timeout=20 -rss_limit_mb=2048 -artifact_prefix="$fuzz/findings/$name-" -print_final_stats=1)
  mkdir -p "$corpus"
  [[ -f tests/fuzz/$name.dict ]] && options+=(-dict="tests/fuzz/$name.dict")
  if ! "$fuzz/tests/fuzz/fuzz_$name" "${options[@]}" "$corpus" "tests/fuzz/seeds/$name" >"$fuzz/$name.log" 2>&1; then
    tail -n 40 "$fuzz/$name.log" >&2
    say "fuzz: $name: a finding; its input lies in $fuzz/findings"
    return 1
  fi
  say "fuzz: $name: $(awk '/number_of_executed_units/ {print $2}' "$fuzz/$name.log") inputs in $seconds s, none a finding"
}

# As many at a time as there are cores.
status=0
running=0
for name in "${names[@]}"; do
  if ((running == $(jobs))); then
    wait -n || status=1
    running=$((running - 1))
    ((status)) && break
  fi
  fuzz_one "$name" &
  running=$((running + 1))
done
while ((running-- > 0)); do wait -n || status=1; done
exit "$status"

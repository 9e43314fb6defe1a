#!/usr/bin/env bash
# Checks and times one render over several CUDA devices and ranks, on a machine with one GPU or more.
#   scripts/bench/many_devices.sh [BUILD]      build folder; default build
# Prints a line per figure; ends with code 1 if images differ that must be equal.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
build=${1:-$root/build}
ambilux=$build/cli/ambilux out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
count=$(nvidia-smi -L | wc -l)
failed=0
render() { # NAME LAUNCHER... -- OPTIONS...
  local name=$1 launcher=()
  shift
  while [[ $1 != -- ]]; do launcher+=("$1") && shift; done
  shift
  "${launcher[@]}" "$ambilux" --quiet render "$root/scenes/glass.xml" -o "$out/$name.exr" --json "$out/$name.json" --backend cuda "$@"
}
same() {
  local rmse
  rmse=$("$ambilux" --quiet compare "$out/$1.exr" "$out/$2.exr" | awk '/^RMSE/ {print $2; exit}')
  echo "$1 against $2: RMSE $rmse"
  [[ $rmse == 0 ]] || failed=1
}
figures() {
  "$python" - "$out/$1.json" "$1" <<'PY'
import json, sys
j = json.load(open(sys.argv[1]))
busy = ", ".join(f"{w['samples']} spp in {w['busy_seconds']:.2f} s, {w['ranges']} ranges" for w in j.get("workers", []))
print(f"{sys.argv[2]}: {j['seconds']['render']:.3f} s, merging {j.get('merge_seconds', 0):.3f} s; {busy}")
PY
}
echo "devices: $count"
"$build/tests/test_gpu_many_devices" || failed=1

# The same bits: one process and one device, two workers on it, several ranks on it, several devices.
how=(--spp 512 -i bdpt --deterministic --size 640x360 --range-size 16)
render one -- "${how[@]}" --devices 0
render twice -- "${how[@]}" --devices 0,0
same twice one
for n in 2 4; do
  render ranks$n mpirun --oversubscribe --bind-to none -n $n -- "${how[@]}"
  same ranks$n one
done
if ((count > 1)); then
  all=$(seq -s, 0 $((count - 1)))
  render all -- "${how[@]}" --devices "$all"
  same all one
fi

# Times: a plain render, by ranges on one device (the cost of reduction), on all of them; interleaved.
for integrator in path bdpt; do
  how=(-i $integrator --size 1920x1080)
  if [[ $integrator == path ]]; then how+=(--spp 8192); else how+=(--spp 2048); fi
  for round in 1 2; do
    render $integrator-plain-$round -- "${how[@]}"
    figures $integrator-plain-$round
    render $integrator-ranges-$round -- "${how[@]}" --devices 0
    figures $integrator-ranges-$round
    render $integrator-ranks2-$round mpirun --oversubscribe --bind-to none -n 2 -- "${how[@]}"
    figures $integrator-ranks2-$round
    if ((count > 1)); then
      render $integrator-devices$count-$round -- "${how[@]}" --devices "$all"
      figures $integrator-devices$count-$round
    fi
  done
done
exit $failed

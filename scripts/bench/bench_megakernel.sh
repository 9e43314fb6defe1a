#!/bin/bash
# Times the megakernel beside the wavefront on a CUDA device, two programs in turns, and profiles it.
# Usage: scripts/bench/bench_megakernel.sh OLD NEW SCENES [OUT]     OLD, NEW: ambilux programs; SCENES: folder of the published scenes
# OUT/times.txt: seconds of `bench stages` for 16 samples, three turns; OUT/ncu_*.txt: counters of the second launch, where ncu is installed.
set -euo pipefail
old=$1 new=$2 scenes=$3 out=${4:-out/megakernel}
mkdir -p "$out"
names="cornell-box veach-mis veach-bidir living-room staircase veach-ajar water-caustic"
for turn in 1 2 3; do
  for name in $names; do
    for program in "$old" "$new"; do
      for variant in wavefront megakernel; do
        echo "== $turn $name $program $variant" >>"$out/times.txt"
        "$program" bench stages "$scenes/$name/scene.xml" --backend cuda -i bdpt --variant $variant --spp 16 >>"$out/times.txt" 2>&1 || echo "failed" >>"$out/times.txt"
      done
    done
  done
done
command -v ncu >/dev/null || exit 0
for name in cornell-box living-room veach-ajar; do
  for program in "$old" "$new"; do
    ncu --clock-control none --section WarpStateStats --section SpeedOfLight --section MemoryWorkloadAnalysis --section Occupancy --section LaunchStats \
      --section InstructionStats --section SourceCounters --kernel-name-base demangled --kernel-name "regex:launch_paths" -c 2 \
      "$program" render "$scenes/$name/scene.xml" -i bdpt --variant megakernel --backend cuda --set graph=false --spp 4 -o "$out/x.exr" \
      >"$out/ncu_${name}_$(basename "$(dirname "$(dirname "$program")")").txt" 2>&1 || true
  done
done

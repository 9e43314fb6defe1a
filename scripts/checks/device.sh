#!/usr/bin/env bash
# All that is tested on a device, one after the other, each with a line of its result (logs below BUILD/device-checks):
# tests labelled gpu, small renders of all methods under compute-sanitizer, and renders from PTX by force beside those of machine code.
#   scripts/checks/device.sh BUILD [tests] [memcheck] [ptx]       all three unless some are named
set -u
(($#)) || { echo "usage: scripts/checks/device.sh BUILD [tests] [memcheck] [ptx]" >&2; exit 2; }
build=$(cd "$1" && pwd) && shift
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
export AMBILUX_SCENES="$root/scenes"
logs="$build/device-checks"
mkdir -p "$logs"
failed=0
parts=" ${*:-tests memcheck ptx} "

# run NAME SECONDS COMMAND...: exit status 77 is a test that was skipped.
run() {
  local name=$1 start=$SECONDS status=0
  timeout "$2" "${@:3}" >"$logs/$name.log" 2>&1 </dev/null || status=$?
  case $status in
    0) echo "$name: passed, $((SECONDS - start)) s" ;;
    77) echo "$name: skipped" ;;
    *)
      echo "$name: FAILED with status $status, $((SECONDS - start)) s"
      grep -m 3 -A 8 -E 'FAILED|ERROR SUMMARY' "$logs/$name.log" | cut -c 1-200
      failed=1
      ;;
  esac
}

methods=(path "path --variant ris" "path --variant guided" "path --variant optimal" "path --set sampler=sobol" "path --set light_picking=tree" light bdpt
  "bdpt --variant lvc" "bdpt --variant aware" "bdpt --variant learned" "bdpt --variant guided" "bdpt --variant streaming" "bdpt --variant megakernel" vcm "vcm --variant correlated" sppm vpl)
if [[ $parts == *' tests '* ]]; then
  # Those that measure free memory come last, alone as all.
  for test in $(find "$build/tests" -maxdepth 1 -name 'test_gpu_*' -type f -perm -u+x | sed 's#.*/##' | sort |
    awk '/memory_budget|faults/ {last[++n] = $0; next} {print} END {for (i = 1; i <= n; i++) print last[i]}'); do
    run "$test" 600 "$build/tests/$test"
  done
fi
render=("$build/cli/ambilux" render "$root/scenes/materials.xml" --size 24x24 --spp 4 --backend cuda -o "$logs/image.exr")
for method in "${methods[@]}"; do
  read -ra words <<<"-i $method"
  name=${method// /_}
  # The sanitizer takes parameters of kernels in graphs for memory that is not there.
  [[ $parts != *' memcheck '* ]] || run "memcheck_$name" 300 compute-sanitizer --tool memcheck --error-exitcode 9 "${render[@]}" "${words[@]}" --set graph=false
  if [[ $parts == *' ptx '* ]]; then
    run "code_$name" 300 "${render[@]}" "${words[@]}"
    mv -f "$logs/image.exr" "$logs/code.exr" 2>/dev/null
    CUDA_FORCE_PTX_JIT=1 run "ptx_$name" 300 "${render[@]}" "${words[@]}"
    # Threads add up in any order, and may draw other light vertices of a cache.
    "$build/cli/ambilux" compare "$logs/image.exr" "$logs/code.exr" | sed -n "s/^RMSE */  RMSE to the image of machine code: /p"
  fi
done
exit "$failed"

#!/usr/bin/env bash
# Packs what was built into one archive that runs in any folder of another x86-64 Linux machine with as new a glibc and libstdc++ (for
# example one with a GPU and without compilers).
#
#   scripts/bundle.sh [-o FOLDER] [SCENE]...        makes FOLDER/ambilux.tar.xz (bundle/ unless -o is given)
#
# SCENE is a folder with scene.xml, packed as data/scenes/NAME. The project's own scenes are always packed. On the other machine:
#   tar xf ambilux.tar.xz && ambilux/run.sh ambilux render ambilux/scenes/cornell.xml -o out.exr
#   ambilux/run.sh gpu-tests
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

output=bundle
if [[ ${1:-} == -o ]]; then
  [[ -n ${2:-} ]] || { say "bundle: -o needs a folder"; exit 2; }
  output=$2
  shift 2
fi
program=$(ambilux_program)
[[ -x $program ]] || { say "bundle: $program is not built; run scripts/build.sh first"; exit 3; }

stage=$(mktemp -d)
trap 'rm -rf "$stage"' EXIT
top="$stage/ambilux"
mkdir -p "$top"/{bin,lib,scenes}
cp "$program" "$top/bin/"
mapfile -t tests < <(ctest --test-dir "$build" --show-only=json-v1 -L '^gpu$' | python3 -c '
import json, sys
for test in json.load(sys.stdin)["tests"]:
    if "command" in test:  # absent while the test is not built
        print(test["command"][0])')
((${#tests[@]})) && cp "${tests[@]}" "$top/bin/"

# The C and C++ run-time libraries and the driver belong to the machine; everything else comes along.
system='^(linux-vdso|ld-linux.*|libc|libm|libdl|libpthread|librt|libstdc\+\+|libgcc_s|libcuda)\.so'
for binary in "$top"/bin/*; do
  while read -r name arrow path _; do
    [[ $arrow == '=>' ]] || continue
    [[ $name =~ $system ]] && continue
    [[ $path == /* ]] || { say "bundle: $binary needs $name, which is not on this machine"; exit 3; }
    cp -Lu "$path" "$top/lib/$name"
  done < <(ldd "$binary")
done

cp -r scenes/*.xml scenes/assets "$top/scenes/"
mkdir "$top/experiments" && cp experiments/*.toml "$top/experiments/"
for scene in "$@"; do
  [[ -f $scene/scene.xml ]] || { say "bundle: $scene has no scene.xml"; exit 3; }
  mkdir -p "$top/data/scenes"
  cp -rL "$scene" "$top/data/scenes/$(basename "$(realpath "$scene")")"
done

cat >"$top/run.sh" <<'RUN'
#!/usr/bin/env bash
# run.sh PROGRAM [ARGUMENT]...   runs bin/PROGRAM with the packed libraries
# run.sh gpu-tests               runs every packed test; exit status 1 if one failed
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
export LD_LIBRARY_PATH="$here/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
[[ -d $here/data && -z ${AMBILUX_DATA:-} ]] && export AMBILUX_DATA="$here/data"
export AMBILUX_SCENES="$here/scenes"
if [[ ${1:-} != gpu-tests ]]; then
  [[ -x $here/bin/${1:-} && -n ${1:-} ]] || { echo "run.sh: no program '${1:-}'; there are: $(ls "$here/bin" | tr '\n' ' ')gpu-tests" >&2; exit 2; }
  exec "$here/bin/$1" "${@:2}"
fi
passed=0 failed=0
for test in "$here"/bin/test_*; do
  [[ -x $test ]] || continue
  echo "== $(basename "$test")"
  if "$test"; then passed=$((passed + 1)); else failed=$((failed + 1)); fi
done
echo "$passed passed, $failed failed"
((failed == 0 && passed > 0))
RUN
chmod +x "$top/run.sh"

mkdir -p "$output"
# xz: every machine with tar has it, unlike zstd. The programs hold the same kernels: a dictionary as large as all of them keeps one copy.
archive="$output/ambilux.tar.xz"
tar -C "$stage" -cf - ambilux | xz -T1 --lzma2=preset=3,dict=256MiB >"$archive.part"
mv "$archive.part" "$archive"
echo "$archive: $(du -h "$archive" | cut -f1), $(find "$top/bin" -type f | wc -l) programs, $(find "$top/lib" -type f | wc -l) libraries"

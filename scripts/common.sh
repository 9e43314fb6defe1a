# shellcheck shell=bash
# Sourced by the other scripts: where things are, and how many jobs this machine bears.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
build="${AMBILUX_BUILD_DIR:-$root/build}"
# shellcheck disable=SC2034  # used by the scripts that source this
python="$root/.venv/bin/python"

say() { printf '%s\n' "$*" >&2; }

# One job per core, but no more than one per 2 GiB of memory: nvcc and template-heavy C++ need about that.
jobs() {
  local cores memory_gib by_memory
  cores=$(nproc)
  memory_gib=$(awk '/^MemAvailable:/ {print int($2 / 1048576)}' /proc/meminfo 2>/dev/null || echo 4)
  by_memory=$((memory_gib / 2))
  ((by_memory < 1)) && by_memory=1
  echo $((cores < by_memory ? cores : by_memory))
}

# configure_and_build [TARGET...]: Release build in $build; AMBILUX_CMAKE_ARGS adds options.
configure_and_build() {
  local targets=()
  (($#)) && targets=(--target "$@")
  # shellcheck disable=SC2086  # AMBILUX_CMAKE_ARGS is a list of words
  cmake --preset release -B "$build" ${AMBILUX_CMAKE_ARGS:-}
  cmake --build "$build" -j "$(jobs)" "${targets[@]}"
}

# Kernels take most of the time of a build: they are built where a device can run them, or with AMBILUX_CUDA=ON.
cuda_where_it_runs() {
  local cuda=${AMBILUX_CUDA:-}
  if [[ -z $cuda ]]; then
    cuda=OFF
    nvidia-smi -L >/dev/null 2>&1 && cuda=AUTO
  fi
  echo "$cuda"
}

# Path of the built program.
ambilux_program() { echo "$build/cli/ambilux"; }

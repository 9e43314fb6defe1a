#!/usr/bin/env bash
# Installs what building, testing and the analysis need and is not there yet: Debian 12 or Ubuntu 24.04 packages, and
# a Python environment in .venv. Prints nothing when all is there. Safe to run again.
# --fuzz: also what scripts/fuzz.sh needs.
# Exit code 4: something is missing and could not be installed; the message says what, and which command installs it.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

# Tools count as present when the command is, wherever it came from; libraries when the package is.
declare -A tools=([g++]=g++ [cmake]=cmake [ninja]=ninja-build [ccache]=ccache [git]=git)
libraries=(
  libembree-dev libtbb-dev libopenexr-dev libimath-dev libpng-dev libjpeg-dev libpugixml-dev libtinygltf-dev zlib1g-dev libboost-dev libssl-dev
  catch2 libcli11-dev libfmt-dev libspdlog-dev nlohmann-json3-dev libtomlplusplus-dev
)

if [[ ${1:-} == --fuzz ]]; then
  tools[clang++-19]=clang-19
  libraries+=(libclang-rt-19-dev)
fi

missing=()
for tool in "${!tools[@]}"; do
  command -v "$tool" >/dev/null || missing+=("${tools[$tool]}")
done
# ensurepip is what Debian leaves out of python3 and ships in python3-venv.
python3 -c 'import venv, ensurepip' 2>/dev/null || missing+=(python3-venv)
# Headers, for the Python module.
python3 -c 'import os, sys, sysconfig; sys.exit(not os.path.exists(sysconfig.get_path("include") + "/Python.h"))' ||
  missing+=(python3-dev)

if command -v dpkg-query >/dev/null; then
  for package in "${libraries[@]}"; do
    [[ $(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null) == installed ]] || missing+=("$package")
  done
else
  say "setup: this is no Debian or Ubuntu; make sure that the equivalents of these are installed: ${libraries[*]}"
fi

give_up() {
  say "setup: $1"
  say "setup: missing packages: ${missing[*]}"
  say "setup: install them with: sudo apt-get update && sudo apt-get install -y ${missing[*]}"
  exit 4
}

if ((${#missing[@]})); then
  command -v apt-get >/dev/null || give_up "apt-get not found"
  as_root=()
  if ((EUID != 0)); then
    command -v sudo >/dev/null || give_up "not root, and sudo not found"
    as_root=(sudo)
    [[ -t 0 ]] || as_root=(sudo -n)  # nobody there to type a password
  fi
  say "setup: installing ${missing[*]}"
  log=$(mktemp)
  trap 'rm -f "$log"' EXIT
  apt_get() { "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q "$@" >>"$log" 2>&1 </dev/null; }
  # A list that cannot be refreshed may still serve.
  apt_get update || say "setup: apt-get update failed; trying with the package lists that are there"
  if ! apt_get install -y --no-install-recommends "${missing[@]}"; then
    tail -n 20 "$log" >&2
    give_up "apt-get install failed"
  fi
fi

# The Python environment is made anew when requirements.txt or the interpreter changed.
stamp="$root/.venv/.made-from"
wanted="$(python3 --version) $(sha256sum <requirements.txt)"
if [[ ! -x $python || $(cat "$stamp" 2>/dev/null) != "$wanted" ]]; then
  say "setup: making the Python environment in .venv"
  rm -rf "$root/.venv"
  python3 -m venv "$root/.venv"
  if ! "$python" -m pip install --quiet --disable-pip-version-check -r requirements.txt; then
    say "setup: pip could not install the packages of requirements.txt into .venv"
    exit 4
  fi
  echo "$wanted" >"$stamp"
fi

# The same places in which CMake looks (cmake/dependencies.cmake). CUDA is optional, and the run must not depend on a message.
if ! command -v nvcc >/dev/null && [[ ! -x /usr/local/cuda/bin/nvcc && -z ${CUDACXX:-} ]]; then
  say "setup: nvcc not found: Ambilux is built without its CUDA backend (the CPU backend does everything)"
fi

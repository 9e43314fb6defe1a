#!/usr/bin/env bash
# Installs what building, testing and the analysis need and is not there yet: Debian 12 or Ubuntu 24.04 packages, and
# a Python environment in .venv. Prints nothing when all is there. Safe to run again.
#   scripts/setup.sh         everything
#   scripts/setup.sh demo    what scripts/demo.sh needs: no tools of tests, of formats and of the Python module
#   scripts/setup.sh fuzz    everything, and what scripts/checks/fuzz.sh needs
# Exit code 4: something is missing and could not be installed; the message says what, and which command installs it.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

whole=1 fuzz=
case $* in
  "") ;;
  demo) whole= ;;
  fuzz) fuzz=1 ;;
  *) say "usage: scripts/setup.sh [demo|fuzz]"; exit 2 ;;
esac

# Tools count as present when the command is, wherever it came from; libraries when the package is.
declare -A tools=([g++]=g++ [cmake]=cmake [ninja]=ninja-build [git]=git)
libraries=(
  libembree-dev libtbb-dev libopenexr-dev libimath-dev libpng-dev libjpeg-dev libpugixml-dev libtinygltf-dev libmeshoptimizer-dev zlib1g-dev libboost-dev libssl-dev
  libcli11-dev libfmt-dev libspdlog-dev nlohmann-json3-dev libtomlplusplus-dev libcpp-httplib-dev
)
requirements=(requirements.txt)
if [[ $whole ]]; then
  tools[ccache]=ccache
  libraries+=(catch2 libopenmpi-dev openmpi-bin)
  requirements+=(requirements-tests.txt)
fi

if [[ $fuzz ]]; then
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
[[ -z $whole ]] ||
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

log=$(mktemp)
trap 'rm -f "$log"' EXIT
as_root=()
apt_get() { "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q "$@" >>"$log" 2>&1 </dev/null; }

if ((${#missing[@]})); then
  command -v apt-get >/dev/null || give_up "apt-get not found"
  if ((EUID != 0)); then
    command -v sudo >/dev/null || give_up "not root, and sudo not found"
    as_root=(sudo)
    [[ -t 0 ]] || as_root=(sudo -n)  # nobody there to type a password
  fi
  say "setup: installing ${missing[*]}"
  # A list that cannot be refreshed may still serve.
  apt_get update || say "setup: apt-get update failed; trying with the package lists that are there"
  if ! apt_get install -y --no-install-recommends "${missing[@]}"; then
    tail -n 20 "$log" >&2
    give_up "apt-get install failed"
  fi
fi

# Browser tests skip without a Chromium. Ubuntu's package is a snap, which needs more than apt.
if [[ $whole ]] && grep -qs '^ID=debian' /etc/os-release &&
  ! command -v chromium >/dev/null && ! command -v google-chrome >/dev/null; then
  ((EUID == 0)) || as_root=(sudo -n)
  say "setup: installing chromium for browser tests"
  # Fonts: a page without any draws no text.
  { ((${#missing[@]})) || apt_get update || true; } && apt_get install -y --no-install-recommends chromium fonts-dejavu-core ||
    say "setup: chromium could not be installed; browser tests are skipped"
fi

# The Python environment is made anew when the requirements or the interpreter changed; the larger one serves the demo too.
stamp="$root/.venv/.made-from"
made_from() { echo "$(python3 --version) $(cat "$@" | sha256sum)"; }
made=$(cat "$stamp" 2>/dev/null || true)
if [[ ! -x $python || ($made != "$(made_from requirements.txt requirements-tests.txt)" && $made != "$(made_from "${requirements[@]}")") ]]; then
  say "setup: making the Python environment in .venv"
  rm -rf "$root/.venv"
  python3 -m venv "$root/.venv"
  # Modules are compiled when they are imported: few of those that come along are, and compiling all takes as long as installing them.
  if ! "$python" -m pip install --no-compile --quiet --disable-pip-version-check "${requirements[@]/#/-r}"; then
    say "setup: pip could not install the packages of ${requirements[*]} into .venv"
    exit 4
  fi
  made_from "${requirements[@]}" >"$stamp"
fi
# The package's sources, for `python -m ambilux.analysis`; a built or an installed package comes before them.
for site in "$root"/.venv/lib/python3*/site-packages; do echo "$root/python" >"$site/ambilux-sources.pth"; done

# The same places in which CMake looks (cmake/dependencies.cmake). CUDA is optional, and the run must not depend on a message.
if ! command -v nvcc >/dev/null && [[ ! -x /usr/local/cuda/bin/nvcc && -z ${CUDACXX:-} ]]; then
  say "setup: nvcc not found: Ambilux is built without its CUDA backend (the CPU backend does everything)"
fi

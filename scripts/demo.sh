#!/usr/bin/env bash
# Sets up, builds, runs experiments/demo.toml on the project's own scenes and makes out/demo/report.html. A run that
# was interrupted goes on where it stopped; delete out/demo to start over.
# An installed package ambilux with its analysis (pip install ".[analysis]") is used as it is: nothing is built then.
# CUDA kernels are built when a device is there, or with AMBILUX_CUDA=ON.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
has_all='import sys, importlib.util as u
sys.exit(not all(map(u.find_spec, ("ambilux._core", "scipy", "matplotlib", "OpenEXR", "PIL"))))'
installed=$(cd / && command -v python3 || true)
if [[ -n $installed ]] && (cd / && "$installed" -c "$has_all") 2>/dev/null; then
  say "demo: with the installed package ambilux"
  python=$installed
  program=("$python" -m ambilux.cli)
else
  scripts/setup.sh demo
  # A folder of its own: that of scripts/test.sh may hold kernels.
  build="${AMBILUX_BUILD_DIR:-$root/build-demo}"
  # The levels of features that its scenes need and the one that holds all, the host's code at -O1.
  levels="Diffuse;Untextured;All"
  say "demo: built for a quick start, for scenes as these (docs/building.md); scripts/build.sh builds what figures are to come from"
  AMBILUX_CMAKE_ARGS="-DAMBILUX_CPU_LEVELS=$levels -DAMBILUX_CUDA_LEVELS=$levels -DAMBILUX_CPU_OPTIMISE=OFF
    -DAMBILUX_CUDA=$(cuda_where_it_runs) -DAMBILUX_PYTHON=OFF -DAMBILUX_TESTS=OFF ${AMBILUX_CMAKE_ARGS:-}"
  configure_and_build ambilux
  program=("$(ambilux_program)")
fi
start=$SECONDS
"${program[@]}" experiment experiments/demo.toml -o out/demo --references scenes/references --resume
say "demo: the experiment took $((SECONDS - start)) s"
made=$SECONDS
"$python" -m ambilux.analysis out/demo -o out/demo
say "demo: the report took $((SECONDS - made)) s"
echo "report: $root/out/demo/report.html"

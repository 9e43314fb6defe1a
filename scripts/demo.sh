#!/usr/bin/env bash
# Sets up, builds, runs experiments/demo.toml on the project's own scenes and makes out/demo/report.html. A run that
# was interrupted goes on where it stopped; delete out/demo to start over.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
scripts/setup.sh
configure_and_build ambilux
start=$SECONDS
"$(ambilux_program)" experiment experiments/demo.toml -o out/demo --resume
say "demo: the experiment took $((SECONDS - start)) s"
"$python" -m analysis out/demo -o out/demo
echo "report: $root/out/demo/report.html"

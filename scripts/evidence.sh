#!/usr/bin/env bash
# Makes the figures of docs/results.md, peers.md, performance.md, claims.md and scaling.md: measures them, and writes the pages.
#   scripts/evidence.sh run [-o FOLDER] [--seconds N] [--only STAGE ...] [--cpu]   on a device: needs the program and Python alone; goes on where it stopped
#   scripts/evidence.sh pack [-o FOLDER] --target FOLDER                           what pages need of it, in files of at most 15 MB
#   scripts/evidence.sh page [-o FOLDER]                                           docs/data, pictures and pages; needs scripts/setup.sh
#   scripts/evidence.sh status [-o FOLDER]
# --quick: everything small on a CPU, into out/evidence-quick; no evidence. AMBILUX names the program, such as a packed one (scripts/bundle.sh).
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
[[ -x $python ]] || python=python3
export AMBILUX=${AMBILUX:-$(ambilux_program)} PYTHONPATH="$root/python${PYTHONPATH:+:$PYTHONPATH}"
exec "$python" -m ambilux.analysis.evidence "$@"

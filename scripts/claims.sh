#!/usr/bin/env bash
# Rebuilds claims of papers, by default those of experiments/claims (docs/extending.md, "A claim of a paper"). docs/claims.md: scripts/evidence.sh.
#   scripts/claims.sh [run|page] [--only NAME ...] [-o FOLDER] [--claims FOLDER]   both steps, or one: running needs the program and Python alone, on a device about 15 minutes
#   scripts/claims.sh --quick                                                     every claim small, at most five minutes on two cores, into out/claims-quick
# Goes on where it stopped. AMBILUX names the program, such as a packed one (scripts/bundle.sh): "ambilux/run.sh ambilux".
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
[[ -x $python ]] || python=python3
export AMBILUX=${AMBILUX:-$(ambilux_program)} PYTHONPATH="$root/python${PYTHONPATH:+:$PYTHONPATH}"

[[ ${1:-} == run || ${1:-} == page ]] && exec "$python" -m ambilux.analysis.claims "$@"
status=0
"$python" -m ambilux.analysis.claims run "$@" || status=$?
((status < 2)) && "$python" -m ambilux.analysis.claims page "$@"
exit "$status"

#!/usr/bin/env bash
# Rebuilds claims of papers, by default those of experiments/claims (docs/extending.md, "A claim of a paper"). docs/claims.md: scripts/evidence.sh.
#   scripts/claims.sh [run|page] [--only NAME ...] [-o FOLDER] [--claims FOLDER]   both steps, or one: running needs the program and Python alone, on a device an estimated 17 minutes
#   scripts/claims.sh --quick                                                     every claim small, at most five minutes on two cores, into out/claims-quick
# Goes on where it stopped. Folders are seen from where it is called. AMBILUX names the program, such as a packed one (scripts/bundle.sh): "ambilux/run.sh ambilux".
from=$PWD
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
[[ -x $python ]] || python=python3
export AMBILUX=${AMBILUX:-$(ambilux_program)} PYTHONPATH="$root/python${PYTHONPATH:+:$PYTHONPATH}"

arguments=() before=""
for argument; do
  [[ $before =~ ^(-o|--output|--claims|--page)$ ]] && argument=$(cd "$from" && realpath -ms --relative-to="$root" -- "$argument")
  arguments+=("$argument") before=$argument
done
set -- "${arguments[@]}"

[[ ${1:-} == run || ${1:-} == page ]] && exec "$python" -m ambilux.analysis.claims "$@"
status=0
"$python" -m ambilux.analysis.claims run "$@" || status=$?
((status < 2)) && "$python" -m ambilux.analysis.claims page "$@"
exit "$status"

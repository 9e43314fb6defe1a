#!/usr/bin/env bash
# Rebuilds the published claims of experiments/claims and writes docs/claims.md (docs/extending.md, "A claim of a paper").
#   scripts/claims.sh [run|page] [--only NAME ...] [-o FOLDER] [--claims FOLDER]   both steps, or one: running needs the program and Python alone, on a device about 15 minutes
#   scripts/claims.sh --quick                                                     every claim small, at most five minutes on two cores; the page goes to out/claims-quick
#   scripts/claims.sh pack FOLDER FILE.tar.gz                                     what the page needs of results from elsewhere
# Goes on where it stopped. AMBILUX names the program, such as a packed one (scripts/bundle.sh): "ambilux/run.sh ambilux".
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
[[ -x $python ]] || python=python3
export AMBILUX=${AMBILUX:-$(ambilux_program)} PYTHONPATH="$root/python${PYTHONPATH:+:$PYTHONPATH}"

case ${1:-} in
  run | page) exec "$python" -m ambilux.analysis.claims "$@" ;;
  pack) exec tar -C "$2" -czf "$3" --exclude=state --exclude='*.png' --exclude='images/*/*_[2-9].exr' --exclude='images/*/*_1[0-9].exr' . ;;
esac
status=0
"$python" -m ambilux.analysis.claims run "$@" || status=$?
((status < 2)) && "$python" -m ambilux.analysis.claims page "$@"
exit "$status"

#!/usr/bin/env bash
# Makes the figures and tables of docs/results.md anew, in two steps, which may be on different machines.
#   scripts/bench/results.sh run FOLDER [--reduced]    renders: on a device under eight minutes; needs the program alone
#   scripts/bench/results.sh pack FOLDER FILE.tar.gz   what the second step needs of it, tens of megabytes: images of the first seed of glass
#   scripts/bench/results.sh page FOLDER               figures into docs/images/results, tables into docs/results.md; needs scripts/setup.sh
# AMBILUX names the program, such as a packed one (scripts/bundle.sh): "ambilux/run.sh ambilux".
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"

usage() { say "usage: scripts/bench/results.sh run FOLDER [--reduced] | pack FOLDER FILE.tar.gz | page FOLDER"; exit 2; }
(($# >= 2)) || usage
step=$1 folder=$2
experiments=(results results_switches)
read -ra program <<<"${AMBILUX:-$(ambilux_program)}"

case $step in
  run)
    for e in "${experiments[@]}"; do
      resume=()
      [[ -f $folder/$e/config.resolved.toml ]] && resume=(--resume)
      begin=$SECONDS
      "${program[@]}" experiment "experiments/$e.toml" -o "$folder/$e" --references "$folder/references" "${resume[@]}" "${@:3}"
      say "$e: $((SECONDS - begin)) s"
    done
    ;;
  pack)
    [[ -n ${3:-} ]] || usage
    # Errors were measured already: images are for the insets of one scene.
    tar -C "$folder" -czf "$3" --exclude='state' --exclude='*.png' --exclude='references/cornell*' --exclude='references/materials*' \
      --exclude='references/lights*' --exclude='images/cornell/*' --exclude='images/materials/*' --exclude='images/lights/*' \
      --exclude='images/glass/*_[2-9].exr' --exclude='results_switches/images' .
    say "$3: $(du -h "$3" | cut -f1)"
    ;;
  page)
    for e in "${experiments[@]}"; do "$python" -m ambilux.analysis "$folder/$e" -o "$folder/$e/figures" || say "$e: not all figures were made"; done
    "$python" scripts/bench/results_page.py "$folder" docs/results.md docs/images/results
    ;;
  *) usage ;;
esac

#!/usr/bin/env bash
# Checks that all .h, .cpp, .cu and .cuh files are formatted as .clang-format says, and names those that are not.
# Exit status: 0 all are, 1 some are not, 3 no git checkout, 4 no clang-format. scripts/checks/check_format.sh --fix formats.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
formatter="$root/.venv/bin/clang-format"
[[ -x $formatter ]] || { say "check_format: $formatter is not there; run scripts/setup.sh first"; exit 4; }
git rev-parse --is-inside-work-tree >/dev/null || { say "check_format: only a git checkout tells which files are ours"; exit 3; }
sources() {
  git ls-files -z --cached --others --exclude-standard -- '*.h' '*.cpp' '*.cu' '*.cuh' |
    while IFS= read -rd '' file; do
      [[ ! -f $file ]] || printf '%s\0' "$file"  # one may be deleted and not yet committed
    done
}
on_sources() { sources | xargs -0 -P "$(nproc)" -n 16 "$formatter" "$@"; }

if [[ ${1:-} == --fix ]]; then
  on_sources -i
  exit
fi
output=$(on_sources --dry-run 2>&1) || { say "check_format: $formatter failed: $output"; exit 4; }
# The first place of each file.
wrong=$(sed -nE 's/^([^:]+:[0-9]+):.*\[-Wclang-format-violations\]$/\1/p' <<<"$output" | sort -t: -k1,1 -k2,2n | sort -t: -k1,1 -su)
[[ -z $wrong ]] && exit
say "check_format: not as .clang-format says:"
say "$wrong"
say "check_format: scripts/checks/check_format.sh --fix formats them"
exit 1

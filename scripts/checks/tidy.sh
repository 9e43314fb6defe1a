#!/usr/bin/env bash
# Runs clang-tidy with the checks of .clang-tidy over the sources that are no tests, or over the given ones, for example:
#   scripts/checks/tidy.sh film/ztest.cpp
# It reads the compile database of a CPU-only build, which it configures in build-tidy. All take minutes. Exit status 1
# when something was found.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
tidy="$root/.venv/bin/clang-tidy"
[[ -x $tidy ]] || { say "tidy: $tidy is not there; run scripts/setup.sh first"; exit 4; }
database="$root/build-tidy"
cmake -S "$root" -B "$database" -G Ninja -DAMBILUX_CUDA=OFF -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON >/dev/null
cmake --build "$database" --target ambilux_version >/dev/null  # a header that a source includes

# Of the generated renderers those with all features, which hold the code of the others.
all() {
  "$python" - "$database/compile_commands.json" <<'PYTHON'
import json, re, sys
for entry in json.load(open(sys.argv[1])):
    if not re.search(r"/tests/|/render/\w+_(Diffuse|Untextured|Triangle|Masked)\.cpp$", entry["file"]):
        print(entry["file"])
PYTHON
}
if (($#)); then files=("$@"); else mapfile -t files < <(all); fi
((${#files[@]})) || { say "tidy: no sources"; exit 3; }
printf '%s\0' "${files[@]}" | xargs -0 -P "$(jobs)" -n 1 "$tidy" -p "$database" --quiet 2>/dev/null || { say "tidy: see above"; exit 1; }
say "tidy: ${#files[@]} sources, nothing found"

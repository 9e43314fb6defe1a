"""What docs/data holds of a stage, and the parts of pages that are made of it.

docs/data/STAGE.json: {"source": where, when and with what it was measured, "blocks": {name: block}}. A block is a table
{"columns", "rows"}, {"list": [texts]} or {"figures": [[title, file]]}. A cell is a text, a number, null, or
{"value", "low", "high"} with an interval and perhaps "doubt" (shown in place of it) and "mark" (shown behind it).
A page holds a block between <!-- evidence: STAGE/NAME --> and <!-- end -->.
"""

import json
import math
import re
import subprocess

from ambilux.analysis import tables
from ambilux.analysis.evidence import stages
from ambilux.analysis.experiment import InputError

FOLDER = "docs/data"
BLOCK = re.compile(r"<!-- evidence: (\w+)/(\w+) -->\n(.*?)<!-- end -->", re.S)
DEVICE_CODE = ("backends/cuda", "stages", "transport", "integrators", "queues", "items", "render", "accel")
OLD = 50  # commits of device code
STATED = 2  # commands that a caption has


class Judged:
    """Of a cell with an interval, as tables.interval wants it."""

    def __init__(self, cell):
        self.value, self.low, self.high = (math.nan if cell.get(k) is None else cell[k] for k in ("value", "low", "high"))


def cell_text(cell):
    if isinstance(cell, dict):
        return tables.minus(cell.get("doubt") or tables.interval(Judged(cell))) + cell.get("mark", "")
    return tables.minus(tables.number(cell)) if isinstance(cell, float) else "–" if cell is None else str(cell)


def judged(j, doubt=False, mark=""):
    """Cell of a heavy_tails.Judged. doubt: why there is no interval stands in place of the value."""
    known = {k: v for k in ("value", "low", "high") if not math.isnan(v := float(getattr(j, k)))}
    return known | ({"doubt": j.doubt} if doubt and j.doubt else {}) | ({"mark": mark} if mark else {})


def line(cells):
    return "| " + " | ".join(c.replace("|", "\\|") for c in cells) + " |"


def block_lines(block):
    if "list" in block:
        return [f"- {text}" for text in block["list"]] or ["None."]
    if "figures" in block:
        return [text for title, file in block["figures"] for text in (f"![{title}]({file})", "")][:-1]
    head = [line(block["columns"]), "|" + " --- |" * len(block["columns"])]
    rows, before = [], None
    for row in block["rows"]:
        shown = [cell_text(c) for c in row]
        rows.append(line(["" if shown[0] == before and block.get("grouped") else shown[0], *shown[1:]]))
        before = shown[0]
    return head + rows


def age(revision, root):
    """"" of data that are young enough; else why they are old, in words."""
    def git(*words):
        return subprocess.run(["git", "-C", str(root), *words], capture_output=True, text=True, check=False)
    revision = revision.removesuffix("-dirty")
    if not re.fullmatch("[0-9a-f]{7,40}", revision):
        return "of a revision that was not recorded"
    if git("cat-file", "-e", f"{revision}^{{commit}}").returncode:
        return "of a revision that this repository does not have"
    count = int(git("rev-list", "--count", f"{revision}..HEAD", "--", *DEVICE_CODE).stdout or 0)
    return f"more than {OLD} commits of device code behind" if count > OLD else ""


def knows_history(root):
    """Whether the checkout can say how old data are."""
    done = subprocess.run(["git", "-C", str(root), "rev-parse", "--is-shallow-repository"], capture_output=True, text=True, check=False)
    return done.stdout.strip() == "false"


def caption(source):
    """Revision, card and command."""
    old = f"**Old data**, {source['old']}. " if source.get("old") else ""
    small = "**A small run, no evidence.** " if source.get("quick") else ""
    where = [source["card"], *(f"driver {source['driver']}" for _ in [0] if source.get("driver")), *source.get("conditions", [])]
    commands = source["commands"]
    more = f" and {len(commands) - STATED} more like these" if len(commands) > STATED else ""
    told = ", ".join(f"`{c}`" for c in commands[:STATED])
    absent = f" Not run: {'; '.join(source['missing'])}." if source.get("missing") else ""
    return f"{old}{small}Revision {source['revision']}, {source['date']}; {', '.join(where)}. Made by {told}{more}.{absent}"


def content(stored, name):
    """Lines of a block of a page, with its caption where it has figures."""
    block = stored["blocks"][name]
    lines = block_lines(block)
    return lines + ["", f"*{caption(stored['source'])}*"] if "rows" in block else lines


def read(folder):
    """{stage: what is stored of it}."""
    return {file.stem: json.loads(file.read_text(encoding="utf-8")) for file in sorted(folder.glob("*.json"))}


def text_of(stored):
    """JSON with a row in each line."""
    blocks = {}
    for name, block in stored["blocks"].items():
        parts = []
        for key, value in block.items():
            listed = isinstance(value, list) and key != "columns"
            inner = ",\n    ".join(json.dumps(v, ensure_ascii=False) for v in value) if listed else json.dumps(value, ensure_ascii=False)
            parts.append(f'   {json.dumps(key)}: [\n    {inner}]' if listed else f"   {json.dumps(key)}: {inner}")
        blocks[name] = "{\n" + ",\n".join(parts) + "}"
    told = ",\n".join(f"  {json.dumps(name)}: {block}" for name, block in blocks.items())
    return f'{{"source": {json.dumps(stored["source"], ensure_ascii=False)},\n "blocks": {{\n{told}}}}}\n'


def filled(page, stored, where):
    """The text of a page with its blocks made anew."""
    def made(found):
        stage, name = found[1], found[2]
        if stage == "every":
            return marked(stage, name, sources(stored))
        if stage not in stored:
            return marked(stage, name, [f"Not measured yet: `scripts/evidence.sh run --only {stage}`."])
        if name not in stored[stage]["blocks"]:
            raise InputError(f"{where}: there is no {name} in {FOLDER}/{stage}.json")
        return marked(stage, name, content(stored[stage], name))
    return BLOCK.sub(made, page)


def marked(stage, name, lines):
    return f"<!-- evidence: {stage}/{name} -->\n" + "\n".join([*lines, "<!-- end -->"])


def sources(stored):
    """Where every table is from: one revision and one kind of card, or which are of others."""
    rows = [[f"{stages.BY_NAME[name].link}, `{name}`", s["source"]["revision"], s["source"]["card"], s["source"]["date"].split(" ")[0], s["source"].get("old", "")]
            for name, s in stored.items()]
    return block_lines({"columns": ["tables, stage", "revision", "machine", "date", "old"], "rows": rows})

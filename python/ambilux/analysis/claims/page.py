"""docs/claims.md: each claim with what the paper says, what was measured, the verdict, what differs, and the data."""

import os
import re

import matplotlib.pyplot as plt

from ambilux.analysis import captions, comparison, style, tables
from ambilux.analysis.claims import evaluate, registry
from ambilux.analysis.evidence import data

HEAD = """# Published claims

This page compares what papers claim with what Ambilux measures. A script writes it from the files in {folder} and from
results; do not edit it. [How to add a claim]({docs}extending.md#a-claim-of-a-paper).

Each comparison states a ratio that is above 1 where its first run is better. *At equal time* it is error times time of
the second run over that of the first, *at equal samples* error of the second over that of the first, *of rates* rate of
the first over that of the second. Brackets are 95 % intervals, made as those of
[analysis]({docs}analysis.md#how-numbers-are-made). The measure that the paper uses decides. A comparison is

- **reproduced**: the whole interval lies above 1 (or above the bound in column *published*) and, if the paper states a
  value, the interval reaches this value or exceeds it,
- **in part**: the interval lies above 1 and ends below the published value,
- **not**: the interval lies below 1 (or below that bound),
- **undecided**: the interval contains 1 (or that bound), or the data support no interval.

A claim with several comparisons has their common verdict; if they differ, it is *in part* where at least one holds
(reproduced or in part), else *not*.

`scripts/claims.sh` runs all claims, with `--quick` at small size. **A small run is no evidence**; it only shows that a
claim can be run.
"""
NOT_RUN = {"says": "not run", "verdict": "not run", "why": "there are no data of it yet", "full": False, "columns": [], "rows": [],
           "left_out": [], "picture": "", "facts": []}
SHOWN = {"at equal time": "equal time [95 %]", "at equal samples": "equal samples [95 %]", "of rates": "rates [95 %]"}
KEPT = ("Scenes", "Seeds", "Device", "Revision")


def verdict_text(outcome):
    if outcome.evidence:
        return f"**{outcome.verdict}**" + ("" if outcome.status["device"] else " on a CPU")
    return "not run on a device" + (f"; a small run says: {outcome.verdict}" if outcome.found else "")


def published_text(compare):
    if compare.published is None:
        return f"above {compare.above:g}"
    low, high = compare.published
    return tables.number(low) if low == high else f"{tables.number(low)} to {tables.number(high)}"


def ratio_cell(j):
    return None if j is None else data.judged(j, mark=f" (no interval: {j.doubt})" if j.doubt else "")


def table(outcome):
    """The comparisons, the measure that decides first: columns and rows of cells."""
    known = {m for f in outcome.found for m in f.measures}
    measures = sorted(known, key=lambda m: (m != outcome.claim.measure, m))
    rows = []
    for f in outcome.found:
        c = f.compare
        scene = f"{c.scene}, {c.batch}" if c.batch else c.scene
        rows.append([scene, f"{c.run} over {c.over}", published_text(c), *(ratio_cell(f.measures.get(m)) for m in measures), f.says])
    return ["scene", "comparison", "published", *(SHOWN[m] for m in measures), "says"], rows


def facts(outcome):
    """Where, with what and from which data it was measured; commands as a reader types them."""
    compares = [f.compare for f in outcome.found]
    if outcome.data:
        scenes = list(dict.fromkeys(c.scene for c in compares))
        runs = list(dict.fromkeys(r for c in compares for r in (c.run, c.over)))
        yield from (f for f in captions.data_behind(outcome.data, scenes, runs) if f.startswith(KEPT))
    elif outcome.benches:
        devices = ", ".join(dict.fromkeys(b["device"] for b in outcome.benches))
        turns = outcome.claim.bench.turns
        yield f"Device: {devices}; medians of {outcome.benches[0]['repetitions']} launches, {turns} turns"
        yield f"Revision: {outcome.status['version']}"
    yield from (f"Command: `{command}`" for command in outcome.status["commands"])


def picture(outcome, folder):
    """Draws the scene of the claim's key `picture` into `folder`; the file's name, or None: nothing to show."""
    claim = outcome.claim
    if not (outcome.evidence and outcome.data and claim.picture in outcome.data.scenes):
        return None
    try:
        reference, shown = comparison.load(outcome.data, claim.picture)
    except style.NotMade:
        return None
    runs = {r for f in outcome.found if f.compare.scene == claim.picture for r in (f.compare.run, f.compare.over)}
    shown = [entry for entry in shown if entry[0] in runs]
    insets = comparison.choose_insets(reference, [image for _, _, image in shown])
    figure = comparison.draw(outcome.data, claim.picture, reference, shown, insets)
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / f"{claim.name}.png", dpi=150)
    plt.close(figure)
    return f"{claim.name}.png"


def stored(outcome, images):
    """What the page needs of an outcome, as evidence/data.py keeps it; draws its picture into the folder `images`."""
    if outcome.status["state"] == "not run":
        return NOT_RUN
    columns, rows = table(outcome)
    return {"says": outcome.verdict, "verdict": verdict_text(outcome), "why": outcome.why, "full": outcome.evidence, "columns": columns,
            "rows": rows, "left_out": list(outcome.left_out), "picture": picture(outcome, images) or "", "facts": list(facts(outcome))}


def newer_scenes(claim, found):
    """Scenes of the claim of which the data know nothing."""
    known = {row[0].split(", ")[0] for row in found["rows"]} | set(found["left_out"])
    return list(dict.fromkeys(c.scene for c in claim.compares if c.scene not in known))


def section(claim, found, images):
    link = f", [doi:{claim.doi}](https://doi.org/{claim.doi})" if claim.doi else ""
    yield from [f"## {claim.title}", "", f"{claim.paper}{link}.", ""]
    error = ", of RMSE" if claim.error == "rmse" else ""
    yield from [f"Claim ({claim.where}): *{claim.states}* Kind: {claim.kind}{error}.", ""]
    yield from [f"Verdict: {found['verdict']} ({found['why']}).", ""]
    if found["rows"]:
        yield from [*data.block_lines(found), ""]
    if found["left_out"]:
        yield from [f"Scenes that were not found, left out: {', '.join(found['left_out'])}.", ""]
    if found["rows"] and (newer := newer_scenes(claim, found)):
        yield from [f"Scenes that the claim has since these data were made: {', '.join(newer)}.", ""]
    if found["picture"]:
        yield from [f"![{claim.title}: {claim.picture}]({images}/{found['picture']})", ""]
    yield from ["What differs from the paper:", "", *(f"- {d}" for d in claim.differs), ""]
    again = f"scripts/claims.sh --only {claim.name}" + ("" if claim.file.parent.parts[-2:] == registry.PROJECT.parts else f" --claims {claim.file.parent.name}")
    facts = [*found["facts"], f"In one command: `{again}`"]
    yield from [f"How it {'was' if found['rows'] else 'is'} run:", "", *(f"- {f}" for f in facts), ""]


def markdown(claims, blocks, images, root, told=()):
    """The page, for a file in the folder `root`; pictures are in the folder `images`. blocks: {claim: stored()}. told: lines on where it was run."""
    folder, where = (os.path.relpath(path, root) for path in (claims[0].file.parent, images))
    blocks = {c.name: blocks.get(c.name, NOT_RUN) for c in claims}
    full = [blocks[c.name]["says"] for c in claims if blocks[c.name]["full"]]
    counts = f" Of these {evaluate.counted(full)}." if full else ""
    docs = os.path.normpath(os.path.relpath("docs", root) + "/x")[:-1]
    lines = [HEAD.format(folder=f"[{claims[0].file.parent.resolve().name}]({folder})", docs=docs),
             f"{len(claims)} claims, {len(full)} run at full size.{counts}", *told, "",
             "| claim | paper | kind | verdict | small run (no evidence) |", "| --- | --- | --- | --- | --- |"]
    for claim in claims:
        anchor = re.sub(r"[^\w -]", "", claim.title.lower()).replace(" ", "-")
        year = re.search(r"\b(?:19|20)\d\d\b", claim.paper)
        authors = claim.paper[:year.end()] if year else claim.paper
        found = blocks[claim.name]
        verdicts = f"{found['verdict']} |  |" if found["full"] else f"not run on a device | {found['says'] if found['rows'] else ''} |"
        lines.append(f"| [{claim.title}](#{anchor}) | {authors} | {claim.kind} | {verdicts}")
    return "\n".join([*lines, "", *(text for c in claims for text in section(c, blocks[c.name], where))]).rstrip("\n") + "\n"

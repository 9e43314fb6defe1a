"""docs/claims.md: each claim with what the paper says, what was measured, the verdict, what differs, and the data behind it."""

import os
import re

import matplotlib.pyplot as plt

from ambilux.analysis import captions, comparison, style, tables
from ambilux.analysis.claims import evaluate, registry

HEAD = """# Published claims

What papers say, beside what this program measures. `scripts/claims.sh page` writes this page from the files in
{folder} and from results; do not edit it. How verdicts come about and how to add a claim:
[experiments](experiments.md#claims). A ratio says how many times as good the first run is: error times time of the
other over its own *at equal time*, error over error *at equal samples*, time of a sample or rate of rays *of rates*;
brackets are 95 % intervals. **A small run is no evidence**: it shows that the claim can be run.
"""
SHOWN = {"at equal time": "equal time [95 %]", "at equal samples": "equal samples [95 %]", "of rates": "rates [95 %]"}
KEPT = ("Scenes", "Seeds", "Device", "Revision")


def verdict_text(outcome):
    if outcome.evidence:
        return f"**{outcome.verdict}**"
    return "not run on a device" + (f"; a small run says: {outcome.verdict}" if outcome.found else "")


def ratio_text(j):
    return "–" if j is None else tables.interval(j) + (f" ({j.doubt})" if j.doubt else "")


def published_text(compare):
    if compare.published is None:
        return f"above {compare.above:g}"
    low, high = compare.published
    return tables.number(low) if low == high else f"{tables.number(low)} to {tables.number(high)}"


def table(outcome):
    """The comparisons, the measure that decides first."""
    measures = [m for m in sorted(SHOWN, key=lambda m: m != outcome.claim.measure) if any(m in f.measures for f in outcome.found)]
    yield "| " + " | ".join(["scene", "comparison", "published", *(SHOWN[m] for m in measures), "says"]) + " |"
    yield "|" + " --- |" * (4 + len(measures))
    for f in outcome.found:
        c = f.compare
        cells = [c.scene + (f", {c.batch}" if c.batch else ""), f"{c.run} over {c.over}", published_text(c), *(ratio_text(f.measures.get(m)) for m in measures), f.says]
        yield "| " + " | ".join(tables.minus(cell) if i > 2 else cell for i, cell in enumerate(cells)) + " |"


def facts(outcome):
    """Where, with what and from which data it was measured; commands as a reader types them."""
    status, compares = outcome.status, [f.compare for f in outcome.found]
    if outcome.data:
        scenes, runs = dict.fromkeys(c.scene for c in compares), dict.fromkeys(r for c in compares for r in (c.run, c.over))
        yield from (line for line in captions.data_behind(outcome.data, list(scenes), list(runs)) if line.startswith(KEPT))
    elif outcome.benches:
        yield f"Device: {', '.join(dict.fromkeys(b['device'] for b in outcome.benches))}; medians of {outcome.benches[0]['repetitions']} launches, {outcome.claim.bench.turns} turns"
        yield f"Revision: {status['version']}"
    yield from (f"Command: `{command}`" for command in status["commands"])


def picture(outcome, folder):
    """Draws the scene of the claim's key `picture` into `folder`; the file's name, or None where there is nothing to show."""
    claim = outcome.claim
    if not (outcome.evidence and outcome.data and claim.picture in outcome.data.scenes):
        return None
    try:
        reference, shown = comparison.load(outcome.data, claim.picture)
    except style.NotMade:
        return None
    runs = {r for f in outcome.found if f.compare.scene == claim.picture for r in (f.compare.run, f.compare.over)}
    shown = [entry for entry in shown if entry[0] in runs]
    figure = comparison.draw(outcome.data, claim.picture, reference, shown, comparison.choose_insets(reference, [image for _, _, image in shown]))
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / f"{claim.name}.png", dpi=150)
    plt.close(figure)
    return f"{claim.name}.png"


def section(outcome, images, root):
    claim, link = outcome.claim, f", [doi:{outcome.claim.doi}](https://doi.org/{outcome.claim.doi})" if outcome.claim.doi else ""
    yield from [f"## {claim.title}", "", f"{claim.paper}{link}; {claim.where}: *{claim.states}* Kind: {claim.kind}" + (", of RMSE." if claim.error == "rmse" else "."), ""]
    yield from [f"{verdict_text(outcome)[:1].upper()}{verdict_text(outcome)[1:]}: {outcome.why}." if not outcome.evidence else f"Verdict: {verdict_text(outcome)}: {outcome.why}.", ""]
    if outcome.found:
        yield from [*table(outcome), ""]
    if outcome.left_out:
        yield from [f"Left out, since they are not there: {', '.join(outcome.left_out)}.", ""]
    if name := picture(outcome, images):
        yield from [f"![{claim.title}, {claim.picture}]({os.path.relpath(images, root)}/{name})", ""]
    yield from ["What differs from the paper:", "", *(f"- {d}" for d in claim.differs), "", *(f"- {re.sub(r' +', ' ', f)}" for f in facts(outcome)), ""]


def markdown(outcomes, images, root):
    """The page, for a file in the folder `root`; pictures go to the folder `images`."""
    folder = os.path.relpath(outcomes[0].claim.file.parent, root)
    name = f"[{os.path.basename(folder)}]({folder})"
    lines = [HEAD.format(folder=name), f"{evaluate.counted([o for o in outcomes if o.evidence])} (at full size); {sum(not o.evidence for o in outcomes)} not run on a device.", "",
             "| claim | paper | kind | verdict |", "| --- | --- | --- | --- |"]
    for o in outcomes:
        anchor = re.sub(r"[^\w -]", "", o.claim.title.lower()).replace(" ", "-")
        lines.append(f"| [{o.claim.title}](#{anchor}) | {o.claim.paper.split(',')[0]}… {o.claim.where} | {o.claim.kind} | {verdict_text(o)} |")
    return "\n".join([*lines, "", *(line for o in outcomes for line in section(o, images, root))]).rstrip("\n") + "\n"

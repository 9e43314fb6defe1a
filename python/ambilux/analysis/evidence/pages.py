"""Pages from docs/data."""

import shutil

from ambilux.analysis.__main__ import write
from ambilux.analysis.claims import page as claims_page
from ambilux.analysis.claims import registry
from ambilux.analysis.evidence import collect as collecting
from ambilux.analysis.evidence import data, stages

PAGES = sorted({stage.page for stage in stages.STAGES})


def copy(docs, target):
    """Pages and data, to be filled with figures that are no evidence."""
    for path in (*(docs / name for name in PAGES), *(docs / "data").glob("*.json")):
        (target / path.relative_to(docs)).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target / path.relative_to(docs))


def collect(done, place, docs):
    """Writes what was measured; names of the stages."""
    (docs / "data").mkdir(parents=True, exist_ok=True)
    for stage in done:
        folder = docs / "images" / ("claims" if stage.name == "claims" else "evidence")
        write(docs / "data" / f"{stage.name}.json", data.text_of(collecting.collect(place, stage, place.root, folder)))
    return [stage.name for stage in done]


def refreshed(stored, root):
    """With ages as of today; of a checkout without history those that were stated."""
    if data.knows_history(root):
        for name, found in stored.items():
            found["source"]["old"] = collecting.age(stages.BY_NAME[name], found["source"]["revision"], root)
    return stored


def texts(root, docs, stored):
    """{page: its text} as docs/data has it."""
    made = {}
    for name in PAGES:
        if name != "claims.md":
            made[name] = data.filled((docs / name).read_text(encoding="utf-8"), stored, name)
    claims = registry.load(root / "experiments/claims")
    told = ["", f"*{data.caption(stored['claims']['source'])}*"]
    made["claims.md"] = claims_page.markdown(claims, stored["claims"]["blocks"], docs / "images" / "claims", docs, told)
    return made


def write_all(root, docs):
    """Pages that have changed."""
    stored = data.read(docs / "data")
    before = {name: found["source"].get("old") for name, found in stored.items()}
    for name, found in refreshed(stored, root).items():
        if found["source"]["old"] != before[name]:
            write(docs / "data" / f"{name}.json", data.text_of(found))
    changed = {name: text for name, text in texts(root, docs, stored).items() if text != (docs / name).read_text(encoding="utf-8")}
    for name, text in changed.items():
        write(docs / name, text)
    return list(changed)


def card(names, docs):
    """Every table of these stages, on one page."""
    lines = []
    for name, found in data.read(docs / "data").items():
        if name in names:
            tables = [(key, block) for key, block in found["blocks"].items() if block.get("rows")]
            lines += [f"## {name}", "", f"*{data.caption(found['source'])}*", ""]
            lines += [text for key, block in tables for text in (f"{key}:", "", *data.block_lines(block), "")]
    return "\n".join(lines)

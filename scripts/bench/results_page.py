"""Tables and figures of an experiment into docs/results.md: what stands between <!-- NAME --> and <!-- end --> is replaced.

scripts/bench/results_page.py RESULTS PAGE IMAGES, by scripts/bench/results.sh.
"""

import re
import shutil
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python"))
from ambilux.analysis import captions, experiment, flip_maps, remarks, summary, tables, verdicts

FIGURES = {"results": ("overview", "convergence_time_relmse", "convergence_spp", "stage_times", "comparison_glass"), "results_switches": ("ablation",)}
# Untrimmed errors and equal time lead; the others have a table of their own, so that both fit a page.
HEADINGS = (("scene", "run", "spp", "relMSE", "ratio [95 %]", "time to equal RMSE"), ("scene", "run", "RMSE", "MAPE", "FLIP", "trimmed relMSE"))


def markdown(data, lines):
    there = tables.headings(data, lines)
    first, *others = [table(data, lines, [h for h in group if h in there]) for group in HEADINGS]
    return first + [line for other in others for line in ("", *other)]


def table(data, lines, shown):
    biased = verdicts.biased(lines)
    out = ["| " + " | ".join(shown) + " |", "|" + " --- |" * len(shown)]
    scene = None
    for line in lines:
        cells = tables.cells(line, data.base, biased, shown)
        if line.scene == scene:
            cells[0] = ""
        scene = line.scene
        out.append("| " + " | ".join(tables.minus(c).replace("|", "\\|") if i > 1 else c for i, c in enumerate(cells)) + " |")
    return out


def facts(data):
    """Device, revision, references and commands, as captions state them."""
    kept = ("Device", "Clocks", "Revision", "Scenes", "Seeds", "Command")
    found = [text for text in captions.data_behind(data, data.scenes, data.runs) if text.startswith(kept)]
    return [f"- {re.sub(r'^Command: [^ ]*/ambilux ', 'Command: ambilux ', text)}" for text in found]  # wherever the program lies


def said(data, lines):
    return [f"- {tables.minus(text)}" for text in remarks.remarks(data, lines)]


def replaced(page, name, lines):
    pattern = re.compile(rf"(<!-- {re.escape(name)} -->\n).*?(<!-- end -->)", re.S)
    if not pattern.search(page):
        raise SystemExit(f"results_page: there is no <!-- {name} --> ... <!-- end --> in the page")
    return pattern.sub(lambda m: m[1] + "\n".join(lines) + "\n" + m[2], page)


def main(results, page, images):
    text = page.read_text(encoding="utf-8")
    for name, figures in FIGURES.items():
        data = experiment.load(results / name)
        lines = summary.lines(data, flip_maps.of_runs(data))
        text = replaced(text, f"{name}: table", markdown(data, lines))
        text = replaced(text, f"{name}: facts", facts(data))
        text = replaced(text, f"{name}: remarks", said(data, lines))
        shown = []
        for figure in figures:
            made = results / name / "figures" / f"{figure}.png"
            if not made.is_file():
                print(f"results_page: {made} was not made", file=sys.stderr)
                continue
            shutil.copy(made, images / f"{name}_{figure}.png")
            title = (made.parent / f"{figure}.caption.txt").read_text(encoding="utf-8").split("\n", 1)[0]
            shown += [f"![{title}](images/{images.name}/{name}_{figure}.png)", ""]
        text = replaced(text, f"{name}: figures", shown[:-1])
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:4]))

"""python -m analysis RESULTS -o OUT: see README.md.

Writes OUT/convergence_time and OUT/convergence_spp (.pdf, .png), OUT/table (.csv, .tex) and OUT/report.html. Exit codes: 0 done, 2 usage, 3 bad input.
"""

import argparse
import os
import sys
from pathlib import Path

from analysis import experiment as experiments
from analysis import figures, report, summary, tables

FIGURES = (
    ("convergence_time", "seconds", "RMSE against render time. Lines: geometric mean over seeds; bands: least to greatest seed. The noise of the reference is subtracted where it is known."),
    ("convergence_spp", "spp", "RMSE against samples per pixel, drawn likewise."),
)


def write(path, text):
    """Writes a file whole or not at all."""
    temporary = path.with_name(path.name + ".part")
    temporary.write_text(text, encoding="utf-8")
    os.replace(temporary, path)


def analyse(results, out):
    """Reads the experiment folder `results` and writes everything into the folder `out`. Returns what a reader must know (summary.remarks)."""
    data = experiments.load(results)
    out.mkdir(parents=True, exist_ok=True)
    shown = []
    for name, x, title in FIGURES:
        figures.save(figures.convergence(data, x), out / name)
        shown.append((title, out / f"{name}.png"))
    lines = summary.lines(data)
    remarks = summary.remarks(data, lines)
    write(out / "table.csv", tables.to_csv(lines))
    write(out / "table.tex", tables.to_latex(lines, data.runs[0]))
    write(out / "report.html", report.render(data, lines, remarks, shown))
    return remarks


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="python -m analysis", description="Figures, tables and a report of an experiment.")
    parser.add_argument("results", type=Path, help="folder that `ambilux experiment` wrote")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder to write to; may be the same")
    options = parser.parse_args(arguments)
    try:
        remarks = analyse(options.results, options.output)
    except experiments.InputError as e:
        print(f"error: {e}", file=sys.stderr)
        return 3
    for remark in remarks:
        print(f"note: {remark}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())

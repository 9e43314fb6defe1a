"""python -m ambilux.analysis RESULTS -o OUT, python -m ambilux.analysis pack RESULTS -o FILE.zip: see docs/analysis.md.

Writes figures (.pdf, .png, .caption.txt), tables (.csv, .tex) and report.html into OUT. Exit codes: 0 done, 2 usage, 3 bad input or a part that failed (all
others are made, and report.html names it; that a reference is black is no failure), 4 a file that cannot be written.
"""

import argparse
import functools
import os
import sys
from pathlib import Path

from ambilux.analysis import experiment as experiments
from ambilux.analysis import comparison, figures, flip_maps, latex, pack, pyramid, remarks, report, summary, tables


def write(path, text):
    """Writes a file whole or not at all."""
    temporary = path.with_name(path.name + ".part")
    temporary.write_text(text, encoding="utf-8")
    os.replace(temporary, path)


def strategy_rows(data):
    """Rows for tables.variances_to_csv."""
    return [(scene, run, *row) for scene in data.scenes for run in data.runs for row in pyramid.variances(data, scene, run)]


def analyse(results, out, insets=None, full_size=False):
    """Reads the experiment folder `results` and writes everything into the folder `out`. Returns (remarks, figures.Made)."""
    data = experiments.load(results)
    for scene in insets or {}:
        if scene not in data.scenes:
            raise experiments.InputError(f"--inset {scene}: there is no such scene; there are {', '.join(data.scenes)}")
    out.mkdir(parents=True, exist_ok=True)
    early = figures.Made()
    flips = figures.apart(early, "FLIP", lambda: flip_maps.of_runs(data), {})
    lines = summary.lines(data, flips, lambda *name: functools.partial(figures.apart, early, ", ".join(name)))
    said = figures.apart(early, "remarks", lambda: remarks.remarks(data, lines), [])
    figures.apart(early, "table.csv", lambda: write(out / "table.csv", tables.to_csv(lines)))
    for name, text in figures.apart(early, "tables for LaTeX", lambda: latex.files(data, lines), {}).items():
        write(out / name, text)
    made = figures.make_all(data, out, write, insets or {})
    made.broken = early.broken + made.broken
    rows = figures.apart(made, "strategy_variance.csv", lambda: strategy_rows(data))
    if rows:
        write(out / "strategy_variance.csv", tables.variances_to_csv(rows))
    figures.apart(made, "report.html", lambda: write(out / "report.html", report.render(data, lines, said, made, out, full_size)))
    return said, made


def parse_inset(text):
    """("box", (10, 20, 32)) of "box=10,20,32"."""
    scene, _, numbers = text.rpartition("=")
    try:
        x, y, size = (int(n) for n in numbers.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not SCENE=X,Y,SIZE") from None
    if not scene or x < 0 or y < 0 or size < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not SCENE=X,Y,SIZE with X, Y >= 0 and SIZE >= 1")
    return scene, (x, y, size)


def main(arguments=None):
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments[:1] == ["pack"]:
        return pack.main(arguments[1:])
    parser = argparse.ArgumentParser(prog="python -m ambilux.analysis", description="Figures, tables and a report of an experiment.")
    parser.add_argument("results", type=Path, help="folder that `ambilux experiment` wrote")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder to write to; may be the same")
    parser.add_argument("--inset", type=parse_inset, action="append", default=[], metavar="SCENE=X,Y,SIZE",
                        help="square of the comparison figure in pixels, in place of the chosen ones; up to two per scene")
    parser.add_argument("--full-size", action="store_true", help="embed large images whole in report.html; it can become hundreds of megabytes")
    options = parser.parse_args(arguments)
    insets = {}
    for scene, inset in options.inset:
        insets.setdefault(scene, []).append(inset)
        if len(insets[scene]) > comparison.INSETS:
            parser.error(f"--inset {scene}: at most {comparison.INSETS} of a scene")
    try:
        said, made = analyse(options.results, options.output, insets, options.full_size)
    except experiments.InputError as e:
        print(f"error: {e}", file=sys.stderr)
        return 3
    except OSError as e:
        print(f"error: {e.filename or options.output}: {e.strerror}", file=sys.stderr)
        return 4
    for remark in said:
        print(f"note: {remark}", file=sys.stderr)
    for name, reason in made.missing:
        print(f"not made: {name}: {reason}", file=sys.stderr)
    for message in made.broken:
        print(f"error: {message}", file=sys.stderr)
    print(f"{len(made.pictures)} figures, tables and report.html in {options.output}")
    return 3 if made.broken else 0


if __name__ == "__main__":
    sys.exit(main())

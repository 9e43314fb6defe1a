"""python -m ambilux.analysis.stress SWEEP... -o OUT: heat maps and tables of `ambilux stress`, see docs/stress.md.

SWEEP is a folder with a stress.csv: of a backend, or of another renderer (`ambilux stress --judge`). Writes stress.html, figures (.pdf, .png), stress_table.csv
and stress_backends.csv into OUT. Exit codes: 0 done, 2 usage, 3 bad input.
"""

import argparse
import sys
from pathlib import Path

from ambilux.analysis import stress_maps, stress_page, stress_sweep, style
from ambilux.analysis.experiment import InputError


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="python -m ambilux.analysis.stress", description="Heat maps and tables of a stress sweep.")
    parser.add_argument("sweeps", type=Path, nargs="+", help="folder with a stress.csv")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder to write to")
    parser.add_argument("--before", type=Path, action="append", default=[], help="folder of an earlier sweep to compare with; may be given again")
    options = parser.parse_args(arguments)
    try:
        sweep = stress_sweep.load(options.sweeps)
        before = stress_sweep.load(options.before) if options.before else None
    except InputError as e:
        print(f"error: {e}", file=sys.stderr)
        return 3
    options.output.mkdir(parents=True, exist_ok=True)
    stress_sweep.write_tables(sweep, options.output)
    pictures = stress_maps.make_all(sweep)
    for picture in pictures:
        style.save(picture.figure, options.output / picture.name)
    (options.output / "stress.html").write_text(stress_page.render(sweep, before, pictures, options.output), encoding="utf-8")
    print(f"{len(sweep.rows)} rows: " + ", ".join(f"{sweep.count(v)} {v}" for v in stress_sweep.VERDICTS) + f"; {len(pictures)} figures and stress.html in {options.output}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

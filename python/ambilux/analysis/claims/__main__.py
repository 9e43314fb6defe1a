"""Runs published claims, or writes their page. By scripts/claims.sh, from the root of the repository.

python -m ambilux.analysis.claims run  [--quick] [--only NAME ...]   experiments and benches; the standard library and the program are enough
python -m ambilux.analysis.claims page [--quick]                     verdicts and the page, from what was run

Exit codes: 0 done, 1 a command of a claim failed, 3 bad input.
"""

import argparse
import os
import shlex
import sys
from pathlib import Path

from ambilux.analysis.claims import registry, run
from ambilux.analysis.experiment import InputError


def run_all(claims, place):
    device, failed = run.has_device(place), False
    place.out.mkdir(parents=True, exist_ok=True)
    for claim in claims:
        status = run.run(claim, place, device)
        failed |= status["state"] == "failed"
        print(f"{claim.name}: {status['state']}, {status['seconds']:.0f} s" + (f": {status['message']}" if status["message"] else ""), flush=True)
    return int(failed)


def write_page(claims, out, page, images):
    from ambilux.analysis.__main__ import write
    from ambilux.analysis.claims import evaluate
    from ambilux.analysis.claims import page as pages

    outcomes = [evaluate.outcome(claim, out) for claim in claims]
    write(page, pages.markdown(outcomes, images, page.parent))
    small = [o for o in outcomes if o.found and not o.evidence]
    for o in outcomes:
        print(f"{o.claim.name}: {o.verdict}: {o.why}" + (f"; left out: {', '.join(o.left_out)}" if o.left_out else ""))
    print(evaluate.counted(outcomes) + (f"; {len(small)} of them by small runs, which are no evidence" if small else ""))
    return 0


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="python -m ambilux.analysis.claims", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("step", choices=["run", "page"])
    parser.add_argument("--claims", type=Path, default=Path("experiments/claims"), help="folder of NAME.claim.toml (default: experiments/claims)")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="these claims alone")
    parser.add_argument("--quick", action="store_true", help="every experiment --reduced, those that need a device as dry runs; results in out/claims-quick")
    parser.add_argument("-o", "--output", type=Path, help="folder of the results (default: out/claims)")
    parser.add_argument("--page", type=Path, help="the page (default: docs/claims.md, with --quick claims.md in the folder of the results)")
    parser.add_argument("--program", default=os.environ.get("AMBILUX", "build/cli/ambilux"), help="default: AMBILUX, or build/cli/ambilux")
    o = parser.parse_args(arguments)
    out = o.output or Path("out/claims-quick" if o.quick else "out/claims")
    page = o.page or (out / "claims.md" if o.quick else Path("docs/claims.md"))
    try:
        claims = registry.load(o.claims, o.only)
        if o.step == "run":
            return run_all(claims, run.Place(tuple(shlex.split(o.program)), out, o.quick))
        return write_page(claims, out, page, out / "images" if o.quick else page.parent / "images" / "claims")
    except (InputError, run.Failed) as e:
        print(f"error: {e}", file=sys.stderr)
        return 3


if __name__ == "__main__":
    sys.exit(main())

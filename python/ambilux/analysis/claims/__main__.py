"""Runs published claims, or writes their page. By scripts/claims.sh, from the root of the repository.

python -m ambilux.analysis.claims run    experiments and benches: the standard library and the program are enough
python -m ambilux.analysis.claims page   verdicts and the page, from what was run

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
        message = f": {status['message']}" if status["message"] else ""
        print(f"{claim.name}: {status['state']}, {status['seconds']:.0f} s{message}", flush=True)
    return int(failed)


def write_page(claims, out, page, images):
    from ambilux.analysis.__main__ import write
    from ambilux.analysis.claims import evaluate
    from ambilux.analysis.claims import page as pages

    outcomes = [evaluate.outcome(claim, out) for claim in claims]
    page.parent.mkdir(parents=True, exist_ok=True)
    write(page, pages.markdown(claims, {o.claim.name: pages.stored(o, images) for o in outcomes}, images, page.parent))
    for o in outcomes:
        left_out = f"; left out: {', '.join(o.left_out)}" if o.left_out else ""
        print(f"{o.claim.name}: {o.verdict}: {o.why}{left_out}")
    small = any(o.found and not o.evidence for o in outcomes)
    print(evaluate.counted([o.verdict for o in outcomes]) + ("; by small runs, which are no evidence" if small else ""))
    return 0


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="python -m ambilux.analysis.claims", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("step", choices=["run", "page"])
    parser.add_argument("--claims", type=Path, default=registry.PROJECT, help="folder of NAME.claim.toml")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="these claims alone")
    parser.add_argument("--quick", action="store_true", help="experiments --reduced, into out/claims-quick")
    parser.add_argument("-o", "--output", type=Path, help="folder of the results (default: out/claims)")
    parser.add_argument("--page", type=Path, help="default: OUTPUT/claims.md; docs/claims.md is made by scripts/evidence.sh")
    parser.add_argument("--program", default=os.environ.get("AMBILUX", "build/cli/ambilux"), help="default: $AMBILUX")
    o = parser.parse_args(arguments)
    out = o.output or Path("out/claims-quick" if o.quick else "out/claims")
    page = o.page or out / "claims.md"
    images = page.parent / "images" / "claims"
    try:
        claims = registry.load(o.claims, o.only)
        if o.step == "run":
            return run_all(claims, run.Place(tuple(shlex.split(o.program)), out, o.quick))
        return write_page(claims, out, page, images)
    except (InputError, run.Failed) as e:
        print(f"error: {e}", file=sys.stderr)
        return 3


if __name__ == "__main__":
    sys.exit(main())

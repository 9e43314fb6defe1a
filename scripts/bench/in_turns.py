"""Times two programs in turns: CPU seconds of `ambilux render` per sample of every pixel, and their ratio.

Usage: scripts/bench/in_turns.py [--turns 5] [--spp 8] OLD NEW SCENE RENDER_ARGUMENT...
OLD and NEW are ambilux programs, or scripts that start one (by mpirun, say). Seconds are those of the process (user and
system) less those of a render of one sample, so that loading is not in them and other work on the machine hardly is.
Prints the medians, the median of the ratios OLD/NEW with the least and the greatest, the same of wall clock, which is
worth something on a quiet machine only, and whether the images of both are the same to the bit.
"""

import argparse
import hashlib
import pathlib
import resource
import statistics
import subprocess
import tempfile
import time

import numpy as np


def seconds_of(command):
    """CPU seconds, wall clock."""
    start, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return np.array([after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, time.monotonic() - start])


def pixels(path):
    """A hash of the values alone: attributes of an image name its revision."""
    import OpenEXR
    with OpenEXR.File(str(path)) as file:
        channels = file.channels()
        return hashlib.sha256(b"".join(np.ascontiguousarray(channels[c].pixels).tobytes() for c in sorted(channels))).hexdigest()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old")
    parser.add_argument("new")
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--spp", type=int, default=8)
    parser.add_argument("arguments", nargs=argparse.REMAINDER)
    a = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        def seconds(program, name):
            def of(spp):
                out = str(pathlib.Path(folder) / f"{name}.exr")
                return seconds_of([program, "render", *a.arguments, "--backend", "cpu", "--spp", str(spp), "-o", out])
            return (of(a.spp + 1) - of(1)) / a.spp
        pairs = []
        for turn in range(a.turns):
            first = seconds(a.old, "old") if turn % 2 == 0 else None
            second = seconds(a.new, "new")
            pairs.append((first if first is not None else seconds(a.old, "old"), second))
        same = "?"
        try:
            for program, name in ((a.old, "old"), (a.new, "new")):
                seconds_of([program, "render", *a.arguments, "--backend", "cpu", "--spp", "2", "-o", f"{folder}/{name}.exr"])
            same = pixels(f"{folder}/old.exr") == pixels(f"{folder}/new.exr")
        except ImportError:
            pass
    for kind, name in enumerate(("CPU", "wall")):
        old, new = [o[kind] for o, _ in pairs], [n[kind] for _, n in pairs]
        ratios = [o / n for o, n in zip(old, new)]
        print(f"{name}: old {statistics.median(old):.4f} s, new {statistics.median(new):.4f} s a sample; "
              f"old/new {statistics.median(ratios):.3f} ({min(ratios):.3f} to {max(ratios):.3f})")
    print(f"same images: {same}")


if __name__ == "__main__":
    main()

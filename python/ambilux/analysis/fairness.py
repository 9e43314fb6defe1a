"""Was the machine the same for all runs? Remarks on renders whose times are not to be trusted, from what the runner recorded around each."""

from ambilux.analysis import experiment as experiments

BUSY = 0.1  # share of the machine's cores that others may hold
SPREAD = 1.15  # greatest time per sample of a run's seeds over the least
SLOW = 1.05  # greatest mean clock of a render over the least


def machines(experiment, scene, run):
    """{seed: [what the runner recorded of each part of the render]}; {} of older versions."""
    out = {}
    for seed, path in experiment.files("stats", scene, run, ".json"):
        parts = experiments.read_json(path).get("machine")
        if isinstance(parts, list) and parts:
            out[seed] = parts
    return out


def share_of_others(parts):
    """Cores that others held, over all cores, mean over the time of the parts."""
    seconds = sum(p.get("seconds", 0) for p in parts)
    return sum(p.get("seconds", 0) * p.get("other_cores", 0) / max(1, p.get("cores", 1)) for p in parts) / seconds if seconds > 0 else 0.0


def clocks_of(parts):
    """Mean of the recorded MHz, None without."""
    found = [v for p in parts for v in (p.get("cpu_mhz") or {}).values() if v]
    return sum(found) / len(found) if found else None


def attempts(experiment, scene, run):
    """{seed: [earlier renders that were disturbed, as the runner recorded them]}."""
    return {seed: found for seed, path in experiment.files("stats", scene, run, ".json") if (found := experiments.read_json(path).get("attempts"))}


def repeat_remarks(experiment):
    """Renders that were made again, and those whose last attempt was disturbed too."""
    again = {(scene, run, seed): found[-1].get("why", "no reason given") for scene in experiment.scenes for run in experiment.runs
             for seed, found in attempts(experiment, scene, run).items()}
    left = {(d["scene"], d["run"], d["seed"]): d["why"] for d in experiment.manifest.get("disturbed") or []}

    def places(found):
        return listed([f"{scene} {run} seed {seed} ({why})" for (scene, run, seed), why in found.items()], 3)
    mended = {place: why for place, why in again.items() if place not in left}
    if mended:
        yield f"{renders(len(mended))} disturbed and repeated; the last attempt counts: {places(mended)}"
    shared = experiment.manifest.get("ranks_share")
    if shared:
        yield f"{shared}: all times are disturbed, and no render was repeated for that reason"
    if left:
        times = not shared and experiment.manifest.get("repeats")
        tried = f" in each of up to {1 + times} attempts" if times else " and not repeated" + ("" if shared else " (repeats = 0)")
        every = sum(len(experiment.seeds(scene, run)) for scene in experiment.scenes for run in experiment.runs)
        yield f"of {every} renders, {len(left)} {'were' if len(left) > 1 else 'was'} disturbed{tried}; do not trust the times of {places(left)}"


def renders(count):
    return f"{count} render{'s were' if count > 1 else ' was'}"


def slowdown_remarks(experiment):
    """Devices whose clocks were held down during a render."""
    found = {}
    for scene in experiment.scenes:
        for run in experiment.runs:
            for seed, parts in machines(experiment, scene, run).items():
                for name in sorted({n for p in parts for n in (p.get("gpu") or {}).get("slowdowns") or ()}):
                    found.setdefault(name, []).append(f"{scene} {run} seed {seed}")
    for name, places in found.items():
        yield f"the device lowered its clocks ({name}) during {listed(places)}"


def listed(places, most=5):
    return ", ".join(places[:most]) + (f" and {len(places) - most} more" if len(places) > most else "")


def remarks(experiment):
    """Sentences that name renders on a busy machine, seeds whose time per sample differs too much, and clocks that moved."""
    busy, spread, clocks, silent = [], [], {}, 0
    for scene in experiment.scenes:
        for run in experiment.runs:
            last = {r.seed: r.time / r.spp for r in sorted(experiment.select(scene, run), key=lambda r: r.spp)}
            if len(last) > 1 and max(last.values()) > SPREAD * min(last.values()):
                spread.append(f"{scene} {run} {max(last.values()) / min(last.values()):.2f}")
            found = machines(experiment, scene, run)
            silent += not found
            for seed, parts in found.items():
                share = share_of_others(parts)
                if share > BUSY:
                    busy.append((share, f"{scene} {run} seed {seed} ({100 * share:.0f} %)"))
                if (mhz := clocks_of(parts)) is not None:
                    clocks[f"{scene} {run} seed {seed}"] = mhz
    yield from repeat_remarks(experiment)
    yield from slowdown_remarks(experiment)
    told = bool(experiment.manifest.get("disturbed"))  # by the runner, with the reasons
    if busy and not told:
        yield (f"other processes held more than {100 * BUSY:.0f} % of the cores during {len(busy)} renders, whose times are not to be trusted: "
               + listed([place for _, place in sorted(busy, reverse=True)]))
    if spread and not told:
        yield f"time per sample differs between seeds by more than a factor of {SPREAD:g}; repeat these runs on a quiet machine: {listed(spread)}"
    if clocks and max(clocks.values()) > SLOW * min(clocks.values()):
        low, high = min(clocks, key=clocks.get), max(clocks, key=clocks.get)
        yield f"clocks of the CPU moved: {clocks[low]:.0f} MHz at {low}, {clocks[high]:.0f} at {high}"
    if silent == len(experiment.scenes) * len(experiment.runs):
        yield "the load of the machine was not recorded (no render is complete, or an older version made them): the report cannot show disturbed renders"

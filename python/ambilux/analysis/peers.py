"""Other renderers that took part, from peers.json: whether their images agree with the reference, what was changed for them, and who was left out."""

import html

from ambilux.analysis.experiment import InputError, read_json

TIMED = ("agrees", "untested")
STATES = {"agrees": "agrees", "untested": "not tested", "differs": "differs: not timed", "undecided": "undecided: not timed", "missing": "not installed", "refused": "refused"}
NOTE = ("Agreement: block means of the renderer's image against those of the reference, on all scales, with thresholds from the variances of both (film/ztest.h); "
        "p is the chance that images of equal expectation differ as much. Equivalent: shown at the stated level to differ by less than 0.1 % in the mean and 1 % in every block "
        "(film/equivalence.h), whatever p is. Only what is equivalent, or where no difference was found, is timed. Bounds: what mean and worst block differ by at most, at that level. "
        "Times to load and to compile are in no render's time.")


def entries(experiment):
    """One dictionary for each scene and run of another renderer, as the runner found them."""
    if "peers" not in experiment.kept:
        path = experiment.folder / "peers.json"
        found = read_json(path) if path.is_file() else []
        for entry in found if isinstance(found, list) else [None]:
            if not isinstance(entry, dict) or entry.get("state") not in STATES or not {"scene", "run", "renderer"} <= entry.keys():
                raise InputError(f"{path}: not a list of renderers with scene, run, renderer and state")
        experiment.kept["peers"] = found
    return experiment.kept["peers"]


def is_left_out(experiment, scene, run):
    return any(e["scene"] == scene and e["run"] == run and e["state"] not in TIMED for e in entries(experiment))


def verdict(entry):
    """Of STATES; of what agrees, whether that was shown, or no difference was found."""
    a = entry.get("agreement") or {}
    if entry["state"] != "agrees" or "equivalent" not in a:
        return STATES[entry["state"]] + (" with our path tracer" if a.get("with_own_path") else "")
    return f"equivalent (level {a.get('level', 0):g})" if a["equivalent"] else "no difference found" + (" to our path tracer" if a.get("with_own_path") else "")


def percent(value):
    return "" if value is None else f"{100 * value:.2g} %"


def difference(entry):
    """Text such as "mean +0.16 %, worst block z = 11.2 at 40,16"."""
    a = entry.get("agreement") or {}
    worst = a.get("worst") or {}
    mean, z = a.get("relative_difference"), worst.get("z")
    parts = [f"mean {100 * mean:+.3g} %" if mean is not None else None, f"worst block z = {z:.3g} at {worst.get('x')},{worst.get('y')}" if z is not None else None]
    return ", ".join(p for p in parts if p)


def lost(entry):
    """{reason: seeds} of renders that ended before their time."""
    out = {}
    for item in entry.get("lost") or ():
        out.setdefault(item.get("reason") or "no reason given", []).append(item.get("seed"))
    return out


def remarks(experiment):
    """Who was not timed and why; what the others render differently."""
    absent = {}
    for e in entries(experiment):
        if e["state"] == "differs":
            yield f"{e['scene']}, {e['run']}: its image does not agree with the reference ({difference(e)}), so that its time is not compared; the difference is the result"
        elif e["state"] not in TIMED:
            absent.setdefault((e["run"], STATES[e["state"]], e.get("reason") or "no reason given"), []).append(e["scene"])
    for (run, state, reason), scenes in absent.items():
        yield f"{run}: {state} on {', '.join(scenes)} ({reason})"
    for e in entries(experiment):
        for reason, seeds in lost(e).items():
            yield f"{e['scene']}, {e['run']}: seed{'s' if len(seeds) > 1 else ''} {', '.join(map(str, seeds))} left out ({reason})"
    told = {}
    for e in entries(experiment):
        for text in e.get("differences") or () if e["state"] in TIMED else ():
            told.setdefault((e["run"], text), []).append(e["scene"])
    for (run, text), scenes in told.items():
        yield f"{run}: {text}" + ("" if len(scenes) == len(experiment.scenes) else f" ({', '.join(scenes)})")


def seconds(value):
    return "" if value is None else f"{value:.2f}"


def to_html(experiment):
    rows = []
    for e in entries(experiment):
        a = e.get("agreement") or {}
        p, bounds = a.get("p"), " and ".join(filter(None, (percent(a.get("mean_bound")), percent(a.get("block_bound")))))
        cells = [e["scene"], e["run"], e.get("version") or e["renderer"], verdict(e), difference(e), "" if p is None else f"{p:.2g}",
                 bounds or percent(a.get("detectable")), str(a.get("samples", "")), seconds(e.get("load_seconds")), seconds(e.get("compile_seconds")),
                 "; ".join(e.get("changes") or ()), e.get("reason") or "; ".join(e.get("differences") or ())]
        rows.append("<tr>" + "".join(f"<td>{html.escape(c)}</td>" for c in cells) + "</tr>")
    heads = ("scene", "run", "renderer", "state", "difference", "p", "bounds of mean and block", "spp", "load s", "compile s", "scene changed for it", "differs in, or reason")
    return ('<table class="said"><thead><tr>' + "".join(f"<th>{h}</th>" for h in heads) + "</tr></thead><tbody>" + "".join(rows) + "</tbody></table>")

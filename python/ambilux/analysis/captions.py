"""The text that goes with a figure: what is drawn, and the data behind it."""

import textwrap

from ambilux.analysis import remarks


def listed(values):
    """"1, 2, 3, 7" as "1–3, 7" for whole numbers."""
    values, out = sorted(values), []
    for v in values:
        if out and v == out[-1][1] + 1:
            out[-1][1] = v
        else:
            out.append([v, v])
    return ", ".join(f"{a}" if a == b else f"{a}, {b}" if b == a + 1 else f"{a}–{b}" for a, b in out)


def span(values, unit=""):
    low, high = min(values), max(values)
    return (f"{low:.4g}" if low == high else f"{low:.4g}–{high:.4g}") + unit


def reference_facts(reference):
    """How a scene's reference was made: "by bdpt (variant wavefront), 2048 spp, RMS standard error 0.00923". `reference`: its entry of the manifest."""
    settings = dict(part.partition("=")[::2] for part in (reference.get("settings") or "").split())
    integrator = reference.get("integrator") or settings.get("integrator")
    settings.pop("integrator", None)
    if reference.get("variant"):
        settings.setdefault("variant", reference["variant"])
    if integrator == "path":
        settings.setdefault("estimator", "mis")  # how the runner makes references by path tracing (experiments.md)
    how = ", ".join(f"{key} {value}" for key, value in settings.items())
    parts = [f"by {integrator}" + (f" ({how})" if how else "") if integrator else None, f"{reference['spp']} spp" if reference.get("spp") else None,
             f"RMS standard error {reference['noise']:.3g}" if reference.get("noise") is not None else None]
    return ", ".join(p for p in parts if p)


def scene_facts(experiment, scene):
    entry = experiment.scene_entry(scene)
    reference = entry.get("reference") or {}
    parts = [f"{entry['size'][0]}x{entry['size'][1]}" if entry.get("size") else None,
             f"max_depth {entry['max_depth']}" if entry.get("max_depth") is not None else None,
             f"reference {facts}" if (facts := reference_facts(reference)) else None,
             f"hash {entry['hash'][:12]}" if entry.get("hash") else None]
    return f"{scene} ({', '.join(p for p in parts if p)})" if any(parts) else scene


def data_behind(experiment, scenes, runs):
    """Lines that state scenes, runs, seeds, budgets, device, revision and commands. Of what the manifest does not say nothing is claimed."""
    m = experiment.manifest
    rows = [r for r in experiment.rows if r.scene in scenes and r.run in runs]
    versions, machine = m.get("versions") or {}, m.get("machine") or {}
    devices = ", ".join(d for d in m.get("devices") or [] if d)
    driver = f", driver {machine['driver']}" if machine.get("driver") else ""
    config, clocks = m.get("config"), remarks.clock_text(experiment)
    return [line for line in (
        f"Experiment: {experiment.name}, {m.get('date', 'date unknown')}",
        "Scenes: " + "; ".join(scene_facts(experiment, s) for s in scenes),
        "Runs: " + ", ".join(runs),
        f"Seeds: {listed({r.seed for r in rows})}; samples per pixel {span([r.spp for r in rows])}; seconds {span([r.time for r in rows])}" if rows else None,
        f"Device: {devices or 'unknown'} ({machine.get('cpu', 'unknown processor')}{driver})",
        f"Clocks: {clocks}" if clocks else None,
        f"Revision: ambilux {versions.get('ambilux', '?')}, git {versions.get('git_revision', 'unknown')}",
        *(f"Command: {command}" for command in m.get("commands") or []),
        # Of older versions, which did not record how they were called.
        f"Configuration: {config}" if config and not m.get("commands") else None,
        f"Command: python -m ambilux.analysis {experiment.folder.name} -o FIGURES",
    ) if line]


def text(experiment, picture):
    """Content of a .caption.txt file."""
    return "\n".join([picture.title + ".", *textwrap.wrap(picture.caption, 110), "", *data_behind(experiment, picture.scenes, picture.runs), ""])

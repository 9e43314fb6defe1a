"""Where the time goes: seconds of every stage, stacked, a bar per run."""

import zlib

import matplotlib.pyplot as plt
import numpy as np

from ambilux.analysis import experiment as experiments, style

# Of every figure, so that a stage looks the same in all: colour by what is done, hatching for the light side and further stages of a kind.
LOOKS = {
    "generate": (4, ""), "light_generate": (4, "////"), "extend": (0, ""), "light_extend": (0, "////"), "shade": (2, ""), "light_shade": (2, "////"),
    "connect": (1, ""), "connect_camera": (1, "////"), "connect_vertices": (1, "...."), "mis_weight": (3, ""), "occlude": (5, ""), "accumulate": (3, "...."),
    "splat": (3, "////"), "update_film": (6, ""), "megakernel": (6, "////"),
}
SMALL = 0.02  # stages that never reach this share of a bar are drawn as one


def per_sample(stats, path=""):
    """{stage: nanoseconds per pixel and sample} of one render. The runner counts stages since stages_since_spp (after --resume)."""
    try:
        width, height = stats["size"]
        samples = width * height * (stats["spp"] - stats.get("stages_since_spp", 0))
        return {s["name"]: 1e9 * s["seconds"] / samples for s in stats["stages"] if s["seconds"] > 0} if samples > 0 else {}
    except (KeyError, TypeError, ValueError) as e:
        raise experiments.InputError(f"{path}: lacks or misuses {e}: stage times need size, spp and stages [{{name, seconds}}]") from None


def fused(experiment, scenes, runs):
    """Names of stages that had items and no time of their own: they ran inside others."""
    return sorted({s["name"] for scene in scenes for run in runs for stats in experiment.stats(scene, run) for s in stats["stages"] if s.get("items") and not s["seconds"] > 0})


def mean_over_seeds(experiment, scene, run):
    """{stage: mean of per_sample over seeds}, in the order of the first file; {} without stages."""
    renders = [t for _, path in experiment.files("stats", scene, run, ".json") if (t := per_sample(experiments.read_json(path), path))]
    names = list(dict.fromkeys(name for t in renders for name in t))
    return {name: float(np.mean([t.get(name, 0.0) for t in renders])) for name in names}


def looks(stage):
    """Colour and hatching of a stage, whatever else is drawn; of one that is not known by its name alone."""
    index, hatch = LOOKS.get(stage, (zlib.crc32(stage.encode()) % len(style.COLOURS), "xx"))
    return {"color": style.COLOURS[index], "hatch": hatch}


def draw(experiment, times_of, units, width="page"):
    """`times_of`: {(scene, run): {stage: ns}}. width: "page" or "column"."""
    stages = list(dict.fromkeys(s for t in times_of.values() for s in t))
    large = [s for s in stages if any(t.get(s, 0) >= SMALL * sum(t.values()) for t in times_of.values())]
    known = list(LOOKS)
    large.sort(key=lambda s: (known.index(s) if s in known else len(known), s))
    scenes = [s for s in experiment.scenes if any(scene == s for scene, _ in times_of)]
    with plt.rc_context(style.STYLE):
        names = [style.wrap(r, 24) for r in experiment.runs]
        height, points = style.row_height(names, 0.26)
        figure, axes, columns = style.panels(len(scenes), 0.5 + height * len(names), style.across(len(scenes), width))
        for i, (one, scene) in enumerate(zip(axes, scenes)):
            one.set_title(style.wrap(scene, 30))
            for y, run in enumerate(experiment.runs):
                times = times_of.get((scene, run))
                if not times:
                    one.annotate("no stage times", (0, y), xytext=(3, 0), textcoords="offset points", va="center", fontsize=6.5, color="0.4")
                    continue
                shown = [(s, times.get(s, 0.0)) for s in large] + [("other", sum(v for s, v in times.items() if s not in large))]
                left = 0.0
                for stage, value in shown:
                    one.barh(y, value, left=left, height=0.66, edgecolor="white", lw=0.4, label=stage, **({"color": "0.75"} if stage == "other" else looks(stage)))
                    left += value
            one.set_ylim(len(experiment.runs) - 0.45, -0.55)
            one.set_yticks(range(len(experiment.runs)), names if i % columns == 0 else [""] * len(names), fontsize=points)
            one.tick_params(axis="y", length=0)
            one.set_xlabel(units)
            one.margins(x=0.03)
        entries = {}
        for one in axes:
            for handle, text in zip(*one.get_legend_handles_labels()):
                entries.setdefault(text, handle)
        order = [s for s in [*large, "other"] if s in entries]
        style.legend_below(figure, [entries[s] for s in order], order, handlelength=1.2)
    return figure


UNITS = "ns per pixel and sample"
INSIDE = {  # of a backend: what runs inside of other stages (backends/fusion.h), and how its time is known
    "cpu": " On the CPU connect, connect_camera, connect_vertices and occlude run inside of the stages that make their vertices; their time is taken off these, measured of occlude, of the others "
           "estimated from one vertex of sixteen (on a busy machine too little: waits stay with shade). mis_weight and accumulate have no clock: their time is that of the stage that makes the light.",
    "cuda": " On CUDA connect, connect_camera, mis_weight, accumulate and the camera rays of generate run inside of other stages, whose bars hold their time, and the last bounces of a wave count as "
            "shade; `ambilux bench stages SCENE --unfused` estimates the shares from a render without fusion.",
}


def table(experiment):
    """{(scene, run): mean_over_seeds} of those with times, or NotMade."""
    found = {(scene, run): t for scene in experiment.scenes for run in experiment.runs if (t := mean_over_seeds(experiment, scene, run))}
    if not found:
        raise style.NotMade("no stages with times in stats/SCENE/RUN_SEED.json")
    return found


def make(experiment):
    """Yields the figure."""
    found = table(experiment)
    inside = fused(experiment, experiment.scenes, experiment.runs)
    hidden = f" No clock of their own have {', '.join(inside)}: they run inside the stages before them, whose bars hold their time." if inside else ""
    yield style.Picture(
        "stage_times", draw(experiment, found, UNITS), "Time of the stages",
        "Mean over seeds of each stage's time per pixel and sample, as the renderer measured it. On the CPU backend it is summed over worker threads, so that a bar "
        f"divided by their number is near the wall clock's. Stages below {100 * SMALL:g} % of every bar are drawn as one.{''.join(INSIDE[b] for b in experiment.manifest.get('backends') or () if b in INSIDE)}{hidden}",
        list(dict.fromkeys(run for _, run in found)), list(dict.fromkeys(scene for scene, _ in found)))

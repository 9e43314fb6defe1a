"""Where the time goes: seconds of every stage, stacked, a bar per run."""

import matplotlib.pyplot as plt
import numpy as np

from analysis import experiment as experiments, style

SMALL = 0.02  # stages that never reach this share of a bar are drawn as one


def per_sample(stats, path=""):
    """{stage: nanoseconds per pixel and sample} of one render. The runner counts stages since stages_since_spp (after --resume)."""
    try:
        width, height = stats["size"]
        samples = width * height * (stats["spp"] - stats.get("stages_since_spp", 0))
        return {s["name"]: 1e9 * s["seconds"] / samples for s in stats["stages"] if s["seconds"] > 0} if samples > 0 else {}
    except (KeyError, TypeError, ValueError) as e:
        raise experiments.InputError(f"{path}: lacks or misuses {e}: stage times need size, spp and stages [{{name, seconds}}]") from None


def mean_over_seeds(experiment, scene, run):
    """{stage: mean of per_sample over seeds}, in the order of the first file; {} without stages."""
    renders = [t for _, path in experiment.files("stats", scene, run, ".json") if (t := per_sample(experiments.read_json(path), path))]
    names = list(dict.fromkeys(name for t in renders for name in t))
    return {name: float(np.mean([t.get(name, 0.0) for t in renders])) for name in names}


def draw(experiment, table, units):
    """`table`: {(scene, run): {stage: ns}}."""
    stages = list(dict.fromkeys(s for t in table.values() for s in t))
    large = [s for s in stages if any(t.get(s, 0) >= SMALL * sum(t.values()) for t in table.values())]
    # More stages than colours: the largest keep theirs.
    large = sorted(sorted(large, key=lambda s: -max(t.get(s, 0) / sum(t.values()) for t in table.values()))[:28], key=stages.index)
    scenes = [s for s in experiment.scenes if any(scene == s for scene, _ in table)]
    with plt.rc_context(style.STYLE):
        figure, axes, columns = style.panels(len(scenes), 0.5 + 0.26 * len(experiment.runs))
        for i, (one, scene) in enumerate(zip(axes, scenes)):
            one.set_title(style.wrap(scene, 30))
            for y, run in enumerate(experiment.runs):
                times = table.get((scene, run))
                if not times:
                    one.annotate("no stage times", (0, y), xytext=(3, 0), textcoords="offset points", va="center", fontsize=6.5, color="0.4")
                    continue
                shown = [(s, times.get(s, 0.0)) for s in large] + [("other", sum(v for s, v in times.items() if s not in large))]
                left = 0.0
                for j, (stage, value) in enumerate(shown):
                    other = stage == "other"  # seven colours and four hatches: 28 pairs, and neighbours differ in both
                    one.barh(y, value, left=left, height=0.66, color="0.75" if other else style.colour(j), hatch="" if other else style.HATCHES[j % 4],
                             edgecolor="white", lw=0.4, label=stage)
                    left += value
            one.set_ylim(len(experiment.runs) - 0.45, -0.55)
            one.set_yticks(range(len(experiment.runs)), [style.wrap(r, 22) for r in experiment.runs] if i % columns == 0 else [""] * len(experiment.runs))
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


def make(experiment):
    """Yields the figure."""
    table = {(scene, run): t for scene in experiment.scenes for run in experiment.runs if (t := mean_over_seeds(experiment, scene, run))}
    if not table:
        raise style.NotMade("no stages with times in stats/SCENE/RUN_SEED.json")
    yield style.Picture(
        "stage_times", draw(experiment, table, "ns per pixel and sample"), "Time of the stages",
        "Mean over seeds of each stage's time per pixel and sample, as the renderer measured it. On the CPU backend it is summed over worker threads, so that a bar "
        f"divided by their number is near the wall clock's. Stages below {100 * SMALL:g} % of every bar are drawn as one.",
        list(dict.fromkeys(run for _, run in table)), list(dict.fromkeys(scene for scene, _ in table)))

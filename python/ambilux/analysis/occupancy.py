"""How full waves and queues are: what is alive at each depth, and the peak of each queue over its capacity."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import MaxNLocator

from ambilux.analysis import experiment as experiments, stage_times, style

ACROSS = 4  # panels beside each other
STARTS = {"extend": "generate", "shade": "generate", "light_extend": "light_generate", "light_shade": "light_generate"}  # what a stage's items are a share of


def alive(stats):
    """{stage: share by depth} of one render: items of a stage at a depth over the subpaths that were begun."""
    stages = {s["name"]: s for s in stats.get("stages", ())}
    out = {}
    for name, start in STARTS.items():
        begun = stages.get(start, {}).get("items", 0)
        items = stages.get(name, {}).get("items_by_depth") or []
        if begun and any(items):
            out[name] = np.array(items, dtype=float) / begun
    return out


def peaks(stats):
    """{queue: peak over capacity} of one render."""
    return {q["name"]: q["peak"] / q["capacity"] for q in stats.get("queues", ()) if q.get("capacity")}


def mean_of(found):
    """Mean over seeds of equally named arrays or numbers, shorter arrays filled with zeros."""
    out = {}
    for name in dict.fromkeys(n for f in found for n in f):
        values = [np.atleast_1d(f[name]) for f in found if name in f]
        longest = max(map(len, values))
        out[name] = np.mean([np.pad(v, (0, longest - len(v))) for v in values], axis=0)
    return out


def recorded(experiment, scene):
    """{run: (alive, peaks)} of the runs that recorded either."""
    out = {}
    for run in experiment.runs:
        stats = experiment.stats(scene, run)
        try:
            pair = mean_of([alive(s) for s in stats]), mean_of([peaks(s) for s in stats])
        except (KeyError, TypeError) as e:
            raise experiments.InputError(f"{experiment.folder / 'stats' / scene}: {run}: lacks or misuses {e}: occupancy needs stages and queues") from None
        if any(pair):
            out[run] = pair
    return out


def queue_labels(runs):
    return [style.wrap(run, 30) for run in runs]


def shown_stages(of_depth):
    """Those with lines of their own, over two depths or more: hits of the rays beside them are left out."""
    return {name: share for name, share in of_depth.items() if np.count_nonzero(share) > 1 and not (name.endswith("shade") and name.replace("shade", "extend") in of_depth)}


def draw_queues(axes, found):
    """Peaks over capacities as shaded cells, a row per run and a column per queue."""
    queues = list(dict.fromkeys(q for _, of_run in found.values() for q in of_run))
    table = np.array([[float(of_run[q][0]) if q in of_run else np.nan for q in queues] for _, of_run in found.values()])
    axes.imshow(table, vmin=0, vmax=1, cmap="cividis", aspect="auto")
    for i, row in enumerate(table):
        for j, value in enumerate(row):
            if np.isfinite(value):
                axes.text(j, i, f"{100 * value:.0f}", ha="center", va="center", fontsize=6, color="white" if value < 0.5 else "black")
    axes.set_xticks(range(len(queues)), queues, rotation=90)
    axes.set_yticks(range(len(found)), queue_labels(found), fontsize=6)
    axes.set_title("peak of each queue, % of its capacity")


def draw(experiment, scene):
    """The figure of a scene: a panel of depths for each run, below them the queues."""
    found = recorded(experiment, scene)
    if not found:
        raise style.NotMade(f"{scene}: no items_by_depth and no queues in stats/{scene}/RUN_SEED.json")
    shown = [run for run, (of_depth, _) in found.items() if shown_stages(of_depth)]
    with_queues = {run: pair for run, pair in found.items() if pair[1]}
    across = style.balanced(len(shown), ACROSS) if shown else 1
    rows = -(-len(shown) // across)
    with plt.rc_context(style.STYLE):
        queues_height = style.row_height(queue_labels(with_queues), 0.1 + 0.1 * (max(n.count("\n") for n in queue_labels(with_queues)) + 1))[0] * len(with_queues) + 1.3 if with_queues else 0.0
        figure = plt.figure(figsize=(style.PAGE, 1.55 * rows + queues_height + 0.3), layout="constrained")
        parts = figure.subfigures(2, 1, height_ratios=(1.55 * rows + 0.3, queues_height)) if shown and with_queues else [figure, figure]
        if shown:
            grid = parts[0].subplots(rows, across, squeeze=False, sharey=True, sharex=True)
            for axes in grid.flat[len(shown):]:
                axes.set_axis_off()
            for i, (axes, run) in enumerate(zip(grid.flat, shown)):
                for stage, share in shown_stages(found[run][0]).items():
                    colour = stage_times.looks(stage)["color"]
                    depths = [d for d, value in enumerate(share) if value > 0]
                    axes.plot(depths, share[depths], color=colour, ls="--" if stage.startswith("light") else "-", marker="o", ms=2.5, lw=1, label=stage)
                axes.set_title(style.fit(run, style.PAGE / across - 0.5, 8.5))
                axes.set_ylim(bottom=0)
                axes.grid(True, color="0.92", lw=0.5)
                axes.xaxis.set_major_locator(MaxNLocator(integer=True))
                if i % across == 0:
                    axes.set_ylabel("alive")
                if i + across >= len(shown):
                    axes.set_xlabel("depth")
                    axes.tick_params(labelbottom=True)
            entries = {}
            for axes in grid.flat:
                entries |= dict(zip(*reversed(axes.get_legend_handles_labels())))
            parts[0].legend(entries.values(), entries.keys(), loc="outside lower center", ncols=4, frameon=False)
        if with_queues:
            draw_queues(parts[1].subplots(), with_queues)
    return figure


def make(experiment, scene):
    """Yields the scene's figure."""
    yield style.Picture(
        style.file_name("occupancy", scene), draw(experiment, scene), f"Occupancy on {scene}",
        "Above: rays of eye subpaths (extend) and light subpaths (light_extend) at each depth over the subpaths that were begun, mean over seeds: the share of a wave that is alive. Below: the greatest "
        "number of items that each queue held, over its capacity.", list(recorded(experiment, scene)), [scene])

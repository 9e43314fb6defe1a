"""Figures for a notebook: each function returns a matplotlib Figure.

    from ambilux.analysis import plots
    data = plots.load("out/convergence")
    plots.convergence(data, measure="relmse", width="column")
    plots.save(plots.ablation(data), "ablation")          # ablation.pdf with embedded fonts, ablation.png

width: "column" (3.4 inches) or "page" (7 inches). What the results do not support is a NotMade with the reason.
"""

from ambilux.analysis import ablation as _ablation
from ambilux.analysis import comparison as _comparison
from ambilux.analysis import convergence as _convergence
from ambilux.analysis import error_maps as _error_maps
from ambilux.analysis import flip_maps as _flip_maps
from ambilux.analysis import occupancy as _occupancy
from ambilux.analysis import overview as _overview
from ambilux.analysis import pyramid as _pyramid
from ambilux.analysis import stage_times as _stage_times
from ambilux.analysis.experiment import load
from ambilux.analysis.style import NotMade, save

__all__ = ["NotMade", "ablation", "comparison", "convergence", "errors", "flip", "load", "occupancy", "overview", "save", "stage_times", "strategies", "strategy_variance", "sweep"]


def _first(pictures):
    return next(iter(pictures)).figure


def convergence(data, x="seconds", measure="relmse", scenes=None, width="page"):
    """Error against time or samples. x: "seconds", "spp"; measure: "relmse", "rmse", "relmse_trimmed"."""
    return _convergence.draw(data, x, measure, scenes, width)


def ablation(data, width="page"):
    """Ratio of efficiencies of every run over the base run."""
    return _ablation.draw(data, width)


def sweep(data, name, key, width="column"):
    """Ratio of efficiencies over the values of a swept setting, such as sweep(data, "lvc", "connections")."""
    found = _ablation.sweeps(data)
    if (name, key) not in found:
        raise NotMade(f"no sweep of {name} over {key}; there are: {', '.join(f'{n} over {k}' for n, k in found) or 'none'}")
    entries, default = _ablation.with_default(data, name, key, found[name, key])
    return _ablation.draw_sweep(data, entries, key, default or 0, width)


def stage_times(data, width="page"):
    """Time of each stage per pixel and sample."""
    return _stage_times.draw(data, _stage_times.table(data), _stage_times.UNITS, width)


def occupancy(data, scene):
    """What is alive at each depth, and how full queues are."""
    return _occupancy.draw(data, scene)


def comparison(data, scene, insets=None):
    """Reference, insets and error maps. insets: [(x, y, size)] in pixels."""
    return _first(_comparison.make(data, scene, insets))


def errors(data, scene):
    """Error maps."""
    return _first(_error_maps.make(data, scene))


def flip(data, scene):
    """HDR-FLIP maps."""
    return _first(_flip_maps.make(data, scene))


def strategies(data, scene, run, kind="weighted"):
    """Images of single strategies (s,t). kind: "weighted" or "raw"."""
    for picture in _pyramid.make(data, scene, run):
        if picture.name.startswith(f"techniques_{kind}"):
            return picture.figure
    raise NotMade(f"{scene}, {run}: no {kind} images of strategies")


def strategy_variance(data, scene, run):
    """Variance of each strategy."""
    return _first(_pyramid.make_variance(data, scene, run))


def overview(data):
    """One page for a talk."""
    return _overview.draw(data)

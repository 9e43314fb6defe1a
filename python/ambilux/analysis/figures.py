"""Makes every figure that the results support, and says which ones they do not support, and why."""

import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field

from ambilux.analysis import ablation, captions, comparison, convergence, error_maps, flip_maps, occupancy, overview, pyramid, stage_times, style
from ambilux.analysis.experiment import InputError


@dataclass
class Made:
    """What came of an experiment. pictures: (name, title, caption); missing: (name, reason); broken: messages about bad input."""

    pictures: list = field(default_factory=list)
    missing: list = field(default_factory=list)
    broken: list = field(default_factory=list)


def plan(experiment, insets):
    """(name, function without arguments that yields Pictures) of all that there could be."""
    yield "overview", lambda: overview.make(experiment)
    yield "convergence", lambda: convergence.make(experiment)
    yield "ablation", lambda: ablation.make(experiment)
    yield "sweeps", lambda: ablation.make_sweeps(experiment)
    yield "stage_times", lambda: stage_times.make(experiment)
    for scene in experiment.scenes:
        yield f"comparison_{scene}", lambda scene=scene: comparison.make(experiment, scene, insets.get(scene))
        yield f"errors_{scene}", lambda scene=scene: error_maps.make(experiment, scene)
        yield f"occupancy_{scene}", lambda scene=scene: occupancy.make(experiment, scene)
        yield f"flip_{scene}", lambda scene=scene: flip_maps.make(experiment, scene)
    recorded = [(s, r) for s in experiment.scenes for r in experiment.runs if experiment.techniques(s, r)]
    if not recorded:
        def none():
            raise style.NotMade("no techniques/SCENE/RUN_SEED/techniques.json (techniques = 6 in a [[run]])")
        yield "techniques, strategy_variance", none
    for scene, run in recorded:
        yield f"techniques_{scene}_{run}", lambda scene=scene, run=run: pyramid.make(experiment, scene, run)
        yield f"strategy_variance_{scene}_{run}", lambda scene=scene, run=run: pyramid.make_variance(experiment, scene, run)


def make_one(name, make, experiment, out, write):
    made = Made()
    try:
        for picture in make():
            style.save(picture.figure, out / picture.name)
            write(out / f"{picture.name}.caption.txt", captions.text(experiment, picture))
            made.pictures.append((picture.name, picture.title, picture.caption))
    except style.NotMade as e:
        made.missing.append((name, str(e)))
    except InputError as e:
        made.broken.append((name, str(e)))
    except OSError:
        raise
    except Exception as e:  # one scene's failure takes no other down
        made.broken.append((name, told(e)))
    return made


def told(error):
    return str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"


def apart(made, name, make, otherwise=None):
    """make(), or `otherwise` and a message in made.broken."""
    try:
        return make()
    except OSError:
        raise
    except Exception as e:
        made.broken.append(f"{name}: {told(e)}")
        return otherwise


def in_processes(work, count, lost=None):
    """[work(0), work(1), ...], on all processors. Processes are forks of this one: they know what it has read and computed, and `work` may be anything
    that does not start threads of OpenMP, which do not outlive a fork. lost(i) stands for work that ends its process."""
    global forked
    processes = min(count, len(os.sched_getaffinity(0)))
    if processes < 2:
        return [work(i) for i in range(count)]
    forked = work
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(processes, context) as pool:
        futures = [pool.submit(do_forked, i) for i in range(count)]
    # A process that dies takes the others' work along: it is done again, each in a process of its own.
    return [alone(i, context, lost) if isinstance(f.exception(), BrokenProcessPool) else f.result() for i, f in enumerate(futures)]


def alone(i, context, lost):
    with ProcessPoolExecutor(1, context) as pool:
        future = pool.submit(do_forked, i)
    return lost(i) if lost and isinstance(future.exception(), BrokenProcessPool) else future.result()


def do_forked(i):
    return forked(i)


def make_all(experiment, out, write, insets):
    """Writes NAME.pdf, NAME.png and NAME.caption.txt of every figure into the folder `out`; `write` puts text into a file. Bad input of one figure
    does not keep the others from being made."""
    figures = list(plan(experiment, insets))
    made = Made()
    for one in in_processes(lambda i: make_one(*figures[i], experiment, out, write), len(figures), lambda i: Made(broken=[(figures[i][0], "its process ended")])):
        made.pictures += one.pictures
        made.missing += one.missing
        for name, message in one.broken:
            made.broken.append(f"{name}: {message}" if message not in "".join(made.broken) else f"{name}: the same")
    return made

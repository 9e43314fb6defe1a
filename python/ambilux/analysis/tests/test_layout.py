"""Figures with few and many methods, long names, one and many scenes: nothing overlaps, one scale for all, the same colours in every figure."""

import itertools
import json

import numpy as np
import pytest

from ambilux.analysis import ablation, comparison, convergence, error_maps, experiment, flip_maps, occupancy, overview, plots, stage_times, style
from ambilux.analysis.tests import synthetic

NAMES = ("path", "bdpt", "lvc[connections=1]", "lvc[connections=3]", "lvc[connections=8]", "bdpt.auto", "bdpt[strategies=hits+next_event+connections]", "streaming", "megakernel",
         "path[estimator=nee,rr_depth=12]", "lvc[connections=16,light_paths=0.25]", "a_long_name_of_a_method_without_breaks", "light", "toy")


def load(folder, count, scenes=("box",), **more):
    runs = [(name, 2.0 * 0.88**i, 1 + 0.1 * i) for i, name in enumerate(NAMES[:count])]
    return experiment.load(synthetic.make(folder, scenes=scenes, runs=runs, batches=16, **more))


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    return load(tmp_path_factory.mktemp("many") / "r", 14)


@pytest.fixture(scope="module")
def six(tmp_path_factory):
    return load(tmp_path_factory.mktemp("six") / "r", 6, scenes=("veach-ajar[size=640x360]",))


def texts_of(figure, of_axes):
    figure.draw_without_rendering()
    return [box for axes in figure.axes if axes.get_visible() for t in of_axes(axes) if t.get_text().strip() for box in [t.get_window_extent()] if box.width > 1]


def overlap(boxes):
    return [(a, b) for a, b in itertools.combinations(boxes, 2) if a.x0 < b.x1 - 1 and b.x0 < a.x1 - 1 and a.y0 < b.y1 - 1 and b.y0 < a.y1 - 1]


def headings(axes):
    return [axes.title, axes.xaxis.label]


@pytest.mark.parametrize("which", ["six", "many"])
def test_headings_and_footers_do_not_collide(which, request):
    data = request.getfixturevalue(which)
    scene = data.scenes[0]
    reference, shown = comparison.load(data, scene)
    for figure in (comparison.draw(data, scene, reference, shown, [(0, 0, 9), (20, 10, 9)]), next(error_maps.make(data, scene)).figure, overview.draw(data)):
        assert not overlap(texts_of(figure, headings))
        assert figure.get_figwidth() <= 10 and figure.get_figheight() <= 9
        style.plt.close(figure)


def test_six_runs_stand_in_one_figure_at_one_scale(six):
    (picture,) = error_maps.make(six, six.scenes[0])
    limits = {a.images[0].get_clim() for a in picture.figure.axes if a.images}
    assert len(limits) == 2  # of errors and of signed errors
    assert picture.name == "errors_veach-ajar-size-640x360"  # no brackets in names of files
    assert [style.balanced(n, 5) for n in (2, 5, 6, 7, 11, 14)] == [2, 5, 3, 4, 4, 5]
    (picture,) = comparison.make(six, six.scenes[0])
    assert len([a for a in picture.figure.axes if a.images and a.images[0].get_cmap().name == style.ERROR_COLOURS]) == 6


def test_fourteen_runs_are_told_apart(many):
    figure = convergence.draw(many, "seconds", "relmse")
    panels = [axes for axes in figure.axes if axes.lines]
    assert len(panels) == 2
    for axes in panels:
        told = [(line.get_color(), line.get_marker()) for line in axes.lines if not line.get_label().startswith(("_", "slope"))]
        assert len(told) == 7 == len(set(told))
        assert sum(line.get_color() == "0.8" for line in axes.lines) == 7  # the others, as background
    assert panels[0].get_ylim() == panels[1].get_ylim()


def test_many_scenes_take_several_figures(tmp_path):
    data = load(tmp_path / "r", 8, scenes=tuple(f"s{i}" for i in range(8)), seeds=(1,), checkpoints=(1, 16))
    assert [len(part) for part in convergence.parts_of(data)] == [4, 4]


def test_a_stage_has_one_colour_in_every_figure():
    assert len({tuple(v) for v in stage_times.LOOKS.values()}) == len(stage_times.LOOKS)
    assert stage_times.looks("connect")["color"] == stage_times.looks("connect_vertices")["color"]
    assert stage_times.looks("a_new_one") == stage_times.looks("a_new_one")


def test_names_are_not_joined_by_lines_and_the_default_is_there(tmp_path):
    runs = (("bdpt", 1.0, 1.0), ("bdpt[ordering=morton]", 0.9, 1.2), ("bdpt[ordering=material]", 0.8, 1.1))
    data = experiment.load(synthetic.make(tmp_path / "r", scenes=("box",), runs=runs, batches=16))
    entries, default = ablation.with_default(data, "bdpt", "ordering", ablation.sweeps(data)["bdpt", "ordering"])
    assert [run for _, run in entries][default] == "bdpt"
    figure = ablation.draw_sweep(data, entries, "ordering", default)
    (points,) = (line for line in figure.axes[0].lines if line.get_label() == "box")
    assert points.get_linestyle() == "None" and len(points.get_xdata()) == 3
    assert any("(default)" in label.get_text() for label in figure.axes[0].get_xticklabels())
    numbers = experiment.load(synthetic.make(tmp_path / "n", scenes=("box",), runs=tuple((f"lvc[connections={n}]", 1.0 / n, 1.0) for n in (1, 2, 4)), batches=16))
    figure = plots.sweep(numbers, "lvc", "connections")
    (line,) = (line for line in figure.axes[0].lines if line.get_label() == "box")
    assert line.get_linestyle() == "-" and line.get_ydata()[0] == pytest.approx(1)
    with pytest.raises(plots.NotMade, match="no sweep of lvc over draws; there are: lvc over connections"):
        plots.sweep(numbers, "lvc", "draws")


def test_notebooks_get_figures_of_either_width(six, tmp_path):
    scene = six.scenes[0]
    for width, inches in (("column", style.COLUMN), ("page", style.COLUMN)):  # one scene: one panel
        for make in plots.convergence, plots.ablation, plots.stage_times:
            assert make(six, width=width).get_figwidth() == pytest.approx(inches)
    figures = [plots.comparison(six, scene, [(0, 0, 8)]), plots.errors(six, scene), plots.overview(six)]
    if flip_maps.flip_evaluator is not None:
        figures.append(plots.flip(six, scene))
    for figure in figures:
        plots.save(figure, tmp_path / "x")
        assert (tmp_path / "x.pdf").read_bytes().startswith(b"%PDF")
    # Text stays text: TrueType fonts are embedded (type 42), and no bitmap fonts (type 3).
    content = (tmp_path / "x.pdf").read_bytes()
    assert b"/FontFile2" in content and b"/Type3" not in content
    with pytest.raises(plots.NotMade):
        plots.strategies(six, scene, "bdpt")


def test_wrapping_leaves_no_part_longer_than_a_line():
    for name in NAMES:
        assert max(map(len, style.wrap(name, 12).split("\n"))) <= 12
        assert style.wrap(name, 12).replace("\n", "") == name
    assert np.allclose([len(style.fit("lvc[connections=1]", 0.5).split("\n"))], [4])


def test_occupancy_by_depth_and_queue(six):
    scene = six.scenes[0]
    with pytest.raises(style.NotMade, match="no items_by_depth"):
        occupancy.draw(six, scene)
    stats = {"stages": [{"name": "generate", "items": 10, "items_by_depth": [10]}, {"name": "extend", "items": 15, "items_by_depth": [0, 10, 5]}],
             "queues": [{"name": "rays", "capacity": 8, "peak": 6}]}
    assert list(occupancy.alive(stats)["extend"]) == [0, 1, 0.5] and occupancy.peaks(stats) == {"rays": 0.75}
    assert list(occupancy.mean_of([{"a": np.array([1.0, 1.0])}, {"a": np.array([1.0])}])["a"]) == [1, 0.5]
    for path in (six.folder / "stats" / scene).iterdir():
        path.write_text(json.dumps(json.loads(path.read_text()) | stats))
    figure = occupancy.draw(six, scene)
    figure.draw_without_rendering()
    assert len([a for a in figure.axes if a.lines]) == 6 and not overlap(texts_of(figure, headings))


def test_stages_without_a_clock_are_named(tmp_path):
    data = load(tmp_path / "r", 2)
    path = data.folder / "stats" / "box" / "path_1.json"
    stats = json.loads(path.read_text())
    stats["stages"].append({"name": "occlude", "items": 7, "launches": 1, "seconds": 0.0})
    path.write_text(json.dumps(stats))
    (picture,) = stage_times.make(data)
    assert "No clock of their own have occlude" in picture.caption

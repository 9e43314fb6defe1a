"""Which files are made of which data, and what is drawn."""

import csv
import json
import os
import re
import shutil
import subprocess

import numpy as np
import pytest

from ambilux.analysis import __main__ as program
from ambilux.analysis import ablation, captions, comparison, convergence, error_maps, experiment, figures, flip_maps, images, pyramid, remarks, stage_times, style, summary
from ambilux.analysis.tests import synthetic

RUNS = (("nee", 0.7, 1.5), ("lvc[connections=1]", 0.5, 2.0), ("lvc[connections=4]", 0.4, 3.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = synthetic.make(tmp_path_factory.mktemp("results") / "run", scenes=("box",), runs=RUNS)
    synthetic.add_techniques(folder, "box", "lvc[connections=1]", (1, 2, 3))
    return folder


@pytest.fixture(scope="module")
def output(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    assert program.main([str(folder), "-o", str(out)]) == 0
    return out


NAMES = {"overview", "convergence_time", "convergence_spp", "convergence_time_relmse", "convergence_spp_relmse", "ablation", "sweep_lvc_connections", "stage_times",
         "comparison_box", "errors_box", "flip_box", "techniques_weighted_box_lvc-connections-1", "techniques_raw_box_lvc-connections-1",
         "strategy_variance_box_lvc-connections-1"}


def test_all_files_are_written(output):
    if flip_maps.flip_evaluator is None:
        pytest.skip("flip-evaluator is not installed")
    expected = {f"{n}.{suffix}" for n in NAMES for suffix in ("pdf", "png", "caption.txt")}
    assert {p.name for p in output.iterdir()} == expected | {"table.csv", "table.tex", "errors.tex", "table_column.tex", "tests.tex", "strategy_variance.csv", "report.html"}


@pytest.mark.filterwarnings("error::UserWarning")  # what matplotlib says of a layout that has no room
def test_any_number_of_runs_leaves_room(tmp_path):
    """Legends of twenty long names lie below the panels, which keep their size; long values of a sweep do not run into each other."""
    values = ["hits+next_event", "hits+next_event+connections", "hits+next_event+light", *(f"hits+next_event+connections+light+{i}" for i in range(16))]
    few, many = (experiment.load(synthetic.make(tmp_path / str(n), scenes=("box",), runs=(("nee", 0.7, 1.5), *((f"bdpt[strategies={v}]", 0.5, 2.0) for v in values[:n]))))
                 for n in (3, 19))
    heights = []
    for data in few, many:
        figure = convergence.draw(data, "seconds", "rmse")
        figure.draw_without_rendering()
        legends = figure.legends or [axes.get_legend() for axes in figure.axes if axes.get_legend()]
        for axes, legend in zip(figure.axes, legends):
            box = legend.get_window_extent()
            assert box.y1 <= axes.xaxis.label.get_window_extent().y0 + 1 and box.y0 >= -1 and box.x0 >= 0 and box.x1 <= figure.bbox.width
        assert sum(len(legend.get_texts()) for legend in legends) == len(data.runs) + len(legends)  # and the slope
        heights.append(figure.axes[0].get_window_extent().height)
    assert heights[1] == pytest.approx(heights[0], rel=0.15)

    figure = ablation.draw_sweep(few, [(v, f"bdpt[strategies={v}]") for v in values[:3]], "strategies")
    for names in None, values[:6], [str(16777216 + i) for i in range(7)], ["atomic", "none"]:
        if names:
            style.name_ticks(figure.axes[0], range(len(names)), names)
        figure.draw_without_rendering()
        labels = figure.axes[0].get_xticklabels()
        boxes = [label.get_window_extent() for label in labels]
        assert len(boxes) == len(names or values[:3]) and all(a.x1 < b.x0 for a, b in zip(boxes, boxes[1:]))
        assert [label.get_text().replace("\n", "") for label in labels] == (names or values[:3])


def test_errors_of_zero_leave_empty_figures(tmp_path):
    """What the runner writes where the reference is noisier than the runs."""
    folder = synthetic.make(tmp_path / "run", scenes=("box",), runs=RUNS)
    head, *rows = (folder / "runs.csv").read_text().splitlines()
    columns = [i for i, name in enumerate(head.split(",")) if name in ("rmse_corrected", "relmse_corrected")]
    broken = [[*csv.reader([row])][0] for row in rows]
    for row in broken:
        for i in columns:
            row[i] = "0"
    with open(folder / "runs.csv", "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([head.split(","), *broken])
    data = experiment.load(folder)
    for x in "seconds", "spp":
        assert convergence.draw(data, x, "rmse").legends == []


def test_captions_state_the_data(output):
    for name in NAMES:
        text = (output / f"{name}.caption.txt").read_text()
        for part in ("box (48x36, max_depth 5, ", "standard error 0.002", "Seeds: 1–3; samples per pixel 1–64", "a processor <&>", "git 0123456",
                     "Command: ambilux experiment experiments/synthetic.toml -o run", "python -m ambilux.analysis run"):
            assert part in text, (name, part)
    assert captions.listed([1, 2, 3, 7, 9, 10]) == "1–3, 7, 9, 10"


def test_same_input_gives_same_bytes(folder, output, tmp_path):
    """Of one figure with lines, one with bars and one with images; the page of all."""
    data = experiment.load(folder)
    for picture in (next(ablation.make(data)), next(comparison.make(data, "box")), next(pyramid.make_variance(data, "box", "lvc[connections=1]"))):
        style.save(picture.figure, tmp_path / picture.name)
        for suffix in ("pdf", "png"):
            assert (tmp_path / f"{picture.name}.{suffix}").read_bytes() == (output / f"{picture.name}.{suffix}").read_bytes(), picture.name


def test_little_data_makes_what_it_supports_and_says_the_rest(tmp_path, capsys):
    folder = synthetic.make(tmp_path / "tiny", scenes=("only",), runs=(("a", 1.0, 1.0),), seeds=(7,), checkpoints=(8,))
    for gone in ("images", "references", "stats"):
        (folder / gone).rename(folder / f"no_{gone}")
    assert program.main([str(folder), "-o", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().err
    for name, reason in (("ablation", "needs two runs"), ("sweeps", "no runs of a sweep"), ("stage_times", "no stages"), ("comparison_only", "reference image is not there"),
                         ("flip_only", "reference image is not there"), ("techniques", "no techniques/SCENE")):
        assert re.search(f"not made: {name}.*: .*{reason}", said), name
    page = (tmp_path / "out" / "report.html").read_text()
    assert "No images yet" in page and "an ablation needs two runs" in page


@pytest.mark.parametrize("file,content,message", [
    ("images/box/nee_1.exr", b"not an image", r"nee_1.exr: cannot be read as OpenEXR, it may be half-written"),
    ("stats/box/nee_2.json", b'{"size": [48, 36], "spp": 64', r"nee_2.json:1: column 29: .*half-written"),
    ("stats/box/nee_2.json", b'{"size": [48, 36], "spp": 64}', r"nee_2.json: lacks or misuses 'stages'"),
])
def test_a_broken_file_stops_only_what_needs_it(folder, tmp_path, file, content, message, capsys, monkeypatch):
    import shutil
    bad = shutil.copytree(folder, tmp_path / "bad")
    shutil.rmtree(bad / "techniques")
    (bad / file).write_bytes(content)
    monkeypatch.setattr(style, "save", lambda *_: None)  # what is drawn is of no interest here
    monkeypatch.setattr("ambilux.analysis.report.figure", lambda *_: "")
    assert program.main([str(bad), "-o", str(tmp_path / "out")]) == 3
    captured = capsys.readouterr()
    assert re.search(f"error: .*{message}", captured.err)
    assert "Traceback" not in captured.err
    assert not re.search(r"error: (convergence|ablation)", captured.err)
    style.plt.close("all")


def test_images_of_another_size_are_refused(folder, tmp_path):
    reference = images.read_exr(experiment.load(folder).reference("box"))
    synthetic.write_exr(tmp_path / "small.exr", reference[:10])
    with pytest.raises(experiment.InputError, match="small.exr: is 48x10, its reference 48x36"):
        images.read_like(tmp_path / "small.exr", reference)


def test_insets_lie_where_methods_differ_and_do_not_overlap():
    reference = np.ones((60, 90, 3), dtype=np.float32)
    one, two = reference.copy(), reference.copy()
    one[5:15, 60:70] = 3  # only the first is wrong here
    two[40:50, 10:20] = 2
    insets = comparison.choose_insets(reference, [one, two])
    (ax, ay, size), (bx, by, _) = insets
    assert size == 15 and abs(ax - 60) < size and abs(ay - 5) < size and abs(bx - 10) < size and abs(by - 40) < size


def test_insets_by_hand():
    assert program.parse_inset("a=b=1,2,3") == ("a=b", (1, 2, 3))
    for bad in ("box", "box=1,2", "box=1,2,x", "=1,2,3", "box=-1,2,3"):
        with pytest.raises(Exception, match="SCENE=X,Y,SIZE"):
            program.parse_inset(bad)


def test_stage_times_are_per_pixel_and_sample(folder, tmp_path):
    data = experiment.load(folder)
    times = stage_times.mean_over_seeds(data, "box", "nee")
    assert times["extend"] == pytest.approx(1e6 * 1.5 * 0.5 / (48 * 36))  # 1.5 ms per sample of 48 x 36 pixels, in ns
    stats = synthetic.stats(1.5, 64)
    assert stage_times.per_sample(stats | {"stages_since_spp": 32})["extend"] == pytest.approx(2 * times["extend"])
    assert stage_times.per_sample(stats | {"stages_since_spp": 64}) == {}


def test_ablation_labels_and_ticks():
    assert ablation.label("lvc[connections=4]", "lvc") == "connections = 4"
    assert ablation.label("lvc[connections=4]", "path") == "lvc[connections=4]"
    for low, high in ((0.9, 1.2), (0.5, 4), (0.01, 300), (0.8, 30)):
        ticks = ablation.ratio_ticks(low, high)
        assert 1 in ticks and 2 <= len(ticks) <= 9 and min(ticks) >= low and max(ticks) <= high


def test_sweeps_are_found(folder):
    found = ablation.sweeps(experiment.load(folder))
    assert found == {("lvc", "connections"): [("1", "lvc[connections=1]"), ("4", "lvc[connections=4]")]}


def test_pyramid_has_rows_by_length_and_columns_by_light_vertices(folder):
    data = experiment.load(folder)
    weighted, raw = pyramid.make(data, "box", "lvc[connections=1]")
    # Lengths 1 to 3, s = 0 to 3; titled axes are those with an image.
    titles = [[a.get_title().partition(" ")[0] for a in p.figure.axes] for p in (weighted, raw)]
    assert len(titles[0]) == 12
    assert titles[0] == ["(0,2)", "(1,1)", "", "", "(0,3)", "(1,2)", "(2,1)", "", "(0,4)", "", "(2,2)", "(3,1)"]
    assert titles[1][0] == "" and titles[1][1:] == titles[0][1:]
    style.plt.close("all")


def test_exposure_of_raw_rows_undoes_their_scale():
    rows = {pyramid.Strategy(0, 2): synthetic.picture(), pyramid.Strategy(0, 3): synthetic.picture() / 8}
    figure, factors = pyramid.draw(rows, "raw")
    assert factors[2] / factors[1] == pytest.approx(8)
    _, stops = pyramid.draw(rows, "weighted")
    assert stops[2] / stops[1] == pytest.approx(2)
    style.plt.close("all")


def test_variance_of_strategies_is_that_of_their_noise(folder):
    rows = {strategy: e for strategy, e, _, n, _ in pyramid.variances(experiment.load(folder), "box", "lvc[connections=1]") if n == 3}
    assert len(rows) == 8
    for strategy, e in rows.items():
        assert e.value == pytest.approx((0.2 * (strategy.s + 1)) ** 2, rel=4 * np.sqrt(2 / (2 * 48 * 36 * 3)))


@pytest.mark.parametrize("change,message", [
    (lambda d: d.pop("entries"), "techniques.json: lacks 'entries'"),
    (lambda d: d["entries"][1].pop("s"), r"entries\[1\]: lacks the numbers 's' and 't'"),
    (lambda d: d["entries"][0].update(weighted="gone.exr"), r"entries\[0\]: there is no gone.exr"),
    (lambda d: d["entries"].clear(), "'entries' is empty"),
])
def test_bad_techniques_are_refused(tmp_path, change, message):
    synthetic.add_techniques(tmp_path, "box", "lvc", (1,), max_depth=1)
    place = tmp_path / "techniques" / "box" / "lvc_1"
    data = json.loads((place / "techniques.json").read_text())
    change(data)
    (place / "techniques.json").write_text(json.dumps(data))
    with pytest.raises(experiment.InputError, match=message):
        pyramid.read(place)


def test_a_lamp_in_view_does_not_set_the_exposure_of_weighted_rows():
    """Row 1 holds most of the light, in one pixel of a hundred."""
    lamp, lit = np.zeros((10, 10, 3)), np.full((10, 10, 3), 0.25)
    lamp[0, 0] = 1000
    assert pyramid.weighted_factors({1: {1: lamp}, 2: {1: lit}, 3: {1: lit / 4}}) == pytest.approx({1: 3.2, 2: 3.2, 3: 6.4})


def test_weighted_strategies_tell_their_share_of_the_light():
    picture = synthetic.picture()
    shares = {(0, 2): 3, (1, 1): 1, (0, 3): 0, (1, 2): 1e-4, (2, 1): 0.2}
    figure, _ = pyramid.draw({pyramid.Strategy(*st): share * picture for st, share in shares.items()}, "weighted")
    titles = [a.get_title() for a in figure.axes if a.get_title()]
    assert titles == ["(0,2) 71 %", "(1,1) 24 %", "(0,3) 0", "(1,2) <0.1 %", "(2,1) 4.8 %"]
    figure, _ = pyramid.draw({pyramid.Strategy(0, 2): picture, pyramid.Strategy(1, 1): picture}, "raw")
    assert [a.get_title() for a in figure.axes] == ["(0,2)", "(1,1)"]


def test_merges_stand_to_the_right_in_the_row_of_their_length(tmp_path):
    synthetic.add_techniques(tmp_path, "box", "vcm", (1,), max_depth=2)
    place = tmp_path / "techniques" / "box" / "vcm_1"
    data = json.loads((place / "techniques.json").read_text())
    data["entries"].append({**data["entries"][-1], "s": 2, "t": 2, "merge": True})
    (place / "techniques.json").write_text(json.dumps(data))
    entries = pyramid.read(place).entries
    figure, _ = pyramid.draw({strategy: synthetic.picture() for strategy in entries}, "raw")
    assert [a.get_title() for a in figure.axes] == ["(0,2)", "(1,1)", "", "", "(0,3)", "(1,2)", "(2,1)", "(2,2) merged"]
    style.plt.close("all")


def test_flip_is_zero_for_equal_images_and_grows_with_the_error():
    if flip_maps.flip_evaluator is None:
        pytest.skip("flip-evaluator is not installed")
    picture = synthetic.picture().astype(np.float32)
    same, zero = flip_maps.flip(picture, picture)
    assert same.shape == (36, 48) and zero == pytest.approx(0, abs=1e-6)
    broken = picture.copy()
    broken[3, 4] = np.nan
    means = [flip_maps.flip(picture + d, picture)[1] for d in (0.02, 0.1, 0.4)]
    assert 0 < means[0] < means[1] < means[2] < 1
    assert np.isfinite(flip_maps.flip(broken, picture)[1])


def test_blocks_and_scales_of_maps():
    values = np.arange(20, dtype=float).reshape(4, 5)
    means = images.block_means(values, 2)
    assert means.shape == (2, 3) and means[0, 0] == pytest.approx(3) and means[1, 2] == pytest.approx(16.5)
    assert error_maps.images_blocks(np.dstack([values] * 3)).shape == (1, 2, 3)
    assert images.signed_error(np.full((1, 1, 3), 0.5), np.full((1, 1, 3), 0.99)) == pytest.approx(-0.49)
    assert images.highest_of([np.array([np.nan, np.inf])]) == 1.0


def test_long_names_are_wrapped_at_their_settings():
    assert style.wrap("lvc[connections=4]", 16) == "lvc\n[connections=4]"
    assert style.wrap("short", 16) == "short"
    assert style.wrap("strategies = hits+next_event+connections", 24) == "strategies = hits+\nnext_event+connections"


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not installed")
def test_tables_are_latex(output, tmp_path):
    document = tmp_path / "tables.tex"
    inputs = "\n".join(rf"\input{{{output / name}}}" for name in ("table.tex", "errors.tex", "table_column.tex", "tests.tex"))
    document.write_text(r"\documentclass{article}\usepackage{booktabs}\begin{document}" + "\n" + inputs + "\n" + r"\end{document}")
    made = subprocess.run(["pdflatex", "-interaction=nonstopmode", "-halt-on-error", document.name], cwd=tmp_path, capture_output=True, text=True)
    assert made.returncode == 0, made.stdout[-2000:]


def test_a_black_reference_takes_nothing_of_other_scenes_along(tmp_path):
    results = synthetic.make(tmp_path / "run", scenes=("box", "black"), runs=RUNS[:2])
    for path in (results / "references").glob("black*.exr"):
        synthetic.write_exr(path, np.zeros_like(synthetic.picture()))
    said, made = program.analyse(results, tmp_path / "out")
    assert not made.broken and any("black: its reference is black" in s for s in said)
    assert {"comparison_box", "errors_box", "comparison_black", "errors_black"} <= {name for name, *_ in made.pictures}
    assert "its reference is black" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    if flip_maps.flip_evaluator is not None:
        assert ("flip_black", "the reference is black") in made.missing and "flip_box" in {name for name, *_ in made.pictures}


def test_what_fails_is_named_and_all_others_are_made(folder, tmp_path, monkeypatch):
    def fails():
        raise ZeroDivisionError("no pixels")

    def planned(experiment, insets):
        yield "ends", lambda: os._exit(1)
        yield "fails", fails
        yield "errors_box", lambda: error_maps.make(experiment, "box")

    monkeypatch.setattr(figures, "plan", planned)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    monkeypatch.setattr(remarks, "remarks", lambda *_: fails())
    line = summary.line
    monkeypatch.setattr(summary, "line", lambda e, scene, run, checkpoint: fails() if run == "nee" else line(e, scene, run, checkpoint))
    _, made = program.analyse(folder, tmp_path)
    assert [name for name, *_ in made.pictures] == ["errors_box"]
    assert made.broken == ["box, nee: ZeroDivisionError: no pixels", "remarks: ZeroDivisionError: no pixels", "ends: its process ended",
                           "fails: ZeroDivisionError: no pixels"]
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert all(message in report for message in made.broken)

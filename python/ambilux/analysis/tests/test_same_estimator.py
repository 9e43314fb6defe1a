"""Switches that keep the estimator are found by their errors and compared by their time."""

import csv
import json

import pytest

from ambilux.analysis import experiment, images, remarks, same_estimator, summary, tables
from ambilux.analysis.tests import synthetic

RUNS = (("base", 1.0, 1.0), ("base[ordering=morton]", 1.0, 1.3), ("base[tail=false]", 1.0, 1.0), ("other", 1.01, 1.0))


def load(folder):
    """Times of seeds scatter by some per cent, alike for all runs: a busy machine."""
    folder = synthetic.make(folder, scenes=("box",), runs=RUNS, spread=0.0, reference_noise=0.0)
    head, *rows = csv.reader((folder / "runs.csv").read_text().splitlines())
    time = head.index("time")
    for row in rows:
        busy = {"1": 1.0, "2": 1.6, "3": 1.1}[row[2]] * (1.001 if row[1] == RUNS[2][0] and row[2] == "2" else 1)
        row[time] = f"{float(row[time]) * busy:.9g}"
    with open(folder / "runs.csv", "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([head, *rows])
    return experiment.load(folder)


def test_equal_errors_at_equal_seeds_are_one_estimator(tmp_path):
    data = load(tmp_path / "r")
    assert same_estimator.same(data, "box", RUNS[1][0], "base") is True and same_estimator.same(data, "box", "other", "base") is False
    assert same_estimator.same(data, "box", "other", "nowhere") is None
    lines = {line.run: line for line in summary.lines(data)}
    # The machine was busy by 1.6 with one seed; pairs do not see it.
    slow = lines[RUNS[1][0]].ratio
    assert slow.over == "pairs of seeds" and slow.value == pytest.approx(1 / 1.3) and slow.low == pytest.approx(1 / 1.3, rel=1e-6)
    none = lines[RUNS[2][0]].ratio
    assert none.low < 1 < none.high and none.high - none.low < 0.01
    assert lines["other"].ratio_time is None
    said = list(remarks.same_remarks(list(lines.values())))
    assert len(said) == 2 and "a sample takes 1.3 times as long [1.3, 1.3]" in said[0] and "no effect on the time per sample found (ratio 1 [" in said[1]
    assert "0.769 [0.769, 0.769] =" in tables.to_html(data, list(lines.values()))


def test_single_paths_that_rounding_sent_another_way_do_not_make_another_estimator(tmp_path):
    """Errors differ by 0.1 %; the images decide: few pixels differ, or all."""
    data = load(tmp_path / "r")
    row = next(r for r in data.rows if r.run == RUNS[2][0])
    object.__setattr__(row, "mape", row.mape * 1.001)
    assert same_estimator.same(data, "box", RUNS[2][0], "base") is False  # noise of their own
    for seed in (1, 2, 3):
        image = images.read_exr(data.folder / "images" / "box" / f"base_{seed}.exr")
        image[3, 4] *= 1.2
        synthetic.write_exr(data.folder / "images" / "box" / f"{RUNS[2][0]}_{seed}.exr", image)
    assert same_estimator.same(data, "box", RUNS[2][0], "base") is True
    ratio = summary.ratio_over(data, "box", RUNS[2][0], "base")  # what sweeps show is what the table shows
    assert ratio.over == same_estimator.OVER == summary.ratio_over(data, "box", RUNS[1][0], "base").over


def test_a_switch_that_sets_what_is_there_anyway_shows_the_machine(tmp_path):
    data = load(tmp_path / "r")
    for seed in (1, 2, 3):
        path = data.folder / "stats" / "box" / f"base_{seed}.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | {"ordering": "none", "tail": False}))
    said = list(remarks.same_remarks(summary.lines(data), data))
    assert [text.endswith("the difference shows the accuracy of the times") for text in said] == [False, True]  # ordering=morton, tail=false

"""Experiments with checkpoints in samples and in seconds, trimmed errors, clocks and how references were made."""

import csv
import json
import re

import numpy as np
import pytest

from ambilux.analysis import __main__ as program
from ambilux.analysis import captions, experiment, remarks, report, summary, tables
from ambilux.analysis.tests import synthetic

RUNS = (("slow", 2.0, 50.0), ("fast", 1.0, 1.0))
SECONDS = (0.1, 0.4, 1.6)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Checkpoints 0 to 3 in samples, 4 to 6 in seconds. `slow` passes 0.1 s with 2 samples, 1.6 s with 32; `fast` with 100 and 1600."""
    return synthetic.make(tmp_path_factory.mktemp("results") / "run", scenes=("box",), runs=RUNS, seconds=SECONDS, spread=0.0, reference_noise=0.0)


@pytest.fixture(scope="module")
def data(folder):
    return experiment.load(folder)


def test_time_axes_use_checkpoints_in_seconds_and_others_those_in_samples(data):
    for run in ("slow", "fast"):
        time, spp = (summary.curve(data, "box", run, x=x) for x in ("seconds", "spp"))
        assert list(time.seconds) == pytest.approx(SECONDS)
        assert list(spp.spp) == pytest.approx([1, 4, 16, 64])
        assert (np.diff(time.seconds) > 0).all() and (np.diff(spp.spp) > 0).all()
        assert (np.diff(time.error) < 0).all() and (np.diff(spp.error) < 0).all()


def test_table_and_speed_up_compare_at_equal_time(data):
    lines = {line.run: line for line in summary.lines(data)}
    assert data.last_common_checkpoint("box") == 6
    assert (lines["slow"].spp, lines["fast"].spp) == (pytest.approx(32), pytest.approx(1600))
    assert lines["slow"].seconds == pytest.approx(1.6) == lines["fast"].seconds
    # A quarter of the samples, each 50 times faster; the target is the error of `slow` at 1.6 s, not the smaller one at 64 samples.
    assert lines["fast"].speedup.target == pytest.approx(2 / np.sqrt(32))
    # `fast` was below it at its first checkpoint already, by more than a factor of 4 in time: a bound, and no number.
    assert (lines["fast"].speedup.sign, lines["fast"].speedup.value) == (">", pytest.approx(1.6 / SECONDS[0]))
    assert lines["fast"].ratio_seeds.value == pytest.approx(4 * 50)
    assert lines["fast"].slope.value == pytest.approx(-0.5) and lines["fast"].slope_time.value == pytest.approx(-0.5)


def test_slopes_say_which_checkpoints_they_use(data):
    assert summary.resolved(data, "box", "fast", "spp") == [0, 1, 2, 3] and summary.resolved(data, "box", "fast", "seconds") == [4, 5, 6]
    assert "bias use the checkpoints in seconds" in summary.rows_used(data) and "slopes against samples those in samples" in summary.rows_used(data)


def test_one_kind_of_checkpoints_serves_for_both(tmp_path):
    """Results of a runner without the column, and of budgets of one kind."""
    data = experiment.load(synthetic.make(tmp_path / "r", scenes=("box",)))
    assert [len(summary.curve(data, "box", "mis", x=x).error) for x in ("seconds", "spp")] == [4, 4]
    assert "of one kind" in summary.rows_used(data) and summary.recorded(data) == ["relmse", "rmse"]
    folder = tmp_path / "r"
    rows = (folder / "runs.csv").read_text().splitlines()
    (folder / "runs.csv").write_text("\n".join([rows[0] + ",budget", *(r + ",seconds" for r in rows[1:])]) + "\n")
    data = experiment.load(folder)
    assert data.budget("spp") is None and len(summary.curve(data, "box", "mis", x="spp").error) == 4
    assert "in seconds" in summary.rows_used(data)
    (folder / "runs.csv").write_text("\n".join([rows[0] + ",budget", rows[1] + ",hours"]) + "\n")
    with pytest.raises(experiment.InputError, match="runs.csv:2: column 'budget' holds 'hours'"):
        experiment.load(folder)


def test_trimmed_error_has_figures_columns_and_a_remark(folder, data, tmp_path, capsys):
    assert program.main([str(folder), "-o", str(tmp_path)]) == 0
    assert (tmp_path / "convergence_time_relmse_trimmed.pdf").is_file() and (tmp_path / "convergence_spp_relmse_trimmed.pdf").is_file()
    assert "Points: checkpoints in seconds" in " ".join((tmp_path / "convergence_time.caption.txt").read_text().split())
    said = capsys.readouterr().err
    assert re.search("box: the worst few of the pixels hold more than half of relMSE. relMSE over trimmed relMSE: (slow 4, fast 4|fast 4, slow 4). State both", said)
    row = next(csv.DictReader((tmp_path / "table.csv").read_text().splitlines()))
    assert float(row["relmse_trimmed"]) == pytest.approx(4 * 4 / 32 / 4, rel=1e-6) and float(row["relmse_over_trimmed"]) == pytest.approx(4)
    lines = summary.lines(data)
    assert "trimmed relMSE" in tables.headings(data, lines) and "(×4.0)" in tables.to_html(data, lines)
    assert "trimmed relMSE" in (tmp_path / "errors.tex").read_text()


def test_trimming_that_changes_the_order_is_said(tmp_path):
    """`fast` has its error in few pixels: whole it is worse than `slow`, trimmed it is better."""
    folder = synthetic.make(tmp_path / "r", scenes=("box",), runs=(("slow", 1.0, 1.0), ("fast", 1.1, 1.0)), seconds=SECONDS, spread=0, outliers=1.0)
    rows = [line.split(",") for line in (folder / "runs.csv").read_text().splitlines()]
    for cells in rows[1:]:
        if cells[1] == "fast":
            cells[-2:] = [f"{float(c) / 9:.9g}" for c in cells[-2:]]
    (folder / "runs.csv").write_text("\n".join(map(",".join, rows)) + "\n")
    manifest = json.loads((folder / "manifest.json").read_text()) | {"trimmed_share": 0.001}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    data = experiment.load(folder)
    (said,) = remarks.trimmed_remarks(data, summary.lines(data))
    assert "worst 0.1 % of the pixels" in said and "fast 9; fast has the lowest trimmed relMSE, slow the lowest relMSE" in said


def test_how_references_were_made():
    assert captions.reference_facts({"integrator": "bdpt", "settings": "integrator=bdpt variant=wavefront rr_depth=-1", "spp": 2048, "noise": 0.0092294}) == \
        "by bdpt (variant wavefront, rr_depth -1), 2048 spp, RMS standard error 0.00923"
    assert captions.reference_facts({"integrator": "path", "settings": "", "spp": 64}) == "by path (estimator mis), 64 spp"
    assert captions.reference_facts({"noise": 0.5}) == "RMS standard error 0.5" and captions.reference_facts({}) == ""


def clocks(when, cpu, *sm):
    return {"when": when, "date": "2026-01-01T00:00:00Z", "cpu_mhz": {"lowest": cpu, "mean": cpu, "highest": cpu} if cpu else None,
            "gpu": [{"sm_mhz": mhz, "memory_mhz": 1, "celsius": 30} for mhz in sm] or None}


def test_clocks_are_stated_and_remarked(folder, data):
    assert remarks.clock_text(data) is None and list(remarks.clock_remarks(data)) == []
    made = experiment.load(folder)
    made.manifest["clocks"] = [clocks("start", 2600, 345), clocks("end", 2500, 1980)]
    assert remarks.clock_text(made) == "CPU 2600 MHz (start), 2500 MHz (end); GPU 0 SM 345 MHz (start), 1980 MHz (end)"
    (said,) = remarks.clock_remarks(made)
    assert said.startswith("GPU 0: 345 MHz at start, 1980 at end (an idle GPU shows low clocks")
    assert any("Clocks: CPU 2600" in line for line in captions.data_behind(made, ["box"], ["slow"])) and "Clocks: CPU 2600" in report.reference_table(made)
    made.manifest["clocks"] = [clocks("start", 3000), clocks("end", 2000)]
    assert list(remarks.clock_remarks(made)) == ["CPU: 3000 MHz at start, 2000 at end; times of early and late renders may not be comparable"]
    made.manifest["clocks"] = [clocks("start", None)]
    assert remarks.clock_text(made) is None and list(remarks.clock_remarks(made)) == []

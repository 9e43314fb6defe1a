"""From a folder of known content to table, figures and report."""

import csv
import math
import re

import numpy as np
import pytest

from analysis import __main__ as program
from analysis import experiment, figures, images, summary, tables
from analysis.tests import synthetic


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return synthetic.make(tmp_path_factory.mktemp("results") / "run")


@pytest.fixture(scope="module")
def output(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    assert program.main([str(folder), "-o", str(out)]) == 0
    return out


def edit(folder, target, change):
    """Copy of the folder's tables with runs.csv changed by a function on its lines."""
    target.mkdir()
    (target / "manifest.json").write_text((folder / "manifest.json").read_text())
    (target / "runs.csv").write_text("\n".join(change((folder / "runs.csv").read_text().splitlines())) + "\n")
    return target


def test_lines_repeat_what_was_recorded(tmp_path):
    data = experiment.load(synthetic.make(tmp_path / "r", spread=0.0, reference_noise=0.0))
    lines = {(line.scene, line.run): line for line in summary.lines(data)}
    mis = lines["box", "mis"]
    assert (mis.seeds, mis.spp) == (3, pytest.approx(64))
    assert mis.rmse == pytest.approx(0.5 / 8)
    assert mis.relmse == pytest.approx(4 * 0.25 / 64)
    assert mis.seconds == pytest.approx(0.128)
    assert mis.efficiency == pytest.approx(1 / (0.015625 * 0.128))
    # naive: relMSE 4*4/64, 0.064 s. Work 0.016 against 0.002.
    assert mis.speedup.value == pytest.approx(8)
    assert lines["box", "naive"].speedup.value == 1
    assert mis.slope.value == pytest.approx(-0.5) and mis.slope.error == pytest.approx(0, abs=1e-9)
    assert mis.rays_per_second == pytest.approx(64 * 10000 / 0.128)


def test_speedup_interval_covers_the_truth(tmp_path):
    data = experiment.load(synthetic.make(tmp_path / "r", scenes=[f"s{i}" for i in range(60)], checkpoints=(1, 4), seeds=(1, 2, 3, 4)))
    intervals = [line.speedup for line in summary.lines(data) if line.run == "mis"]
    covered = sum(s.low <= 8 <= s.high for s in intervals)
    assert covered >= 60 * 0.95 - 4 * math.sqrt(60 * 0.95 * 0.05)
    assert not any(s.low <= 1 for s in intervals)


def test_curve_is_geometric_mean_with_extremes(folder):
    data = experiment.load(folder)
    c = summary.curve(data, "box", "nee")
    first = [r.rmse_corrected for r in data.select("box", "nee", 0)]
    assert c.error[0] == pytest.approx(np.exp(np.log(first).mean()))
    assert (c.low[0], c.high[0]) == (min(first), max(first))
    assert list(c.spp) == pytest.approx([1, 4, 16, 64])


def test_all_files_are_written(output):
    assert {p.name for p in output.iterdir()} == {"convergence_time.pdf", "convergence_time.png", "convergence_spp.pdf", "convergence_spp.png", "table.csv",
                                                  "table.tex", "report.html"}


def test_report_is_self_contained(output):
    text = (output / "report.html").read_text()
    sources = re.findall(r'src="([^"]*)"', text)
    assert len(sources) == 2 + 2 * (1 + 3 + 3)  # two figures; per scene reference, renderings, error maps
    assert all(s.startswith("data:image/png;base64,") for s in sources)
    assert not re.search(r"https?://|<link|<script", text)
    assert "a processor &lt;&amp;&gt;" in text


def test_csv_table_holds_one_line_per_scene_and_run(output):
    rows = list(csv.DictReader(open(output / "table.csv", newline="")))
    assert [(r["scene"], r["run"]) for r in rows] == [(s, r) for s in ("box", "glass") for r in ("naive", "nee", "mis")]
    assert all(abs(float(r["slope"]) + 0.5) < 1e-6 for r in rows)


def test_latex_table_has_equal_columns_and_no_raw_specials(output):
    text = (output / "table.tex").read_text()
    body = [line for line in text.splitlines() if line.endswith(r"\\")]
    assert {line.count(" & ") for line in body} == {len(tables.HEADINGS) - 1}
    assert "speed-up [95 \\%]" in text
    assert not re.search(r"[^\x00-\x7f]", "".join(body))
    assert tables.latex_escape("a_b%") == r"a\_b\%"


def test_same_input_gives_same_bytes(folder, output, tmp_path):
    assert program.main([str(folder), "-o", str(tmp_path)]) == 0
    for path in output.iterdir():
        assert (tmp_path / path.name).read_bytes() == path.read_bytes(), path.name


def test_unfinished_experiment_is_reported_with_a_remark(folder, tmp_path, capsys):
    part = edit(folder, tmp_path / "part", lambda lines: [x for x in lines if not x.startswith(("box,mis,3", "box,mis,2,3"))])
    data = experiment.load(part)
    assert data.last_common_checkpoint("box") == 3
    line = next(x for x in summary.lines(data) if (x.scene, x.run) == ("box", "mis"))
    assert line.seeds == 1 and math.isnan(line.speedup.low)
    assert program.main([str(part), "-o", str(tmp_path / "out")]) == 0
    assert "box, mis: 7 of 12 checkpoints recorded" in capsys.readouterr().err


def test_bias_invalid_values_and_noisy_references_are_remarked(folder, tmp_path):
    def change(lines):
        cells = lines[1].split(",")
        out = []
        for line in lines:
            cells = line.split(",")
            if line.startswith("box,mis,2,3"):
                cells[17], cells[19] = "-9.5", "4"
            if line.startswith("box,nee,"):
                cells[11] = "0.0001"
            if line.startswith("glass,nee,1,2"):
                cells[10] = cells[11] = "nan"
                cells[10] = "inf"
            out.append(",".join(cells))
        return out
    data = experiment.load(edit(folder, tmp_path / "odd", change))
    text = "\n".join(summary.remarks(data, summary.lines(data)))
    assert "box, mis: 4 values were NaN" in text
    assert "|z| = 9.5" in text
    assert "box, nee: the error is below the noise of the reference" in text
    assert "glass, nee: the error of 1 checkpoints is NaN or infinite" in text


def test_bias_threshold_holds_its_level():
    rng = np.random.default_rng(2)
    false_alarms = (np.abs(rng.normal(size=(4000, 18))).max(axis=1) > summary.bias_threshold(18)).sum()
    # At most 1 % and, for independent tests, barely less: binomial standard deviation 6.3.
    assert 40 - 4 * 6.3 < false_alarms < 40 + 4 * 6.3


def test_one_seed_and_one_checkpoint_are_enough(tmp_path):
    folder = synthetic.make(tmp_path / "tiny", scenes=("only",), runs=(("a", 1.0, 1.0),), seeds=(7,), checkpoints=(8,))
    assert program.main([str(folder), "-o", str(tmp_path / "out")]) == 0


@pytest.mark.parametrize("change,message", [
    (lambda lines: [lines[0].replace("relmse,", "other,"), *lines[1:]], r"runs.csv:1: lacks the column relmse"),
    (lambda lines: [*lines, lines[1]], r"repeats line 2"),
    (lambda lines: [lines[0], lines[1].replace(",0.001000,", ",soon,")], r"runs.csv:2: column 'time' holds 'soon'"),
    (lambda lines: [lines[0], lines[1].replace("box", "cave")], r"scene 'cave' is not in manifest.json"),
    (lambda lines: [lines[0], lines[1] + ",1"], r"runs.csv:2: number of cells"),
    (lambda lines: lines[:1], r"holds no results yet"),
])
def test_bad_tables_are_refused_with_place_and_name(folder, tmp_path, change, message, capsys):
    bad = edit(folder, tmp_path / "bad", change)
    assert program.main([str(bad), "-o", str(tmp_path / "out")]) == 3
    assert re.search(message, capsys.readouterr().err)


def test_other_folders_are_refused(tmp_path, capsys):
    assert program.main([str(tmp_path), "-o", str(tmp_path / "out")]) == 3
    assert "no manifest.json" in capsys.readouterr().err


def test_further_columns_do_no_harm(folder, tmp_path):
    data = experiment.load(edit(folder, tmp_path / "more", lambda lines: [lines[0] + ",new", *(x + ",1" for x in lines[1:])]))
    assert len(data.rows) == 72


def test_run_names_that_begin_alike_do_not_mix(tmp_path):
    folder = synthetic.make(tmp_path / "r", scenes=("box",), runs=(("mis", 1.0, 1.0), ("mis_2", 1.0, 1.0)), seeds=(1,))
    data = experiment.load(folder)
    assert data.image("box", "mis").name == "mis_1.exr" and data.image("box", "mis_2").name == "mis_2_1.exr"


def test_tone_map_and_error_map():
    grey = np.full((2, 2, 3), 0.5, dtype=np.float32)
    assert images.exposure(grey) == pytest.approx(1.6)
    assert (images.tone_map(grey, 1.0) == 188).all()  # sRGB of 0.5 is 187.5
    broken = grey.copy()
    broken[0, 0, 1] = np.nan
    assert tuple(images.tone_map(broken, 1.0)[0, 0]) == (255, 0, 255)
    assert images.relative_error(grey + 0.255, grey) == pytest.approx(np.full((2, 2), 0.5))


def test_tick_labels():
    assert [figures.plain_number(x) for x in (0.001, 0.5, 20, 1e-5, 2e6)] == ["0.001", "0.5", "20", "$10^{-5}$", r"$2\cdot10^{6}$"]

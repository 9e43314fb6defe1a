"""From a folder of known content to numbers and tables. Figures: test_figures.py; the page: test_page.py."""

import csv
import math
import re

import numpy as np
import pytest
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

from ambilux.analysis import __main__ as program
from ambilux.analysis import experiment, heavy_tails, images, latex, remarks, style, summary, tables, verdicts
from ambilux.analysis.tests import synthetic


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return synthetic.make(tmp_path_factory.mktemp("results") / "run")


def edit(folder, target, change):
    """Copy of the folder's tables with runs.csv changed by a function on its lines."""
    target.mkdir()
    (target / "manifest.json").write_text((folder / "manifest.json").read_text())
    (target / "runs.csv").write_text("\n".join(change((folder / "runs.csv").read_text().splitlines())) + "\n")
    return target


def test_lines_repeat_what_was_recorded(tmp_path):
    data = experiment.load(synthetic.make(tmp_path / "r", spread=0.0, reference_noise=0.0, batches=16))
    lines = {(line.scene, line.run): line for line in summary.lines(data)}
    mis = lines["box", "mis"]
    assert (mis.seeds, mis.spp) == (3, pytest.approx(64))
    assert mis.rmse.value == pytest.approx(0.5 / 8)
    assert mis.relmse.value == pytest.approx(4 * 0.25 / 64)
    assert mis.seconds == pytest.approx(0.128)
    assert mis.efficiency_seeds.value == pytest.approx(1 / (0.015625 * 0.128))
    # naive: relMSE 4*4/64, 0.064 s. Work 0.016 against 0.002.
    assert mis.ratio_seeds.value == pytest.approx(8)
    assert mis.ratio.over == "batches" and mis.ratio.value == pytest.approx(8, rel=0.03) and mis.ratio.low < 8 < mis.ratio.high
    assert mis.averaging == pytest.approx(1, rel=0.02)
    # At equal RMSE: (2 / 0.5)^2 fewer samples of twice the time. It was below the target at 1 ms already by a factor of 4.
    assert mis.speedup.value == pytest.approx(8) and mis.speedup.target == pytest.approx(2 / 8) and mis.speedup.sign == ""
    assert lines["box", "naive"].speedup.value == pytest.approx(1)
    assert mis.bias.estimate.value == pytest.approx(0.0001) and mis.slope_time.value == pytest.approx(-0.5)
    assert mis.slope.value == pytest.approx(-0.5) and mis.slope.error == pytest.approx(0, abs=1e-9)
    assert mis.rays_per_second == pytest.approx(64 * 10000 / 0.128)


def test_one_outlying_seed_is_not_flattered(tmp_path):
    """Errors 1, 1 and 16 times: the arithmetic mean of relMSE is 6, the geometric one would be 2.5."""
    folder = synthetic.make(tmp_path / "r", scenes=("box",), spread=0.0, reference_noise=0.0)

    def change(line):
        cells = line.split(",")
        if cells[1] == "mis" and cells[2] == "3":
            cells[13], cells[14] = (f"{16 * float(cells[i]):.9g}" for i in (13, 14))
        return ",".join(cells)

    data = experiment.load(edit(folder, tmp_path / "odd", lambda rows: [rows[0], *map(change, rows[1:])]))
    line = next(x for x in summary.lines(data) if x.run == "mis")
    assert line.relmse.value == pytest.approx(6 * 4 * 0.25 / 64) and line.relmse.doubt == "3 seeds"
    assert line.efficiency.value == pytest.approx(1 / (line.relmse.value * line.seconds))


def test_where_no_interval_can_be_trusted_the_table_says_why_and_gives_no_ratio(folder, tmp_path):
    data = experiment.load(folder)
    row = next(r for r in latex.results(data, summary.lines(data))[0].splitlines() if "& mis" in r)
    assert "--$^{a}$" in row and "$^{a}$ too few seeds" in latex.results(data, summary.lines(data))[0] and "textbf" not in row
    data = experiment.load(synthetic.make(tmp_path / "few", scenes=("box",), checkpoints=(1, 4, 16, 64), seconds=(0.04, 0.08), outliers=4.0))
    line = next(x for x in summary.lines(data) if x.run == "mis")
    assert line.ratio.doubt == "few pixels decide" and "few pixels decide" in latex.results(data, summary.lines(data))[0]


def test_bold_and_statements_need_significance(tmp_path):
    near = (("a", 1.0, 1.0), ("b", 0.997, 1.0), ("c", 2.0, 1.0))
    data = experiment.load(synthetic.make(tmp_path / "near", scenes=("box",), runs=near, batches=16))
    lines = summary.lines(data)
    assert verdicts.best(lines, "box") is None and "textbf" not in latex.results(data, lines)[0]
    assert [verdicts.differs(line, lines) for line in lines] == [False, False, True]
    far = (("a", 1.0, 1.0), ("b", 0.8, 1.0), ("c", 2.0, 1.0))
    data = experiment.load(synthetic.make(tmp_path / "far", scenes=("box",), runs=far, batches=16))
    lines = summary.lines(data)
    assert verdicts.best(lines, "box").run == "b" and latex.results(data, lines)[0].count("textbf") == 1


def test_the_configuration_chooses_the_metric_that_leads(tmp_path, capsys):
    data = experiment.load(synthetic.make(tmp_path / "r", scenes=("box",), spread=0.0, reference_noise=0.0, metric="mse"))
    line = next(x for x in summary.lines(data) if x.run == "mis")
    assert line.efficiency_seeds.value == pytest.approx(1 / (0.25 / 64 * 0.128))
    shown = tables.headings(data, [line])
    assert shown.index("RMSE") < shown.index("relMSE") and "1 / (MSE" in tables.caption(data, [line])
    (tmp_path / "r" / "config.resolved.toml").write_text("metric = 'ssim'\n")
    assert program.main([str(tmp_path / "r"), "-o", str(tmp_path / "out")]) == 3
    assert "metric = 'ssim' is neither relmse nor mse" in capsys.readouterr().err


def test_folders_of_other_formats_are_refused(folder, tmp_path, capsys):
    bad = edit(folder, tmp_path / "bad", lambda lines: lines)
    (bad / "manifest.json").write_text('{"format": 99, "scenes": [{"name": "box"}], "runs": [{"name": "mis"}]}')
    assert program.main([str(bad), "-o", str(tmp_path / "out")]) == 3
    assert "'format' is 99; this version reads formats 1 to 2" in capsys.readouterr().err


def test_what_cannot_be_written_or_shown_is_an_error(folder, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert program.main([str(folder), "-o", str(tmp_path / "file")]) == 4
    assert program.main(["pack", str(folder), "-o", str(tmp_path / "none" / "a.zip")]) == 4
    assert program.main([str(folder), "-o", str(tmp_path / "out"), "--inset", "no_such=0,0,4"]) == 3
    assert "--inset no_such: there is no such scene; there are box" in capsys.readouterr().err
    assert program.main([str(folder), "-o", str(tmp_path / "out"), "--inset", "box=0,0,9999"]) == 3
    assert "--inset box=0,0,9999: the image has" in capsys.readouterr().err
    with pytest.raises(SystemExit) as ended:
        program.main([str(folder), "-o", str(tmp_path / "out"), *["--inset", "box=0,0,4"] * 3])
    assert ended.value.code == 2 and "at most 2 of a scene" in capsys.readouterr().err
    with pytest.raises(SystemExit) as ended:
        program.main(["pack", str(folder), "-o", str(tmp_path)])
    assert ended.value.code == 2 and "name the archive" in capsys.readouterr().err


def test_curve_is_the_arithmetic_mean(folder):
    data = experiment.load(folder)
    c = summary.curve(data, "box", "nee")
    squares = np.array([r.rmse_corrected for r in data.select("box", "nee", 0)]) ** 2
    assert c.error[0] == pytest.approx(math.sqrt(squares.mean()))
    assert np.isnan(c.low).all()  # three seeds, and nobody recorded whether few pixels decide
    assert list(c.spp) == pytest.approx([1, 4, 16, 64])
    assert summary.curve(data, "box", "nee", "relmse").error[0] == pytest.approx(4 * c.error[0] ** 2)


def test_csv_table_holds_one_line_per_scene_and_run(folder):
    data = experiment.load(folder)
    rows = list(csv.DictReader(tables.to_csv(summary.lines(data)).splitlines()))
    assert [(r["scene"], r["run"]) for r in rows] == [(s, r) for s in ("box", "glass") for r in ("naive", "nee", "mis")]
    assert all(abs(float(r["slope"]) + 0.5) < 1e-6 for r in rows)


def test_verdicts_say_what_the_data_say(tmp_path):
    """Exact -1/2, a plateau of bias, and a mean that is off: each is named, and nothing else is."""
    folder = synthetic.make(tmp_path / "r", scenes=("box",), seeds=(1, 2, 3, 4), spread=0.03)

    def change(line, seed_noise=np.random.default_rng(8)):
        cells = line.split(",")
        if cells[1] == "nee":  # error^2 = variance / n + bias^2
            cells[10] = cells[11] = f"{math.hypot(float(cells[11]), 0.2):.9g}"
        if cells[0] == "box":
            cells[16] = f"{(0.01 if cells[1] == 'mis' else 0) + 0.0002 * seed_noise.normal():.6g}"
            cells[17] = f"{float(cells[16]) / 0.0002:.6g}"
        return ",".join(cells)

    data = experiment.load(edit(folder, tmp_path / "odd", lambda rows: [rows[0], *map(change, rows[1:])]))
    lines = summary.lines(data)
    said = {run: text for (_, run), text in verdicts.verdicts(lines).items()}
    assert "no departure" in said["naive"][0] and "no bias found" in said["naive"][1]
    assert "differs from −1/2" in said["nee"][0] and "no bias found" in said["nee"][1]
    assert "no departure" in said["mis"][0] and "more than chance" in said["mis"][1]
    # Speed-ups that compare with a biased run are marked.
    assert verdicts.biased(lines) == {("box", "mis")}
    marked = [row for row in latex.results(data, lines)[0].splitlines() if r"$^\dagger$" in row and row.endswith(r"\\")]
    assert len(marked) == 1 and "& mis" in marked[0]


def test_silence_of_a_test_counts_only_where_it_could_have_spoken(tmp_path):
    """Of checkpoints with 3 % of noise: four seeds tell what departure they would have shown, two cannot tell any."""
    def change(line, luck=np.random.default_rng(3)):
        cells = line.split(",")
        cells[10] = cells[11] = f"{float(cells[11]) * math.exp(0.03 * luck.normal()):.9g}"
        return ",".join(cells)

    for seeds, words in (((1, 2, 3, 4), r"no departure from −1/2 found; one by 0\.\d+ would have been"), ((1, 2), r"2 seeds cannot test it \(they would show a departure from −1/2 by [\d.e+]+ or more\)")):
        folder = synthetic.make(tmp_path / str(len(seeds)), scenes=("box",), seeds=seeds)
        lines = summary.lines(experiment.load(edit(folder, tmp_path / f"noise{len(seeds)}", lambda rows: [rows[0], *map(change, rows[1:])])))
        said = verdicts.verdicts(lines)["box", "naive"][0]
        assert re.search(words, said), said
        assert (verdicts.slope_power(lines[0], lines) <= verdicts.WEAK) == (len(seeds) == 4)


def test_a_bias_that_the_method_states_is_told_and_takes_no_slope_for_a_fault(tmp_path):
    folder = synthetic.make(tmp_path / "r", scenes=("box",), seeds=(1, 2, 3, 4), spread=0.03)

    def change(line):
        cells = line.split(",")
        if cells[1] in ("nee", "mis"):  # error^2 = variance / n + bias^2
            cells[10] = cells[11] = f"{math.hypot(float(cells[11]), 0.2):.9g}"
        return ",".join([*cells, "biased by a radius" if cells[1] == "mis" else ""])

    data = experiment.load(edit(folder, tmp_path / "stated", lambda rows: [rows[0] + ",stated_bias", *map(change, rows[1:])]))
    lines = summary.lines(data)
    assert {line.run: line.stated_bias for line in lines} == {"naive": "", "nee": "", "mis": "biased by a radius"}
    found = remarks.remarks(data, lines)
    assert any("mis: biased by a radius, so that errors include this bias" == r.split(" and need")[0] for r in found)
    assert any("box, nee: the error falls with slope" in r for r in found)
    assert not any("box, mis: the error falls with slope" in r for r in found)
    assert verdicts.verdicts(lines)["box", "mis"][1].endswith("by its method biased by a radius")


def test_slopes_leave_out_what_the_noise_of_the_reference_hides(tmp_path):
    data = experiment.load(synthetic.make(tmp_path / "r", scenes=("box",), reference_noise=0.3))
    assert summary.resolved(data, "box", "naive") == [0, 1, 2]  # 2, 1, 0.5, but not 0.25
    assert summary.resolved(data, "box", "mis") == [0]
    assert summary.slope(data, "box", "mis") == (None, 0)


def test_the_default_of_the_ablation_is_what_others_are_compared_with(tmp_path, capsys):
    data = experiment.load(synthetic.make(tmp_path / "r", spread=0, base="nee"))
    assert data.base == "nee" and data.others == ["naive", "mis"]
    lines = {(line.scene, line.run): line for line in summary.lines(data)}
    assert lines["box", "naive"].ratio_seeds.value == pytest.approx((0.7 / 2) ** 2 * 1.5)
    (tmp_path / "r" / "config.resolved.toml").write_text("[ablation]\ndefault = 'none'\n")
    assert program.main([str(tmp_path / "r"), "-o", str(tmp_path / "out")]) == 3
    assert "config.resolved.toml: [ablation] default = 'none' is not a run" in capsys.readouterr().err
    (tmp_path / "r" / "config.resolved.toml").write_text("name = \n")
    assert program.main([str(tmp_path / "r"), "-o", str(tmp_path / "out")]) == 3
    assert re.search(r"config.resolved.toml: .*line 1, column", capsys.readouterr().err)


def test_run_names_of_sweeps():
    assert experiment.settings_of("lvc[connections=4]") == ("lvc", {"connections": "4"})
    assert experiment.settings_of("lvc[connections=4,rr_depth=-1]") == ("lvc", {"connections": "4", "rr_depth": "-1"})
    assert experiment.settings_of("lvc") == ("lvc", {})
    assert experiment.settings_of("odd[name]") == ("odd[name]", {})


def body_of(text):
    return [line for line in text.splitlines() if line.endswith(r"\\") and "multicolumn" not in line]


def test_latex_tables_have_equal_columns_and_no_raw_specials(folder):
    data = experiment.load(folder)
    made = latex.files(data, summary.lines(data))
    assert list(made) == ["table.tex", "errors.tex", "table_column.tex", "tests.tex"]
    for name, text in made.items():
        body = body_of(text)
        assert len(body) == 7, name
        assert len({line.count(" & ") for line in body}) == 1, name
        assert not re.search(r"[^\x00-\x7f]", text.split("\n", 1)[1]), name
    assert all("[95 \\%]" in made[name] for name in ("table.tex", "table_column.tex", "tests.tex"))
    assert latex.escape("a_b%") == r"a\_b\%"
    assert latex.number("-1.2e-05") == r"$-1.2\cdot 10^{-5}$"


def inches(tabular):
    """Width of a tabular in Computer Modern of 8 points: the widest cell of each column, and the room between columns."""
    def width(cell):
        words = re.sub(r"\\begin\{tabular\}\[t\]\{[^}]*\}\}|\\end\{tabular\}|\\(?:textbf|emph|pm|cdot|dagger)\b|[${}^\\]", "", cell.replace(r"\begin{tabular}[t]{@{}l@{}}", ""))
        return text_to_path.get_text_width_height_descent(words, FontProperties(family="cmr10", size=8), ismath=False)[0] if words.strip() else 0.0
    rows = [[max(map(width, cell.split(r"\\"))) for cell in re.split(r" & ", line.removesuffix(r" \\"))] for line in body_of(tabular)]
    return (sum(map(max, zip(*rows))) + 2 * 3.5 * len(rows[0])) / 72


def test_latex_tables_are_as_wide_as_a_page_and_a_column_of_a_paper(tmp_path):
    long = tuple((f"lvc[connections={n},wave_size=4096]", 1.0 + n / 100, 1.0) for n in (1, 16)) + (("hits+next_event+connections", 2.0, 1.0),)
    data = experiment.load(synthetic.make(tmp_path / "r", scenes=("veach-ajar", "living-room[size=640x360]"), runs=long, batches=40, checkpoints=(1, 4, 16, 64), seconds=(0.04, 0.08)))
    made = latex.files(data, summary.lines(data))
    assert "[0." in made["table.tex"]  # intervals are stated
    for name, widest in (("table.tex", style.PAGE), ("errors.tex", style.PAGE), ("tests.tex", style.PAGE), ("table_column.tex", style.COLUMN)):
        assert 0.5 * widest < inches(made[name]) <= 0.97 * widest, name


def test_latex_tables_of_many_long_names_are_as_wide_as_a_page_and_no_longer(tmp_path, monkeypatch):
    """Names are broken as far as the table has no room for them; tables are continued, with whole scenes where a page has room for one."""
    monkeypatch.setattr(heavy_tails, "RESAMPLES", 49)
    long = tuple((f"lvc[connections={n},light_paths=0.25,wave_size=4096]", 1.0 + n / 100, 1.0) for n in range(16)) + (("a_method_with_a_very_long_name_as_people_give_them", 2.0, 1.0),)
    data = experiment.load(synthetic.make(tmp_path / "r", scenes=("cornell[max_depth=3]", "cornell[max_depth=6]", "glass"), runs=long, batches=16, checkpoints=(1, 16)))
    made = latex.files(data, summary.lines(data))
    assert {"table.tex", "table_2.tex", "table_column.tex", "table_column_2.tex"} <= made.keys()
    for name, text in made.items():
        assert inches(text) <= 0.97 * (style.COLUMN if "column" in name else style.PAGE), name
        assert sum(max(cell.count(r"\\{}") for cell in row.split(" & ")) + 1 for row in body_of(text)) <= latex.LINES, name
    rows = [row for name, text in made.items() if re.fullmatch(r"table(_\d)?.tex", name) for row in body_of(text) if " & " in row and not row.startswith("scene")]
    assert len(rows) == 3 * 17


def test_printed_intervals_hold_the_printed_value():
    rng = np.random.default_rng(4)
    for _ in range(500):
        value = 10.0 ** rng.uniform(-6, 5)
        low, high = (value * math.exp(sign * 10.0 ** rng.uniform(-5, 0.5)) for sign in (-1, 1))
        told = [float(x) for x in re.findall(r"[\d.]+(?:e[-+]\d+)?", tables.interval(heavy_tails.Judged(value, low, high, 0.5, "seeds", 3)))]
        assert told[1] <= told[0] <= told[2] and told == pytest.approx([value, low, high], rel=0.06)
    assert tables.interval(heavy_tails.Judged(0.437, 0.4352, 0.4388, 0.5, "seeds", 3)) == "0.437 [0.435, 0.439]"


def test_unfinished_experiment_is_reported_with_a_remark(folder, tmp_path):
    part = edit(folder, tmp_path / "part", lambda lines: [x for x in lines if not x.startswith(("box,mis,3", "box,mis,2,3"))])
    data = experiment.load(part)
    assert data.last_common_checkpoint("box") == 3
    line = next(x for x in summary.lines(data) if (x.scene, x.run) == ("box", "mis"))
    assert line.seeds == 1 and line.ratio.doubt == "1 seed"
    assert any("box, mis: 7 of 12 checkpoints recorded" in r for r in remarks.remarks(data, summary.lines(data)))


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
    text = "\n".join(remarks.remarks(data, summary.lines(data)))
    assert "box, mis: 4 values were NaN" in text
    assert "|z| = 9.5" in text
    assert "box: the error of nee is below the noise of the reference" in text
    assert "glass, nee: the error of 1 checkpoints is NaN or infinite" in text


def test_bias_threshold_holds_its_level():
    rng = np.random.default_rng(2)
    false_alarms = (np.abs(rng.normal(size=(4000, 18))).max(axis=1) > verdicts.bias_threshold(18)).sum()
    # At most 1 % and, for independent tests, barely less: binomial standard deviation 6.3.
    assert 40 - 4 * 6.3 < false_alarms < 40 + 4 * 6.3


@pytest.mark.parametrize("change,message", [
    (lambda lines: [lines[0].replace("relmse,", "other,"), *lines[1:]], r"runs.csv:1: lacks the column relmse"),
    (lambda lines: [*lines, lines[1]], r"repeats line 2"),
    (lambda lines: [lines[0], lines[1].replace(",0.001000,", ",soon,")], r"runs.csv:2: column 'time' holds 'soon'"),
    (lambda lines: [lines[0], lines[1].replace("box", "cave")], r"runs.csv:2: column 'scene': scene 'cave' is not in manifest.json"),
    (lambda lines: [lines[0], lines[1] + ",1"], r"runs.csv:2: 21 cells where the header names 20"),
    (lambda lines: [*lines, lines[1][:40]], r"runs.csv:74: ends in column 'spp', 9 cells .*half-written.*--resume"),
    (lambda lines: [lines[0], lines[1].replace(",0.001000,", ",-1,")], r"runs.csv:2: column 'time' holds '-1', which must be positive"),
    (lambda lines: lines[:1], r"holds no results yet"),
])
def test_bad_tables_are_refused_with_place_and_name(folder, tmp_path, change, message, capsys):
    bad = edit(folder, tmp_path / "bad", change)
    assert program.main([str(bad), "-o", str(tmp_path / "out")]) == 3
    assert re.search(message, capsys.readouterr().err)


def test_a_line_without_end_is_half_written(folder, tmp_path, capsys):
    bad = edit(folder, tmp_path / "bad", lambda lines: lines)
    path = bad / "runs.csv"
    path.write_text(path.read_text()[:-1])
    assert program.main([str(bad), "-o", str(tmp_path / "out")]) == 3
    assert re.search(r"runs.csv:73: column 'invalid'.*half-written", capsys.readouterr().err)


def test_other_folders_are_refused(tmp_path, capsys):
    for name, message in (("", "is empty: it has no manifest.json"), ("none", "is no folder"), ("other", "is no experiment folder")):
        if name == "other":
            (tmp_path / name).mkdir()
            (tmp_path / name / "x").touch()
        assert program.main([str(tmp_path / name), "-o", str(tmp_path / "out")]) == 3
        assert message in capsys.readouterr().err


@pytest.mark.parametrize("content,message", [
    ('{"scenes": [', r"manifest.json:1: column 13: .*half-written"),
    ('{"scenes": [], "runs": []}', r"manifest.json: the list 'scenes' is empty"),
    ('{"scenes": []}', r"manifest.json: lacks the lists"),
])
def test_bad_manifests_are_refused(folder, tmp_path, content, message, capsys):
    bad = edit(folder, tmp_path / "bad", lambda lines: lines)
    (bad / "manifest.json").write_text(content)
    assert program.main([str(bad), "-o", str(tmp_path / "out")]) == 3
    assert re.search(message, capsys.readouterr().err)


def test_further_columns_do_no_harm(folder, tmp_path):
    data = experiment.load(edit(folder, tmp_path / "more", lambda lines: [lines[0] + ",new", *(x + ",1" for x in lines[1:])]))
    assert len(data.rows) == 72


def test_run_names_that_begin_alike_do_not_mix(tmp_path):
    folder = synthetic.make(tmp_path / "r", scenes=("box",), runs=(("mis", 1.0, 1.0), ("mis_2", 1.0, 1.0)), seeds=(1,))
    data = experiment.load(folder)
    assert data.image("box", "mis")[1].name == "mis_1.exr" and data.image("box", "mis_2")[1].name == "mis_2_1.exr"


def test_tone_map_and_error_map():
    grey = np.full((2, 2, 3), 0.5, dtype=np.float32)
    assert images.exposure(grey) == pytest.approx(1.6)
    assert (images.tone_map(grey, 1.0) == 188).all()  # sRGB of 0.5 is 187.5
    broken = grey.copy()
    broken[0, 0, 1] = np.nan
    assert tuple(images.tone_map(broken, 1.0)[0, 0]) == (255, 0, 255)
    assert images.relative_error(grey + 0.255, grey) == pytest.approx(np.full((2, 2), 0.5))


def test_tick_labels():
    assert [style.plain_number(x) for x in (0.001, 0.5, 20, 1e-5, 2e6)] == ["0.001", "0.5", "20", "$10^{-5}$", r"$2\cdot10^{6}$"]

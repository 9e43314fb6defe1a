"""Tables, maps and page of a stress sweep, from synthetic rows."""

import csv

import numpy as np
import pytest

from ambilux.analysis import stress, stress_sweep
from ambilux.analysis.experiment import InputError

HEADER = ["cell", "family", "value", "method", "backend", "verdict", "mean", "standard_error", "dof", "expected", "expected_error", "relative_bias", "z", "box_z", "p",
          "events", "variance", "variance_ratio", "first", "samples", "paths", "invalid", "lost", "underflow", "seconds", "limit", "note"]


def row(cell, method="bdpt", backend="cpu", verdict="ok", mean=1.0, error=0.001, **others):
    family, _, label = cell.partition("_")
    entry = dict.fromkeys(HEADER, 0) | {"cell": cell, "family": family, "value": float(label), "method": method, "backend": backend, "verdict": verdict, "mean": mean,
                                        "standard_error": error, "dof": 31, "expected": 1, "p": 1, "events": 1e4, "variance": 1, "variance_ratio": 1, "first": mean,
                                        "samples": 32, "paths": 32768, "limit": "", "note": ""}
    return entry | others


def sweep_of(folder, rows, tail=""):
    folder.mkdir(exist_ok=True)
    with open(folder / "stress.csv", "w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, HEADER, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
        file.write(tail)
    return folder


ROWS = [row("size_100"), row("size_1", "path-nee", verdict="noisy"), row("size_1"), row("size_100", "path-nee", verdict="failed", mean=0.5, relative_bias=-0.5, z=-30, note="<why>"),
        row("pane_1e-06", verdict="limit", relative_bias=0.2, limit="Contact shadows and thin panes"),
        row("pane_1e-07", verdict="limit", relative_bias=-0.4, limit="Contact shadows and thin panes"), row("pane_1", invalid=3, verdict="invalid"),
        row("pane_1", "path-nee", verdict="left out", samples=0, note="for devices")]


def test_rows_stand_by_family_and_value(tmp_path):
    sweep = stress_sweep.load([sweep_of(tmp_path / "a", ROWS)])
    assert sweep.families == {"size": ["size_1", "size_100"], "pane": ["pane_1e-07", "pane_1e-06", "pane_1"]}
    assert sweep.count("failed") == 1 and sweep.count("limit", "cpu", "pane") == 2 and sweep.count("ok", "cuda") == 0
    (name, family, backend, cells, worst), = stress_sweep.limits(sweep)
    assert (name, family, backend, cells) == ("Contact shadows and thin panes", "pane", "cpu", ["pane_1e-07", "pane_1e-06"])
    assert worst == pytest.approx(0.4)


@pytest.mark.parametrize("rows,tail,message", [
    (ROWS, "size_3,size,3,bdpt,cp", "stress.csv:10: not as many cells"), (ROWS + ROWS[:1], "", "stress.csv:10: size_100 by bdpt on cpu is there twice"),
    ([row("size_1", verdict="fine")], "", "stress.csv:2: column 'verdict' holds 'fine'"), ([row("size_1", mean="much")], "", "column 'mean' holds 'much'"), ([], "", "no rows yet")])
def test_bad_input_is_named(tmp_path, rows, tail, message):
    with pytest.raises(InputError) as e:
        stress_sweep.load([sweep_of(tmp_path / "a", rows, tail)])
    assert message in str(e.value)


def test_backends_that_differ_are_found_and_those_that_do_not_are_not(tmp_path):
    rng = np.random.default_rng(5)
    rows = [row(f"size_{i}", backend=b, mean=1 + 0.001 * rng.normal()) for i in range(300) for b in ("cpu", "cuda")]
    sweep = stress_sweep.load([sweep_of(tmp_path / "a", rows)])
    assert len(stress_sweep.backend_differences(sweep)) == 300
    assert stress_sweep.disagreeing(stress_sweep.backend_differences(sweep)) == []
    rows[7]["mean"] += 0.02
    rows[9]["standard_error"] = rows[8]["standard_error"] = 0
    rows[9]["mean"] = rows[8]["mean"] * (1 + 1e-3)
    found = stress_sweep.disagreeing(stress_sweep.backend_differences(stress_sweep.load([sweep_of(tmp_path / "b", rows)])))
    assert sorted(cell for _, cell, *_ in found) == ["size_3", "size_4"]


def test_figures_tables_and_page(tmp_path, capsys):
    cuda = [r | {"backend": "cuda", "mean": r["mean"] * 1.0001} for r in ROWS]
    folders = [sweep_of(tmp_path / "a", ROWS), sweep_of(tmp_path / "b", cuda)]
    before = sweep_of(tmp_path / "c", [r | {"verdict": "failed"} for r in ROWS])
    out = tmp_path / "out"
    assert stress.main([*map(str, folders), "-o", str(out), "--before", str(before)]) == 0
    assert "16 rows: 2 failed, 2 invalid, 0 refused, 4 limit, 2 noisy, 4 ok, 2 left out; 4 figures" in capsys.readouterr().out
    for name in ("stress_states_1", "stress_z_1", "stress_variance_1", "stress_backends_1"):
        assert (out / f"{name}.png").stat().st_size > 1000 and (out / f"{name}.pdf").is_file()
    page = (out / "stress.html").read_text(encoding="utf-8")
    assert "&lt;why&gt;" in page and "<why>" not in page
    assert "Contact shadows and thin panes" in page and "0 differ at the level" in page and "8 → 1" in page and "http" not in page
    table = {(r["family"], r["backend"]): r for r in csv.DictReader((out / "stress_table.csv").read_text().splitlines())}
    assert table["all", "cpu"]["failed"] == "1" and table["pane", "cuda"]["limit"] == "2" and table["size", "cpu"]["cells"] == "2"
    assert len((out / "stress_backends.csv").read_text().splitlines()) == 8
    assert stress.main([str(tmp_path / "nothing"), "-o", str(out)]) == 3

"""Results as frames, and as one archive from which everything can be made again."""

import json
import zipfile

import pytest

from ambilux.analysis import __main__ as program
from ambilux.analysis import experiment, summary
from ambilux.analysis.tests import synthetic


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = synthetic.make(tmp_path_factory.mktemp("data") / "run", scenes=("box",), runs=(("nee", 0.7, 1.5), ("mis", 0.5, 2.0)), batches=16)
    synthetic.add_techniques(folder, "box", "mis", (1, 2))
    path = folder / "stats" / "box" / "mis_1.json"
    stats = json.loads(path.read_text())
    stats["stages"][0]["items_by_depth"] = [5, 3]
    stats["queues"] = [{"name": "rays", "capacity": 8, "peak": 6, "overflow": 0}]
    stats["selection"] = {"name": "b", "candidates": [{"name": "a", "variance": 2.0, "efficiency": 0.5}, {"name": "b", "variance": 1.0, "efficiency": 1.0}]}
    path.write_text(json.dumps(stats))
    return folder


def test_frames_hold_what_the_files_hold(folder):
    pytest.importorskip("pandas")
    from ambilux.analysis import frames
    runs = frames.runs(folder)
    assert len(runs) == 2 * 3 * 4 and set(runs.run) == {"nee", "mis"} and runs.relmse.min() > 0
    assert len(frames.batches(folder)) == 2 * 3 * 16
    table = frames.table(folder).set_index("run")
    assert table.ratio_batches["mis"] == pytest.approx(summary.lines(experiment.load(folder))[1].ratio.value)
    assert table.ratio_seeds_doubt["mis"] == "3 seeds"
    assert len(frames.stages(folder)) == 2 * 3 * len(synthetic.STAGES)
    assert list(frames.depths(folder)["items"]) == [5, 3] and list(frames.queues(folder).peak) == [6]
    selections = frames.selections(folder)
    assert list(selections.candidate) == ["a", "b"] and list(selections.chosen) == [False, True]
    assert set(frames.strategies(folder).columns) >= {"s", "t", "variance", "share"} and len(frames.strategies(folder)) == 8


def test_an_archive_makes_the_same_tables_again(folder, tmp_path, capsys):
    assert program.main(["pack", str(folder), "-o", str(tmp_path / "a.zip")]) == 0
    assert program.main(["pack", str(folder), "-o", str(tmp_path / "b.zip")]) == 0
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    with zipfile.ZipFile(tmp_path / "a.zip") as archive:
        archive.extractall(tmp_path / "there")
        contents = json.loads(archive.read("contents.json"))
    assert set(contents["files"]) | {"contents.json"} == {p.relative_to(tmp_path / "there").as_posix() for p in (tmp_path / "there").rglob("*") if p.is_file()}
    assert len(contents["references"]["box"]["sha256"]) == 64 and contents["commands"][0].startswith("ambilux experiment")
    a, b = (summary.lines(experiment.load(p)) for p in (folder, tmp_path / "there"))
    assert [x.efficiency for x in a] == [x.efficiency for x in b]
    assert program.main(["pack", str(folder), "-o", str(tmp_path / "small.zip"), "--no-images"]) == 0
    with zipfile.ZipFile(tmp_path / "small.zip") as archive:
        assert not any(name.endswith(".exr") for name in archive.namelist()) and "batches.csv" in archive.namelist()
    assert program.main(["pack", str(tmp_path), "-o", str(tmp_path / "c.zip")]) == 3
    assert "is no experiment folder" in capsys.readouterr().err


def test_references_are_found_where_results_went(tmp_path):
    """The runner states a reference outside of its folder by its place on the machine that made it."""
    folder = synthetic.make(tmp_path / "all" / "run", scenes=("box",), runs=(("nee", 0.7, 1.5), ("mis", 0.5, 2.0)))
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["scenes"][0]["reference"]["file"] = "/gone/references/box-abc.exr"
    (folder / "manifest.json").write_text(json.dumps(manifest))
    assert experiment.load(folder).reference("box") == folder / "references" / "box-abc.exr"
    (folder / "references").rename(tmp_path / "all" / "references")
    assert experiment.load(folder).reference("box") == (tmp_path / "all" / "references" / "box-abc.exr").resolve()
    assert program.main(["pack", str(folder), "-o", str(tmp_path / "all.zip")]) == 0
    with zipfile.ZipFile(tmp_path / "all.zip") as archive:
        assert "references/box-abc.exr" in archive.namelist()
        archive.extractall(tmp_path / "there")
    (tmp_path / "all" / "references" / "box-abc.exr").unlink()
    assert experiment.load(folder).reference("box") is None
    assert experiment.load(tmp_path / "there").reference("box") is not None


def test_selecting_a_method_counts_as_time_of_its_run(tmp_path):
    folder = synthetic.make(tmp_path / "run", scenes=("box",), runs=(("nee", 0.7, 1.5), ("auto", 0.5, 2.0)), batches=16)
    before = {line.run: line.efficiency_batches.value for line in summary.lines(experiment.load(folder))}
    for seed in (1, 2, 3):
        path = folder / "stats" / "box" / f"auto_{seed}.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | {"selection": {"name": "b", "seconds": 0.128, "candidates": []}}))
    after = {line.run: line.efficiency_batches.value for line in summary.lines(experiment.load(folder))}
    assert after["nee"] == before["nee"]
    assert after["auto"] == pytest.approx(before["auto"] / 2)  # 0.128 s beside 64 samples of 2 ms

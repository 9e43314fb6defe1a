"""A busy machine is noticed, a quiet one is not accused; what was made again is said."""

import json

from ambilux.analysis import experiment, fairness
from ambilux.analysis.tests import synthetic


def recorded(folder, others, mhz=lambda seed: 3000.0):
    for path in (folder / "stats" / "box").iterdir():
        stats, seed = json.loads(path.read_text()), int(path.stem.rsplit("_", 1)[1])
        stats["machine"] = [{"seconds": 1.0, "cores": 4, "other_cores": others(path.stem), "cpu_mhz": {"before": mhz(seed), "after": None}},
                            {"seconds": 3.0, "cores": 4, "other_cores": 0.0, "cpu_mhz": {"before": None, "after": mhz(seed)}}]
        path.write_text(json.dumps(stats))
    return experiment.load(folder)


def test_quiet_machines_get_no_remark(tmp_path):
    folder = synthetic.make(tmp_path / "r", scenes=("box",))
    (said,) = fairness.remarks(experiment.load(folder))
    assert said.startswith("the load of the machine was not recorded")
    assert list(fairness.remarks(recorded(folder, lambda name: 0.2))) == []


def test_busy_renders_slow_seeds_and_moving_clocks_are_named(tmp_path):
    folder = synthetic.make(tmp_path / "r", scenes=("box",))
    rows = [line.split(",") for line in (folder / "runs.csv").read_text().splitlines()]
    for cells in rows[1:]:
        if cells[1:3] == ["nee", "2"]:
            cells[9] = f"{2 * float(cells[9]):.9g}"
    (folder / "runs.csv").write_text("\n".join(map(",".join, rows)) + "\n")
    busy, spread, clocks = fairness.remarks(recorded(folder, lambda name: 4.0 if name == "nee_2" else 0.0, lambda seed: 3000.0 if seed < 3 else 2000.0))
    assert "during 1 renders" in busy and busy.endswith("box nee seed 2 (25 %)")
    assert spread.endswith("box nee 2.00") and "factor of 1.15" in spread
    assert "2000 MHz at" in clocks and "seed 3" in clocks and "3000 at" in clocks


def test_what_was_made_again_and_what_stayed_disturbed_is_said(tmp_path):
    folder = synthetic.make(tmp_path / "r", scenes=("box",))
    recorded(folder, lambda name: 0.2)
    path = folder / "stats" / "box" / "nee_2.json"
    stats = json.loads(path.read_text()) | {"attempts": [{"why": "other processes held 40 % of the cores", "seconds_per_sample": 1.0}]}
    stats["machine"][0]["gpu"] = {"slowdowns": ["thermal"]}
    path.write_text(json.dumps(stats))
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["disturbed"] = [{"scene": "box", "run": "nee", "seed": 2, "why": "a sample took 1.40 times as long as with another seed", "made": 2}]
    (folder / "manifest.json").write_text(json.dumps(manifest))
    left, held = fairness.remarks(experiment.load(folder))  # that it was made again does not help
    assert left.startswith("of 9 renders, 1 was disturbed and not repeated (repeats = 0);") and "1.40 times" in left
    assert held == "the device lowered its clocks (thermal) during box nee seed 2"
    manifest |= {"repeats": 1, "ranks_share": "ranks 0 and 1 on node share core 3"}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    shared, left, _ = fairness.remarks(experiment.load(folder))
    assert shared.startswith("ranks 0 and 1 on node share core 3: all times") and "1 was disturbed and not repeated; " in left
    del manifest["disturbed"]
    (folder / "manifest.json").write_text(json.dumps(manifest | {"ranks_share": None}))
    again, _ = fairness.remarks(experiment.load(folder))
    assert again.startswith("1 render was disturbed and repeated") and again.endswith("box nee seed 2 (other processes held 40 % of the cores)")

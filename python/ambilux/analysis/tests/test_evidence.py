"""Figures of the pages and what is stored of them; stages in parts; references that errors can be measured against."""

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from ambilux.analysis import experiment, summary
from ambilux.analysis.claims.run import Failed
from ambilux.analysis.evidence import __main__ as command
from ambilux.analysis.evidence import benches, collect, data, pages, run, stages
from ambilux.analysis.tests import synthetic

ROOT = Path(__file__).parents[4]
DOCS = ROOT / "docs"
MOST_BYTES = 5 << 20


# The pages of the project

def test_every_figure_of_the_pages_is_that_of_its_data():
    stored = data.read(DOCS / "data")
    differ = [name for name, text in pages.texts(ROOT, DOCS, stored).items() if text != (DOCS / name).read_text(encoding="utf-8")]
    assert differ == [], "scripts/evidence.sh page writes them anew"


def test_data_that_are_old_are_said_to_be_so():
    if not data.knows_history(ROOT):
        pytest.skip("no history")
    stated = {name for name, found in data.read(DOCS / "data").items() if found["source"]["old"]}
    old = {name for name, found in pages.refreshed(data.read(DOCS / "data"), ROOT).items() if found["source"]["old"]}
    assert old <= stated, "scripts/evidence.sh page says so"


def test_stored_data_are_small_and_no_small_run_passes_for_evidence():
    assert sum(file.stat().st_size for file in (DOCS / "data").iterdir()) < MOST_BYTES
    stored = data.read(DOCS / "data")
    assert set(stored) <= set(stages.BY_NAME)
    assert [name for name, found in stored.items() if found["source"]["quick"] and name != "claims"] == []
    assert all(f"**{verdict}**" not in json.dumps(stored["claims"]) for verdict in ("reproduced", "not")) or not stored["claims"]["source"]["quick"]


def test_one_revision_and_one_kind_of_card_unless_the_pages_say_otherwise():
    told = [(s["source"]["revision"], s["source"]["card"]) for name, s in data.read(DOCS / "data").items()
            if stages.BY_NAME[name].needs == stages.CUDA and not s["source"]["old"] and not s["source"]["quick"]]
    page = (DOCS / "performance.md").read_text(encoding="utf-8")
    assert all(f"| {revision} | {card} |" in page for revision, card in told)


@pytest.mark.parametrize("stage", stages.STAGES, ids=lambda s: s.name)
def test_every_stage_is_on_its_page_and_its_files_are_there(stage):
    page = (DOCS / stage.page).read_text(encoding="utf-8")
    shown = {name for of, name, _ in data.BLOCK.findall(page) if of == stage.name}
    assert f"# {stage.section}\n" in page
    if stage.experiment:
        assert shown >= set(stage.kinds), stage.name
        text = (ROOT / stage.experiment).read_text(encoding="utf-8")
        assert "[reduced]" in text and all(f'"{scene}"' in text for scene in (*stage.spread, *stage.pictures))
        assert shown <= {*stage.kinds, "references", "figures"}
    elif stage.name != "claims":
        assert shown and shown <= set(stage.tables([]))


def test_stages_of_benches_have_parts_and_make_their_tables(monkeypatch):
    monkeypatch.delenv("AMBILUX_DATA", raising=False)
    for stage in stages.STAGES:
        if stage.parts:
            place = stages.Place(("ambilux",), Path("out"), True, ROOT)
            parts = list(stage.parts(place))
            files = [p["file"] for p in parts]
            assert files and len(set(files)) == len(files), stage.name
            assert all(p["command"][0] in ("ambilux", "python3") for p in parts)


# Data and blocks

def test_cells_are_written_with_what_is_known_of_them():
    for cell, text in ((None, "–"), ("a", "a"), (3, "3"), (0.012345, "0.0123"), (-1.0, "−1.00"), ({"value": 2.0}, "2.00"),
                       ({"value": 2.0, "low": 1.9, "high": 2.1, "mark": " ="}, "2.00 [1.9, 2.1] ="), ({"value": 2.0, "doubt": "2 seeds"}, "2 seeds")):
        assert data.cell_text(cell) == text


STORED = {"source": {"revision": "0123456789", "card": "a card", "driver": "1", "date": "2026-01-01", "conditions": ["load 0"],
                     "commands": ["ambilux bench rays"], "missing": [], "quick": False, "old": ""},
          "blocks": {"t": {"columns": ["scene", "a"], "rows": [["box", 1.5], ["box", None]], "grouped": True}, "l": {"list": ["text"]}}}


def test_a_block_has_its_figures_and_a_caption():
    page = "before\n<!-- evidence: s/t -->\nold\n<!-- end -->\n<!-- evidence: s/l -->\n<!-- end -->\n<!-- evidence: away/t -->\n<!-- end -->\n"
    text = data.filled(page, {"s": json.loads(data.text_of(STORED))}, "page.md")
    assert "| box | 1.50 |\n|  | – |" in text and "- text\n" in text and "old" not in text
    assert "*Revision 0123456789, 2026-01-01; a card, driver 1, load 0. Made by `ambilux bench rays`.*" in text
    assert "Not measured yet" in text and data.filled(text, {"s": STORED}, "page.md") == text
    old = STORED | {"source": STORED["source"] | {"old": "older than it should be", "quick": True}}
    assert "**Old data**, older than it should be. **A small run, no evidence.** Revision" in data.filled(page, {"s": old}, "page.md")
    with pytest.raises(experiment.InputError, match=r"there is no t in docs/data/s\.json"):
        data.filled(page, {"s": STORED | {"blocks": {}}}, "page.md")


def test_a_changed_figure_is_found():
    stored = data.read(DOCS / "data")
    name, found = next((n, s) for n, s in stored.items() if "table" in s["blocks"])
    found["blocks"]["table"]["rows"][0][2] = "12345678"
    page = stages.BY_NAME[name].page
    assert pages.texts(ROOT, DOCS, stored)[page] != (DOCS / page).read_text(encoding="utf-8")


def test_one_sample_has_a_row_for_each_method():
    found = {"frames_per_second": 226.2, "percentile_95_seconds": 0.00481, "memory_bytes_peak": 498 << 20}
    results = [{"kind": "frames", "scene": "box", "key": method, "json": found} for method in ("path", "streaming")]
    lines = data.block_lines(benches.frames_tables(results)["frames"])
    assert lines[2:] == ["| box | path | 226 | 4.8 | 498 |", "|  | streaming | 226 | 4.8 | 498 |"]


def test_age_counts_commits_of_device_code(tmp_path):
    def git(*words):
        subprocess.run(["git", "-C", tmp_path, "-c", "user.name=a", "-c", "user.email=a@b", *words], check=True, capture_output=True)
    git("init", "-q")
    git("commit", "-q", "--allow-empty", "-m", "first")
    first = subprocess.run(["git", "-C", tmp_path, "rev-parse", "HEAD"], check=True, capture_output=True, text=True).stdout.strip()
    (tmp_path / "stages").mkdir()
    for i in range(data.OLD + 1):
        assert data.age(first, tmp_path) == ""
        (tmp_path / "stages" / "a").write_text(str(i))
        git("add", "-A")
        git("commit", "-q", "-m", str(i))
    assert data.age(first, tmp_path) == "more than 50 commits of device code behind"
    assert data.age("0" * 12, tmp_path) == "of a revision that this repository does not have"
    assert data.age("unknown", tmp_path) == "of a revision that was not recorded"


# References

def made(tmp_path, noise, **changes):
    folder = synthetic.make(tmp_path / f"e{noise}", scenes=("box",), runs=(("a", 0.5, 1.0), ("b", 1.0, 1.0)), seconds=(0.05, 0.2), reference_noise=0, outliers=1.1)
    results = experiment.load(folder)
    rows = [replace(r, relmse=r.relmse_corrected + noise * r.relmse_corrected, **changes) for r in results.rows]
    results.manifest["scenes"][0]["reference"] = {"spp": 10**9}
    return replace(results, rows=rows, kept={})


STAGE = stages.Stage("s", "results.md", 1, "Results", kinds=("table", "further", "errors", "ratios", "samples", "switches"))


def test_errors_are_shown_where_the_reference_is_ten_times_better(tmp_path, monkeypatch):
    good = made(tmp_path, 0.01)
    share = collect.noise_share(good, "box")
    assert 0 < share < collect.NOISE and collect.unfit(good, "box", STAGE) == ""
    assert next(collect.references(good, STAGE)).startswith("box: reference of 1000000000 samples")
    table = collect.blocks(good, STAGE, [])["table"]
    assert table["columns"] == list(collect.LEADING) and "MAPE" not in json.dumps(table) and table["rows"][0][3]["value"] > 0
    noisy = made(tmp_path, 1.0)
    assert "more than 0.1" in collect.unfit(noisy, "box", STAGE)
    assert all(row[3] is None and row[5] is None for row in collect.blocks(noisy, STAGE, [])["table"]["rows"])
    good.manifest["scenes"][0]["reference"]["spp"] = 1
    assert collect.unfit(good, "box", STAGE) == ""  # few samples, of a method with less noise
    monkeypatch.setattr(collect, "reference_variance", lambda *_: math.inf)
    assert "its reference has 1 samples" in collect.unfit(good, "box", STAGE)


def test_without_a_reference_the_spread_over_seeds_stands_for_errors(tmp_path):
    results = made(tmp_path, 0.01)
    stage = replace(STAGE, spread=("box",))
    spread = [{"scene": "box", "run": "a", "seeds": 3, "relmse": 0.25, "rmse": 0.5}]
    blocks = collect.blocks(results, stage, spread)
    assert [row[1] for row in blocks["errors"]["rows"]] == ["(0.250)", None]
    assert "no method gives a converged reference" in blocks["references"]["list"][0]
    assert all(c is None for row in blocks["ratios"]["rows"] for c in row[1:])
    assert all(math.isfinite(x.relmse.value) for x in summary.lines(results))


# Running

PROGRAM = """import sys, json, pathlib
w = sys.argv[1:]
log = pathlib.Path(r"{log}")
log.write_text(log.read_text() + " ".join(w) + chr(10) if log.exists() else " ".join(w) + chr(10))
if w == ["--version"]: print("ambilux 0.1.0 ({revision})")
elif w[0] == "fail": sys.exit("error: no such thing")
else: print(json.dumps({{"rows": [], "queues": 1}}))
"""


@pytest.fixture
def place(tmp_path):
    def made(revision="abc1234"):
        program = tmp_path / "program.py"
        program.write_text(PROGRAM.format(log=tmp_path / "log", revision=revision))
        return stages.Place((sys.executable, str(program)), tmp_path / "out", True, tmp_path)
    return made


def bench_stage(*names):
    parts = [benches.part("k", "box", name, ["ambilux", name, "OUT/x"]) for name in names]
    return stages.Stage("rays", "p.md", 1, "Rays", parts=lambda place: parts, tables=lambda results: {"k": benches.by_scene(results, "k", names, lambda of: [len(of(n) or []) for n in names])})


def test_a_stage_goes_on_where_it_stopped_and_says_what_failed(tmp_path, place):
    clock = run.Clock()
    found = run.run(place(), bench_stage("one", "fail"), clock)
    assert found["state"] == "done" and found["revision"] == "abc1234" and found["missing"] == ["box, fail: error: no such thing"]
    assert found["commands"][0] == "ambilux one out/rays/x" and found["start"]["load"] >= 0
    run.run(place(), bench_stage("one", "two"), clock)
    log = (tmp_path / "log").read_text().splitlines()
    assert log.count("one out/rays/x") == 1 and log.count("two out/rays/x") == 1
    assert json.loads((tmp_path / "out/rays/k_box_one.json").read_text()) == {"kind": "k", "scene": "box", "key": "one", "json": {"rows": []}}


def test_no_table_is_of_two_machines_and_no_folder_of_two_revisions(tmp_path, place):
    stage, file = bench_stage("one"), tmp_path / "out/rays/stage.json"
    run.run(place(), stage, run.Clock())
    other = json.loads(file.read_text()) | {"machine": "elsewhere", "state": "begun"}
    file.write_text(json.dumps(other))
    run.run(place(), stage, run.Clock())
    assert (tmp_path / "log").read_text().splitlines().count("one out/rays/x") == 2
    assert json.loads(file.read_text())["machine"] != "elsewhere"
    with pytest.raises(Failed, match="of revision abc1234, this is fff0000"):
        run.run(place("fff0000"), stage, run.Clock())


def test_a_stage_ends_in_time(tmp_path, place):
    found = run.run(place(), bench_stage("one"), run.Clock(run.LEAST / 2))
    assert found["state"] == "begun" and not (tmp_path / "out/rays/k_box_one.json").exists()
    with pytest.raises(run.OutOfTime):
        run.called([sys.executable, "-c", "import time; time.sleep(30)"], run.Clock(run.GRACE + 1))


def test_what_pages_need_is_packed_and_nothing_else(tmp_path, capsys):
    files = {"rays/stage.json": 1, "results/results/runs.csv": 1, "results/results/images/glass/path_1.exr": 1, "results/results/images/glass/path_2.exr": 0,
             "results/results/images/cornell/path_1.exr": 0, "references/glass_1.exr": 1, "references/lights_1.exr": 0, "results/results/state/x.json": 0,
             "claims/results/vcm/images/mirror-caustic/vcm_1.exr": 1, "claims/results/vcm/images/bulb/vcm_1.exr": 0, "peers/results/images/glass/path_1.exr": 0}
    for name in files:
        (tmp_path / "out" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "out" / name).write_text("x")
    assert command.main(["pack", "-o", str(tmp_path / "out"), "--target", str(tmp_path)]) == 0
    listed = subprocess.run(["tar", "-tzf", str(tmp_path / "evidence-1.tar.gz")], check=True, capture_output=True, text=True).stdout.split()
    assert sorted(listed) == sorted(name for name, kept in files.items() if kept)
    assert "evidence-1.tar.gz: 5 files" in capsys.readouterr().out


def test_a_floor_is_the_time_of_all_rays():
    found = {"bounce 1": 100, "bounce 3": 100, "to emitters": 50, "shadow": 200}
    render = {"rays": {"extend": 1e8, "occlude": 1e8}}
    assert benches.floor(render, found, False) == pytest.approx(1 + 2)
    assert benches.floor(render, found, True) == pytest.approx(1 + 1 + 0.25)

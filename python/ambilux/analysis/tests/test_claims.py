"""Claims of papers: files that are complete, verdicts on experiments of known errors, the page."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from ambilux.analysis import experiment
from ambilux.analysis.claims import evaluate, page, registry, run
from ambilux.analysis.experiment import InputError
from ambilux.analysis.tests import synthetic

ROOT = Path(__file__).parents[4]
PROJECT = ROOT / "experiments" / "claims"
CONFIG = '[[scene]]\nname = "box"\n[[scene]]\nname = "away"\n[[run]]\nname = "a"\n[[run]]\nname = "b"\n'
CLAIM = '''title = "A over b"
paper = "Somebody 2020, A Paper"
doi = "10.1000/1"
where = "table 1"
states = "A is better."
kind = "KIND"
picture = "box"
differs = ["The scene."]
[[compare]]
scene = "box"
run = "a"
over = "b"
'''
STATUS = run.NOTHING | {"state": "run", "device": True, "commands": ["ambilux experiment c.toml"]}


def write_claim(folder, text=CLAIM, kind="ranking at equal time", more=""):
    folder.mkdir(exist_ok=True)
    (folder / "c.toml").write_text(CONFIG)
    (folder / "c.claim.toml").write_text(text.replace("KIND", kind) + more)
    return folder


def outcome_of(tmp_path, a=(0.5, 1.0), kind="ranking at equal time", more="", error="mse", **status):
    """Of a claim with runs a (its error of one sample and milliseconds) and b (1, 1)."""
    (claim,) = registry.load(write_claim(tmp_path / "claims", f'error = "{error}"\n' + CLAIM, kind, more))
    out = tmp_path / "out"
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    synthetic.make(out / "c", scenes=("box",), runs=(("a", *a), ("b", 1.0, 1.0)), seconds=(0.05, 0.2),
                   reference_noise=0, outliers=1.1)
    run.status_file(out, claim).write_text(json.dumps(STATUS | status))
    return evaluate.outcome(claim, out)


def page_of(outcome, images, root):
    return page.markdown([outcome.claim], {outcome.claim.name: page.stored(outcome, images)}, images, root)


def test_the_projects_claims_are_complete():
    claims = registry.load(PROJECT)
    assert len(claims) >= 12 and len({c.title for c in claims}) == len(claims)
    for claim in claims:
        assert claim.doi or "Journal" in claim.paper, claim.name
        # What differs names scene, roulette or next events, and each has a scene of the project's own.
        assert len(claim.differs) >= 3 and claim.states.endswith("."), claim.name
        own = [p for p in claim.bench.scenes.values()] if claim.bench else claim.experiment.read_text().split("path = ")
        assert any("../../scenes/" in p or "../../out/" in p for p in own), claim.name
        assert claim.bench or "[reduced]" in claim.experiment.read_text(), claim.name
    used = {c.experiment for c in claims if c.experiment}
    assert used == {f for f in PROJECT.glob("*.toml") if not f.name.endswith(registry.ENDING)}


@pytest.mark.parametrize(("old", "new", "message"), [
    ('title = "A over b"\n', "", "lacks the key 'title'"),
    ("where", "were", "unknown key 'were'"),
    ("KIND", "rumour", "kind 'rumour' is none of ratio at equal time"),
    ('run = "a"', 'run = "c"', "run 'c' is none of a, b"),
    ('scene = "box"', 'scene = "sky"', "scene 'sky' is none of box, away"),
    ('over = "b"', 'over = "b"\npublished = 2', "a ranking has none"),
    ('over = "b"', 'over = "b"\nbatch = "primary"', "belongs to one"),
    ('["The scene."]', "[]", "'differs' must list texts"),
    ('picture = "box"', "picture = 1", "'picture' must be a text"),
    ("[[compare]]", "[[compare", "c.claim.toml: "),
    ('doi = "10.1000/1"', 'experiment = "d.toml"', "d.toml: cannot be read"),
])
def test_what_is_wrong_is_named(tmp_path, old, new, message):
    assert old in CLAIM
    text = CLAIM.replace(old, new).replace("KIND", "ranking at equal time")
    with pytest.raises(InputError) as e:
        registry.load(write_claim(tmp_path / "claims", text))
    assert message in str(e.value) and str(tmp_path) in str(e.value)


def test_the_interval_decides(tmp_path):
    # Errors are roots: half the error in the same time is four times the efficiency.
    won = outcome_of(tmp_path)
    assert won.verdict == "reproduced" and won.evidence
    j = won.found[0].measures["at equal time"]
    assert j.low < 4 < j.high and won.found[0].measures["at equal samples"].value == pytest.approx(4, rel=0.2)
    assert outcome_of(tmp_path, a=(2.0, 1.0)).verdict == "not"
    assert outcome_of(tmp_path, a=(1.0, 1.0)).verdict == "undecided"
    # At three times the time of a sample.
    slow = (0.8, 3.0)
    assert outcome_of(tmp_path, a=slow).verdict == "not"
    assert outcome_of(tmp_path, a=slow, kind="ranking at equal samples").verdict == "reproduced"
    assert outcome_of(tmp_path, a=(1.02, 1.0), more="above = 0.5\n").verdict == "reproduced"


def test_a_published_value_decides_between_whole_and_part(tmp_path):
    for published, verdict in (("2", "reproduced"), ("[3, 9]", "reproduced"), ("40", "in part")):
        assert outcome_of(tmp_path, kind="ratio at equal time", more=f"published = {published}\n").verdict == verdict
    root = outcome_of(tmp_path, kind="ratio at equal time", more="published = 2\n", error="rmse")
    assert root.found[0].measures["at equal time"].value == pytest.approx(2, rel=0.2)


def test_batches_say_nothing_of_a_biased_run(tmp_path):
    folder = synthetic.make(tmp_path / "c", scenes=("box",), runs=(("a", 0.5, 1.0), ("b", 1.0, 1.0)), seconds=(0.05, 0.2),
                            reference_noise=0, outliers=1.1, batches=16)
    data = experiment.load(folder)
    measured = [evaluate.equal_time, evaluate.equal_samples]
    assert [f(data, "box", ("a", "b")).over for f in measured] == ["batches", "batches"]
    rows = [replace(r, stated_bias="a radius") if r.run == "b" else r for r in data.rows]
    biased = replace(data, rows=rows, kept={})
    assert [f(biased, "box", ("a", "b")).over for f in measured] == ["seeds", "seeds"]


def test_comparisons_that_disagree_and_scenes_that_are_away(tmp_path):
    more = '[[compare]]\nscene = "box"\nrun = "b"\nover = "a"\n[[compare]]\nscene = "away"\nrun = "a"\nover = "b"\n'
    o = outcome_of(tmp_path, more=more)
    assert [f.says for f in o.found] == ["reproduced", "not"] and o.verdict == "in part"
    assert o.why == "of 2 comparisons 1 reproduced, 1 not" and o.left_out == ("away",)


def test_what_did_not_run_is_not_left_out(tmp_path):
    o = outcome_of(tmp_path, state="dry run")
    assert o.verdict == "not run" and "needs a device" in o.why and not o.evidence
    assert "failed: no memory" in outcome_of(tmp_path, state="failed", message="no memory").why
    (claim,) = registry.load(write_claim(tmp_path / "claims"))
    nothing = evaluate.outcome(claim, tmp_path / "nothing")
    assert nothing.why == "nothing was run yet"
    assert "How it is run:\n\n- In one command: `scripts/claims.sh --only c --claims claims`" in page_of(nothing, tmp_path, tmp_path)
    said = evaluate.counted([o.verdict, outcome_of(tmp_path).verdict])
    assert said == "2 claims: 1 reproduced, 0 in part, 0 not, 0 undecided, 1 not run"


def test_rates_over_turns(tmp_path):
    bench = '''[bench]
turns = 3
scenes = { box = "box.xml", away = "$NOWHERE/scene.xml" }
[bench.runs]
a = { arguments = ["--backend", "x"], kernel = "fast" }
b = { arguments = ["--backend", "x"], kernel = "slow" }
'''
    text = CLAIM.replace("[[compare]]", bench + "[[compare]]")
    folder = write_claim(tmp_path / "claims", text, "ratio of rates", 'batch = "bounce 1"\npublished = [1.9, 2.1]\n')
    (folder / "box.xml").write_text("<scene/>")
    (claim,) = registry.load(folder)
    out = tmp_path / "out"
    out.mkdir()
    place = run.Place(("ambilux",), out, False)
    asked = list(run.benches(claim, place))
    assert len(asked) == 3 and registry.scene_path(claim, "away") is None and asked[0][1][:2] == ["bench", "rays"]
    for turn, (file, _) in enumerate(asked):
        file.parent.mkdir(exist_ok=True)
        rows = [{"batch": "bounce 1", "kernel": k, "mrays_per_s": r} for k, r in (("fast", 200 + turn), ("slow", 100))]
        file.write_text(json.dumps({"device": "a card", "repetitions": 25, "rows": rows}))
    run.status_file(out, claim).write_text(json.dumps(STATUS))
    o = evaluate.outcome(claim, out)
    assert o.verdict == "reproduced" and o.found[0].measures["of rates"].value == pytest.approx(2.01, rel=0.01)
    text = page_of(o, out / "images", out)
    assert "Device: a card; medians of 25 launches, 3 turns" in text
    assert "| box, bounce 1 | a over b | 1.90 to 2.10 | 2.01" in text
    assert run.commands(claim, place)[0].startswith("ambilux bench rays ")


def test_the_page_says_what_is_evidence(tmp_path):
    more = '[[compare]]\nscene = "away"\nrun = "a"\nover = "b"\n'
    text = page_of(outcome_of(tmp_path, more=more), tmp_path / "images" / "claims", tmp_path)
    for part in ("| [A over b](#a-over-b) | Somebody 2020 | ranking at equal time | **reproduced** |  |", "doi:10.1000/1",
                 "Claim (table 1): *A is better.*", "Verdict: **reproduced** (", "not found, left out: away.", "- Seeds: 1–3",
                 "![A over b: box](images/claims/c.png)", "- Revision: ambilux 0.1.0, git 0123456", "- The scene.",
                 "- Command: `ambilux experiment c.toml`"):
        assert part in text, part
    assert (tmp_path / "images" / "claims" / "c.png").stat().st_size > 1000
    small = page_of(outcome_of(tmp_path, small=True), tmp_path / "none", tmp_path)
    assert "not run on a device; a small run says: reproduced" in small and "| not run on a device | reproduced |" in small
    assert "Verdict: **" not in small and not (tmp_path / "none").exists()


def test_scenes_that_are_newer_than_the_data_are_named(tmp_path):
    o = outcome_of(tmp_path)
    stored = page.stored(o, tmp_path)
    (later,) = registry.load(write_claim(tmp_path / "claims", more='[[compare]]\nscene = "away"\nrun = "a"\nover = "b"\n'))
    assert page.newer_scenes(later, stored) == ["away"] and page.newer_scenes(o.claim, stored) == []


def test_the_projects_page_names_every_claim():
    text = (ROOT / "docs" / "claims.md").read_text(encoding="utf-8")
    assert [c.title for c in registry.load(PROJECT) if f"## {c.title}\n" not in text] == []

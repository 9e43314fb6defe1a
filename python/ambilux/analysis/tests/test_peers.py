"""Other renderers in the report: who agrees, who does not, who is not there."""

import json

import pytest

from ambilux.analysis import experiment, peers, remarks, summary
from ambilux.analysis.tests import synthetic

AGREES = {"scene": "box", "run": "mis", "renderer": "mitsuba", "state": "agrees", "version": "mitsuba 3.9.1", "reason": None, "load_seconds": 0.3, "compile_seconds": 1.5,
          "changes": ["filter tent is box"], "differences": ["roulette begins one segment later"],
          "agreement": {"pass": True, "samples": 512, "p": 0.7, "relative_difference": 0.0004, "detectable": 0.007, "worst": {"z": 3.0, "x": 32, "y": 8}}}
DIFFERS = {**AGREES, "run": "other", "state": "differs", "agreement": {**AGREES["agreement"], "p": 1e-26, "worst": {"z": 11.2, "x": 40, "y": 16}}}
MISSING = {"scene": "box", "run": "gpu", "renderer": "mitsuba", "state": "missing", "reason": "mitsuba cannot be imported"}


def load(tmp_path, entries):
    folder = synthetic.make(tmp_path / "run", scenes=("box",))
    (folder / "peers.json").write_text(json.dumps(entries))
    return experiment.load(folder)


def test_remarks_name_who_is_not_timed_and_why(tmp_path):
    data = load(tmp_path, [AGREES, DIFFERS, MISSING])
    told = "\n".join(remarks.remarks(data, summary.lines(data)))
    assert "box, other: its image does not agree with the reference (mean +0.04 %, worst block z = 11.2 at 40,16)" in told
    assert "gpu: not installed on box (mitsuba cannot be imported)" in told
    assert "mis: roulette begins one segment later" in told
    assert peers.is_left_out(data, "box", "other") and not peers.is_left_out(data, "box", "mis")


def test_the_table_states_agreement_changes_and_times(tmp_path):
    table = peers.to_html(load(tmp_path, [AGREES, MISSING]))
    for text in ("mitsuba 3.9.1", "filter tent is box", "1.50", "0.7 %", "not installed", "<td>0.7</td>"):
        assert text in table


def test_what_agrees_says_whether_it_was_shown(tmp_path):
    shown = {**AGREES["agreement"], "pass": False, "equivalent": True, "level": 0.05, "mean_bound": 0.0004, "block_bound": 0.0051}
    table = peers.to_html(load(tmp_path, [{**AGREES, "agreement": shown}]))
    assert "equivalent (level 0.05)" in table and "0.04 % and 0.51 %" in table
    noisy = {**AGREES, "agreement": {**shown, "pass": True, "equivalent": False, "mean_bound": 0.32, "with_own_path": True}}
    assert peers.verdict(noisy) == "no difference found to our path tracer"


def test_a_folder_without_other_renderers_says_nothing(tmp_path):
    data = experiment.load(synthetic.make(tmp_path / "run", scenes=("box",)))
    assert peers.entries(data) == [] and list(peers.remarks(data)) == []


@pytest.mark.parametrize("entries", [{}, [1], [{"scene": "box"}], [{**AGREES, "state": "fine"}]])
def test_a_damaged_file_is_refused(tmp_path, entries):
    with pytest.raises(experiment.InputError):
        peers.entries(load(tmp_path, entries))


def test_lost_renders_are_said_with_their_reason(tmp_path):
    data = load(tmp_path, [{**AGREES, "lost": [{"seed": 1, "reason": "no file a_1.exr"}, {"seed": 3, "reason": "no file a_1.exr"}]}])
    assert any(said.endswith("seeds 1, 3 left out (no file a_1.exr)") for said in peers.remarks(data))

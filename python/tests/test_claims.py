"""Claims of papers by the program: the tutorial's two files, and what the project's experiments ask for."""

import re
import shutil
import sys
from pathlib import Path

import pytest

import ambilux

ROOT = Path(__file__).parents[2]
PROGRAM = f"{sys.executable} -m ambilux.cli"


def test_the_tutorials_claim_runs_small(tmp_path, capsys, monkeypatch):
    pytest.importorskip("scipy")
    from ambilux.analysis.claims.__main__ import main

    monkeypatch.chdir(tmp_path)
    tutorial = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
    folder = tmp_path / "my_claims"
    folder.mkdir()
    shutil.copy(ROOT / "scenes" / "cornell.xml", folder / "scene.xml")
    for name in ("next_event.toml", "next_event.claim.toml"):
        (text,) = re.findall(rf"`my_claims/{name}`:\n\n```toml\n(.*?)```", tutorial, re.DOTALL)
        (folder / name).write_text(text)
    asked = ["--quick", "--claims", str(folder), "-o", "out", "--program", PROGRAM]
    assert main(["run", *asked]) == 0, capsys.readouterr().out
    assert main(["page", *asked]) == 0
    said = capsys.readouterr().out.splitlines()[-1]
    assert said.startswith("1 claims: ") and said.endswith("by small runs, which are no evidence")
    text = (tmp_path / "out" / "claims.md").read_text(encoding="utf-8")
    assert "## Next events over hits of emitters" in text and "| mine | ours over hits | 2.00 |" in text
    # What is complete stays.
    assert main(["run", *asked]) == 0


def test_a_program_that_is_not_there_is_named(tmp_path, capsys):
    from ambilux.analysis.claims.__main__ import main

    assert main(["run", "--claims", str(ROOT / "experiments" / "claims"), "-o", str(tmp_path), "--program", "nothing"]) == 3
    assert "nothing: No such file" in capsys.readouterr().err


def test_the_projects_experiments_name_what_exists(tmp_path):
    """Methods and settings of each run, on a scene that all of them take."""
    from ambilux.analysis.claims import registry

    import tomllib

    scene = ambilux.load(ROOT / "scenes" / "lights.xml", size=(16, 12))
    files = {claim.experiment for claim in registry.load(ROOT / "experiments" / "claims") if claim.experiment}
    for file in sorted(files):
        for run in tomllib.loads(file.read_text())["run"]:
            keys = {key: run[key] for key in ("estimator",) if key in run}
            settings = {**run.get("set", {}), **keys}
            ambilux.info(scene, run["integrator"], run.get("variant"), backend="cpu", settings=settings)

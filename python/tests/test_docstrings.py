"""Examples in docstrings and in docs/python.md give what they say."""

import doctest
import importlib
import re
from pathlib import Path

import ambilux
import numpy
import pytest
from conftest import SCENES

MODULES = ("ambilux", "ambilux.scene", "ambilux.image", "ambilux.rendering", "ambilux.records", "ambilux.commands")


def names(scene, out):
    return {"ambilux": ambilux, "numpy": numpy, "SCENES": SCENES, "OUT": out, "scene": scene}


@pytest.mark.parametrize("name", MODULES)
def test_examples_of(name, scene, tmp_path):
    module = importlib.import_module(name)
    tests = doctest.DocTestFinder(exclude_empty=True).find(module, name, extraglobs=names(scene, tmp_path))
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    for test in tests:
        runner.run(test)
    assert runner.tries > 0 and runner.failures == 0


def test_examples_of_the_page(scene, tmp_path, monkeypatch):
    page = Path(__file__).parents[2] / "docs" / "python.md"
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenes").symlink_to(SCENES)
    (tmp_path / "experiments").symlink_to(SCENES.parent / "experiments")
    result = doctest.testfile(str(page), module_relative=False, optionflags=doctest.ELLIPSIS)
    assert result.attempted > 5 and result.failed == 0


def test_everything_public_has_a_docstring():
    for name in set(ambilux.__all__) - {"__version__", "git_revision"}:
        assert getattr(ambilux, name).__doc__, name


def test_the_experiment_of_the_first_page_is_one(tmp_path):
    [text] = re.findall(r"```toml\n(.*?)```", (SCENES.parent / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "mine.toml").write_text(text)
    (tmp_path / "my_scene.xml").write_bytes((SCENES / "cornell.xml").read_bytes())
    assert len(text.splitlines()) == 12
    assert "mine" in ambilux.experiment(tmp_path / "mine.toml", dry_run=True)

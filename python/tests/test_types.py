"""Types of the package, and of programs that use it, by mypy."""

import os
import subprocess
import sys
from pathlib import Path

import ambilux
import pytest

PACKAGE = Path(ambilux.__file__).parent
ROOT = Path(__file__).parents[2]

USE = """
import ambilux
import numpy as np

scene = ambilux.load("a.xml", size=(4, 4)).with_params({"red.reflectance": np.ones(3)}).with_camera(origin=[0, 0, 3])
image = ambilux.render(scene, "bdpt", spp=4, aovs=["depth"], outliers=1)
depth: np.ndarray = image.aovs["depth"]
seconds: float = image.stats.seconds.render
total: list[float] = image.outliers[0].trace().total
error: float | None = ambilux.compare(image, "a.exr")["rmse"]
"""
MISUSE = """
import ambilux

ambilux.render("a.xml", spp="4")
ambilux.load("a.xml").hash = ""
image: int = ambilux.read("a.exr")
"""


def mypy(tmp_path, *paths):
    pytest.importorskip("mypy", reason="mypy is not installed")
    if not (PACKAGE / "_core.pyi").exists():
        pytest.skip("the stub of the compiled module is not built (target ambilux_python_stub)")
    return subprocess.run([sys.executable, "-m", "mypy", "--config-file", ROOT / "pyproject.toml", "--cache-dir", tmp_path, *paths], capture_output=True, text=True,
                          timeout=300, env={**os.environ, "MYPYPATH": str(PACKAGE.parent)})


def test_types_agree_and_misuse_is_found(tmp_path):
    (tmp_path / "use.py").write_text(USE)
    (tmp_path / "misuse.py").write_text(MISUSE)
    done = mypy(tmp_path / "cache", tmp_path / "use.py", tmp_path / "misuse.py", *sorted(PACKAGE.glob("*.py*")))
    wrong = [line for line in done.stdout.splitlines() if ": error: " in line]
    assert not [line for line in wrong if "misuse.py" not in line], done.stdout + done.stderr
    assert [int(line.split("misuse.py:")[1].split(":")[0]) for line in wrong] == [4, 5, 6], done.stdout

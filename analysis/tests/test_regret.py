"""What a run that selects loses beside the best of the others, on experiments of known errors."""

import math
import sys

import pytest

from analysis import experiment, regret
from analysis.tests import synthetic

RUNS = (("auto", 0.6, 1.1), ("path", 1.0, 1.0), ("bdpt", 0.5, 2.0))


def load(tmp_path, **kwargs):
    return experiment.load(synthetic.make(tmp_path / "r", runs=RUNS, seconds=(0.05, 0.2), spread=0, reference_noise=0, outliers=4.0, **kwargs))


def test_regret_is_the_ratio_of_products_of_error_and_time(tmp_path):
    data = load(tmp_path)
    r = regret.of_scene(data, "box", "auto")
    # Errors are roots of relMSE, which falls as one over samples: products of errors squared and time of a sample.
    expected = 0.6**2 * 1.1 / min(1.0**2 * 1.0, 0.5**2 * 2.0)
    assert r.best == "bdpt" and r.untrimmed.value == pytest.approx(expected, rel=0.02) and r.trimmed == pytest.approx(expected, rel=0.02)
    assert regret.of_scene(data, "glass", "auto").scene == "glass"


def test_table_has_a_row_for_each_scene_and_their_geometric_mean(tmp_path, monkeypatch, capsys):
    data = load(tmp_path)
    lines = regret.markdown(data, "auto")
    assert len(lines) == 2 + 2 + 1 and lines[2].startswith("| box |") and lines[-1].startswith("| geometric mean of 2 |")
    monkeypatch.setattr(sys, "argv", ["regret", str(data.folder)])
    assert regret.main() == 0 and capsys.readouterr().out.splitlines() == lines
    monkeypatch.setattr(sys, "argv", ["regret", str(data.folder), "--run", "automatic"])
    assert regret.main() == 3 and "no such run" in capsys.readouterr().err


def test_errors_below_the_noise_of_the_reference_decide_nothing():
    assert regret.product([], "trimmed_error") == math.inf
    assert regret.geometric_mean([0.5, 2.0, math.inf, math.nan]) == pytest.approx(1)

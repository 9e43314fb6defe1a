"""Kernels of a peer: built by a program of its own, within a limit, with a word for who waits; and PATHOCL where there is a device."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
PEERS = ROOT / "scripts" / "peers"
sys.path.insert(0, str(PEERS))
import kernel_build  # noqa: E402
from peer_protocol import Refused  # noqa: E402


def build(text, limit=20.0, every=10.0):
    return kernel_build.run([sys.executable, "-u", "-c", text], limit, "it builds kernels", every)


def test_a_build_is_timed_and_its_log_is_kept_with_times(capsys):
    assert 0 < build("print('compiling kernels'); print('done', end='')") < 20
    err = capsys.readouterr().err
    assert "s] compiling kernels\n" in err and "s] done\n" in err


def test_a_build_beyond_its_limit_is_ended_and_its_last_lines_are_the_reason(capsys):
    begin = time.monotonic()
    with pytest.raises(Refused, match=r"it builds kernels: not done after 3 s; the last lines of its log: two \| three \| four$"):
        build("import time\nfor w in ('one', 'two', 'three', 'four'): print(w)\ntime.sleep(60)", 3.0, 0.5)
    assert time.monotonic() - begin < 30
    assert "it builds kernels, 1 s of at most 3 s" in capsys.readouterr().err


def test_a_build_that_closes_its_output_and_does_not_end_is_ended():
    with pytest.raises(Refused, match="not done after 2 s"):
        build("import os, time\nos.close(1); os.close(2)\ntime.sleep(60)", 2.0)


def test_a_build_that_fails_says_how():
    with pytest.raises(Refused, match="ended with status 3; the last lines of its log: no libnvrtc"):
        build("import sys; sys.exit(print('no libnvrtc') or 3)")
    with pytest.raises(Refused, match="ended with signal SIGABRT"):
        build("import os; os.abort()")


def lines_of(process):
    for line in process.stdout:
        yield json.loads(line)


def test_pathocl_renders_where_there_is_a_device(tmp_path):
    """Two passes; minutes where LuxCore's kernels are not in its cache."""
    python = os.environ.get("AMBILUX_PEERS_PYTHON")
    if not python:
        pytest.skip("AMBILUX_PEERS_PYTHON names no Python with pyluxcore")
    job = {"scene": str(ROOT / "scenes/cornell.xml"), "parameters": {}, "film": [32, 32], "crop": [0, 0, 32, 32], "max_depth": 60, "rr_depth": 5,
           "integrator": "PATHOCL", "folder": str(tmp_path)}
    (tmp_path / "job.json").write_text(json.dumps(job))
    with open(tmp_path / "log.txt", "w") as log:
        peer = subprocess.Popen([python, "-u", str(PEERS / "peer_luxcore.py"), str(tmp_path / "job.json")], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, text=True)
    try:
        answers = lines_of(peer)
        first = next(a for a in answers if "progress" not in a)
        if "missing" in first:
            pytest.skip(first["missing"])
        ready = first["ready"]
        assert ready["compile_seconds"] > 0 and ready["backend"] in ("cuda", "opencl")
        means = []
        for seed in (7, 8):
            peer.stdin.write(json.dumps({"seed": seed, "samples": 64}) + "\n")
            peer.stdin.flush()
            answer = next(a for a in answers if "progress" not in a)
            assert answer["signed"] and answer["seconds"] > 0 and answer["samples"] >= 64
            image = np.fromfile(tmp_path / "pass.f32", dtype="<f4")
            assert image.size == 32 * 32 * 3 and np.isfinite(image).all()
            means.append(float(image.mean()))
        assert means[0] > 0 and abs(means[1] / means[0] - 1) < 0.1
        assert "first sample" in (tmp_path / "log.txt").read_text()
    finally:
        peer.kill()
        peer.wait()

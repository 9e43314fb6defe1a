"""Kernels of a peer: built by a program of its own, within a limit, with a word for who waits; and PATHOCL where there is a device."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[4]
PEERS = ROOT / "scripts" / "peers"
sys.path.insert(0, str(PEERS))
import kernel_build  # noqa: E402
import peer_luxcore  # noqa: E402
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


class DeviceSession(peer_luxcore.Session):
    """A session as PATHOCL's: its film holds what the device last handed over, 32 samples at a time; the sample of number n has the value n."""

    def __init__(self):
        super().__init__(None, None, {}, (2, 1))
        self.handed, self.looks, self.running = 0, 0, False
        self.Pause = lambda: setattr(self, "running", False)

    def run(self, seed):
        self.session, self.running = self, True

    def counted(self):
        self.looks += 1
        if self.running and self.looks % 3 == 0:
            self.handed += 32
        return float(self.handed)

    def image(self):
        return np.full((1, 2, 3), (self.handed + 1) / 2, np.float32)


def test_a_pass_of_kernels_lies_between_two_films_that_the_device_hands_over():
    session = DeviceSession()
    for _ in range(3):
        before = session.handed
        image, seconds, samples, signed = peer_luxcore.pass_of_kernels(session, 1, 40)
        assert samples == 64 and seconds > 0 and signed
        # The first film behind the pause begins the pass: what it brings is not of it.
        first = before + 32
        assert session.handed == first + 64
        np.testing.assert_allclose(image, first + 32.5)


def test_a_session_without_further_samples_is_refused(monkeypatch):
    monkeypatch.setattr(peer_luxcore, "SILENCE", 0.2)
    session = DeviceSession()
    session.counted = lambda: 0.0
    with pytest.raises(Refused, match="no further sample in 0.2 s: 0 of"):
        peer_luxcore.pass_of_kernels(session, 1, 4)


class Devices(dict):
    def GetAllNames(self):
        return list(self)

    def Get(self, key):
        value = self[key]
        return type("Property", (), {"GetString": lambda _: value})()


@pytest.mark.parametrize(("kinds", "chosen"), [(["OPENCL_GPU", "CUDA_GPU", "CUDA_GPU"], 1), (["OPENCL_CPU", "OPENCL_GPU"], 1), (["OPENCL_CPU"], 0)])
def test_one_device_is_used_and_cuda_before_opencl(kinds, chosen):
    devices = Devices({f"opencl.device.{i}.{k}": v for i, kind in enumerate(kinds) for k, v in (("type", kind), ("name", f"card {i}"))})
    name, kind, settings = peer_luxcore.choose_device(type("Lux", (), {"GetOpenCLDeviceDescs": lambda: devices}))
    assert (name, kind) == (f"card {chosen}", kinds[chosen])
    assert settings["opencl.devices.select"] == "".join("1" if i == chosen else "0" for i in range(len(kinds)))
    assert settings["cuda.optix.devices.select"] == "0" * len(kinds)
    assert peer_luxcore.choose_device(type("Lux", (), {"GetOpenCLDeviceDescs": lambda: Devices()})) is None


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

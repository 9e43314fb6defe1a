"""Renders, their arrays, interrupts and threads."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import ambilux
import numpy as np
import pytest
from conftest import SCENES


def program(*arguments):
    """The program, as the module has it."""
    return subprocess.run([sys.executable, "-m", "ambilux.cli", *map(str, arguments)], capture_output=True, text=True, timeout=120)


def test_a_render_is_that_of_the_program(scene, tmp_path):
    out = tmp_path / "a.exr"
    done = program("render", SCENES / "cornell.xml", "-o", out, "--size", "32x24", "--spp", 4, "--seed", 3, "-i", "bdpt", "--variant", "lvc", "--backend", "cpu",
                   "--max-depth", 4, "--set", "connections=2")
    assert done.returncode == 0, done.stderr
    image = ambilux.render(scene, integrator="bdpt", variant="lvc", spp=4, seed=3, max_depth=4, backend="cpu", settings={"connections": 2})
    np.testing.assert_allclose(image.rgb, ambilux.read(out).rgb, rtol=1e-4, atol=1e-5)
    assert image.stats["integrator"] == "bdpt" and image.stats["variant"] == "lvc" and image.stats["spp"] == 4


def test_without_an_integrator_that_of_the_scene_renders(tmp_path):
    file = tmp_path / "s.xml"
    file.write_text('<scene version="3.0.0"><integrator type="bdpt"/><shape type="sphere"/><emitter type="constant"/></scene>')
    scene = ambilux.load(file, size=(4, 4))
    assert ambilux.render(scene, spp=1, backend="cpu").stats["integrator"] == "bdpt"
    assert ambilux.render(scene, "path", spp=1, backend="cpu").stats["integrator"] == "path"


def test_a_budget_of_memory_is_kept_or_refused(scene):
    any_memory = ambilux.render(scene, spp=2, backend="cpu")
    image = ambilux.render(scene, spp=2, backend="cpu", settings={"memory": "64M"})
    assert image.stats["memory"] == "64M" and any_memory.stats["memory"] == "all"
    assert image.stats["memory_bytes_predicted"] <= image.stats["memory_bytes_peak"] <= 64 << 20
    np.testing.assert_array_equal(image.rgb, any_memory.rgb)
    with pytest.raises(ambilux.DeviceError, match="at least"):
        ambilux.render(scene, spp=1, backend="cpu", settings={"memory": "1K"})


def test_arrays_are_not_copied(scene):
    image = ambilux.render(scene, spp=2, backend="cpu")
    assert image.rgb.dtype == np.float32 and image.shape == (24, 32, 3)
    assert not image.rgb.flags.owndata
    for array in (np.asarray(image), np.from_dlpack(image)):
        assert np.shares_memory(array, image.rgb)
    assert not np.shares_memory(np.array(image), image.rgb)
    rgb, total = image.rgb, float(image.rgb.sum())
    del image
    assert float(rgb.sum()) == total > 0


def test_the_variance_is_that_of_samples(scene):
    many = np.stack([ambilux.render(scene, spp=1, seed=s, backend="cpu").rgb for s in range(64)])
    image = ambilux.render(scene, spp=64, seed=100, backend="cpu")
    # Sums over pixels of two estimates of the same variance, each of 64 samples.
    ours, theirs = image.variance, many.var(axis=0, ddof=1)
    spread = np.sqrt(np.sum((ours - theirs) ** 2))
    assert abs(np.sum(ours - theirs)) < 5 * spread
    np.testing.assert_allclose(image.stderr**2 * 64, image.variance, rtol=1e-5)
    assert ambilux.render(scene, spp=1, backend="cpu").variance is None
    assert ambilux.render(scene, spp=64, backend="cpu", settings={"sampler": "sobol"}).variance is None  # samples depend on each other


def test_progressive_ends_with_the_image_of_render(scene):
    steps = list(ambilux.progressive(scene, spp=200, every=0.02, seed=5, backend="cpu"))
    assert len(steps) > 1 and [s.samples for s in steps] == sorted({s.samples for s in steps})
    np.testing.assert_allclose(steps[-1].image.rgb, ambilux.render(scene, spp=200, seed=5, backend="cpu").rgb, rtol=1e-4, atol=1e-5)
    first = steps[0].image.rgb.copy()
    assert steps[0].image.samples == steps[0].samples and np.array_equal(first, steps[0].image.rgb)


def test_time_is_met(scene):
    # Other processes may take the cores at the wrong moment: one of three tries must succeed.
    tries = []
    for _ in range(3):
        steps = list(ambilux.progressive(scene, time=0.6, every=0.2, backend="cpu"))
        tries.append((len(steps), steps[-1].seconds))
        if 2 <= len(steps) <= 6 and 0.3 < steps[-1].seconds < 2:
            return
    raise AssertionError(tries)


def test_a_spherical_sensor_sees_all_around():
    inside = ambilux.Scene({
        "type": "scene",
        "sensor": {"type": "spherical", "film": {"type": "hdrfilm", "width": 8, "height": 4}},
        "shell": {"type": "sphere", "radius": 2.0, "flip_normals": True, "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 3.0}},
                  "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}},
    })
    assert inside.info["sensor"] == {"type": "spherical"}
    np.testing.assert_allclose(ambilux.render(inside, spp=4, backend="cpu").rgb, 3.0, rtol=1e-5)


def test_usage_errors(scene):
    for arguments in ({"integrator": "magic"}, {"spp": 0}, {"spp": -1}, {"spp": 1.5}, {"spp": 1, "time": 1.0}, {"time": -1.0}, {"settings": {"no_such": 1}},
                      {"variant": "lvc"}, {"size": (0, 1)}, {"backend": "tpu"}, {"spp": 2**64}, {"spp": "4"}, {"size": 16}, {"settings": ["rr_depth"]},
                      {"settings": {1: 2}}, {"time": "long"}):
        with pytest.raises(ambilux.UsageError):
            ambilux.render(scene, **arguments)
    for shape in ((0, 0, 3), (2, 3), (2, 3, 4)):
        with pytest.raises(ambilux.UsageError, match="height, width, 3"):
            ambilux.compare(np.zeros(shape), np.zeros(shape))
    with pytest.raises(ambilux.UsageError, match="name ends in .exr"):
        ambilux.reference(scene, "r.png", spp=4)
    with pytest.raises(ambilux.UsageError, match="do not belong"):
        ambilux.Image(np.zeros((2, 2, 3)), stderr=np.zeros((3, 2, 3)))
    with pytest.raises(ambilux.SceneError, match="no_such: is no folder"):
        ambilux.Results("no_such").runs
    with pytest.raises(ValueError, match="every"):
        ambilux.progressive(scene, spp=1, every=0)
    if not ambilux.cuda_available():
        with pytest.raises(ambilux.DeviceError, match="CUDA"):
            ambilux.render(scene, spp=1, backend="cuda")


def test_a_warning_names_light_that_settings_cannot_find():
    with pytest.warns(ambilux.AmbiluxWarning):
        ambilux.render(SCENES / "lights.xml", spp=1, size=(8, 8), backend="cpu", settings={"estimator": "naive"})


def cpu_seconds(pid):
    """That a process has used, of all of its threads."""
    with open(f"/proc/{pid}/stat") as file:
        fields = file.read().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_an_interrupt_ends_a_render_after_the_sample_in_work():
    code = textwrap.dedent("""
        import sys, time, ambilux
        scene = ambilux.load(sys.argv[1], size=(320, 240))
        print("ready", flush=True)
        try:
            ambilux.render(scene, integrator="bdpt", spp=100000, backend="cpu")
        except KeyboardInterrupt:
            print("interrupted", flush=True)
        print(ambilux.render(scene, spp=1, size=(8, 8), backend="cpu").samples)
    """)
    process = subprocess.Popen([sys.executable, "-c", code, str(SCENES / "cornell.xml")], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "ready\n"
    time.sleep(1)
    used = cpu_seconds(process.pid)
    process.send_signal(signal.SIGINT)
    assert process.stdout.readline() == "interrupted\n"
    # A second of all cores: what else the machine is doing does not count.
    assert cpu_seconds(process.pid) - used < os.cpu_count()
    assert process.stdout.read() == "1\n" and process.wait(timeout=60) == 0


def test_other_threads_run_and_two_renders_at_once(scene):
    images, counted = {}, 0

    def work(seed):
        images[seed] = ambilux.render(scene, spp=300, seed=seed, backend="cpu").rgb

    threads = [threading.Thread(target=work, args=(seed,)) for seed in (1, 2)]
    for t in threads:
        t.start()
    while any(t.is_alive() for t in threads):
        counted += 1
        time.sleep(0.001)
    assert counted > 20
    for seed in (1, 2):
        np.testing.assert_allclose(images[seed], ambilux.render(scene, spp=300, seed=seed, backend="cpu").rgb, rtol=1e-4, atol=1e-5)


def test_files(scene, tmp_path):
    image = ambilux.render(scene, spp=4, backend="cpu")
    image.save(tmp_path / "new" / "a.exr")
    image.save(tmp_path / "new" / "r.exr", stderr=True)
    image.save(tmp_path / "new" / "a.png", exposure=1)
    with pytest.raises(ambilux.UsageError, match="exposure nan: 100 stops at most"):
        image.save(tmp_path / "new" / "b.png", exposure=float("nan"))
    plain, whole = ambilux.read(tmp_path / "new" / "a.exr"), ambilux.read(tmp_path / "new" / "r.exr")
    np.testing.assert_array_equal(plain.rgb, image.rgb)
    np.testing.assert_array_equal(whole.stderr, image.stderr)
    assert plain.stderr is None and whole.samples == plain.samples == 4 and plain.attributes["integrator"] == "path"
    assert (tmp_path / "new" / "a.png").read_bytes().startswith(b"\x89PNG") and image._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(ValueError, match="exr"):
        image.save(tmp_path / "a.tif")
    with pytest.raises(ambilux.SceneError) as e:
        ambilux.read(tmp_path / "none.exr")
    assert e.value.file == str(tmp_path / "none.exr")


def test_reference_and_compare_are_those_of_the_program(scene, tmp_path):
    path, out = tmp_path / "refs" / "r.exr", tmp_path / "a.exr"
    assert ambilux.reference(scene, path, spp=8, backend="cpu").samples == 8
    truth = ambilux.reference(scene, path, spp=16, backend="cpu")
    assert truth.samples == 16 and truth.stderr is not None
    image = ambilux.render(scene, spp=4, backend="cpu")
    image.save(out)
    metrics = ambilux.compare(image, truth)
    of_program = json.loads(program("compare", out, path, "--json", "-").stdout)
    for name, value in metrics.items():
        assert value == pytest.approx(of_program[name], rel=1e-6), name
    assert ambilux.compare(out, path) == metrics
    assert ambilux.compare(image.rgb, truth.rgb)["rmse_corrected"] is None
    with pytest.raises(ValueError, match="estimator"):
        ambilux.reference(scene, tmp_path / "x.exr", spp=4, settings={"estimator": "nee"})
    with pytest.raises(ambilux.SceneError, match="its seed is"):
        ambilux.reference(scene, path, spp=32, seed=9)
    with pytest.raises(ValueError, match="would replace"):
        copied = tmp_path / "s.xml"
        copied.write_text((SCENES / "glass.xml").read_text())
        ambilux.reference(copied, copied, spp=4)
    with pytest.raises(ValueError, match="32x24"):
        ambilux.compare(image, image.rgb[:8])


def test_an_experiment_gives_frames(tmp_path):
    pytest.importorskip("pandas")
    config = tmp_path / "e.toml"
    config.write_text(f'''seeds = [1]
[reference]
spp = 8
[budget]
spp = [1, 2]
[[scene]]
name = "box"
path = "{SCENES / 'cornell.xml'}"
size = [16, 12]
[[run]]
name = "mis"
integrator = "path"
''')
    told = []
    results = ambilux.experiment(config, tmp_path / "out", progress=told.append)
    assert told and all(0 <= t.fraction <= 1 for t in told) and "box" in told[-1].details
    assert list(results.runs["spp"]) == [1, 2] and len(results.table) >= 1 and "extend" in set(results.stages["stage"])
    assert len(results.queues) and not len(results.strategies) and set(results.depths["depth"]) > {0}
    assert results.plot.convergence(x="spp").axes and "convergence" in dir(results.plot) and "save" not in dir(results.plot)
    with pytest.raises(AttributeError, match="no plot pie; there are ablation"):
        results.plot.pie()

    def stop(report):
        raise StopIteration(report.details)

    with pytest.raises(StopIteration):
        ambilux.experiment(config, tmp_path / "stopped", progress=stop)
    assert len(ambilux.experiment(config, tmp_path / "stopped", resume=True).runs) == 2
    with pytest.raises(ambilux.SceneError):
        ambilux.experiment(tmp_path / "none.toml", tmp_path / "o2")


def test_the_references_of_the_demo_come_with_the_project():
    folder = SCENES / "references"
    for line in (folder / "SHA256SUMS").read_text().splitlines():
        digest, name = line.split()
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest
    plan = ambilux.experiment(SCENES.parent / "experiments/demo.toml", references=folder, dry_run=True)
    assert plan.count(": cached with ") == 2 and ": to make" not in plan


def test_the_program_and_its_version():
    done = program("--version")
    assert done.returncode == 0 and done.stdout.startswith(f"ambilux {ambilux.__version__} ")
    assert program("render").returncode == 2


def test_single_strategies_say_what_light_they_do_not_find(scene):
    with pytest.warns(ambilux.AmbiluxWarning, match="single strategies do not find"):
        ambilux.render(scene, "bdpt", spp=1, backend="cpu", settings={"strategies": "s1t2+s2t2"})


def test_samples_by_their_numbers_are_those_of_one_render(scene):
    from ambilux import _core

    settings = [("backend", "cpu"), ("seed", "3")]
    whole = ambilux.render(scene, spp=6, seed=3, backend="cpu")
    parts = _core.Render(scene._core, settings, 1000, None)
    assert parts.add(0, 2) > 0
    first = np.array(parts.pixels().rgb, dtype=np.float64)
    parts.clear()
    parts.add(2, 4)
    mean = (2 * first + 4 * np.array(parts.pixels().rgb)) / 6
    np.testing.assert_allclose(mean, whole.rgb, rtol=1e-5, atol=1e-6)

"""What the program has besides renders, from Python: the same values."""

import json
import subprocess
import sys
import warnings
from pathlib import Path

import ambilux
import numpy as np
import OpenEXR
import pytest
from conftest import SCENES

SIZE = (32, 18)
RENDER = ("-i", "bdpt", "--size", "32x18", "--seed", "3", "--backend", "cpu")


def program(*arguments):
    done = subprocess.run([sys.executable, "-m", "ambilux.cli", *map(str, arguments)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


def channels(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels for name, channel in file.channels().items()}


@pytest.fixture(scope="module")
def glass():
    return ambilux.load(SCENES / "glass.xml", size=SIZE)


@pytest.fixture(scope="module")
def both(glass, tmp_path_factory):
    """A render by the package and by the program, and the folder of their files."""
    folder = tmp_path_factory.mktemp("both")
    image = ambilux.render(glass, "bdpt", spp=4, seed=3, backend="cpu", aovs=["albedo", "depth", "variance"], outliers=2, technique_images=folder / "ours")
    image.save(folder / "ours.exr")
    program("render", SCENES / "glass.xml", "-o", folder / "its.exr", *RENDER, "--spp", 4, "--aov", "albedo,depth,variance", "--outliers", 2, "--json", folder / "its.json",
            "--technique-images", folder / "its")
    return image, folder


def test_layers_are_those_of_the_program(both):
    image, folder = both
    assert {name: layer.shape for name, layer in image.aovs.items()} == {"albedo": (18, 32, 3), "depth": (18, 32), "variance": (18, 32, 3)}
    assert image.aovs["depth"].max() > 1
    ours, its = channels(folder / "ours.exr"), channels(folder / "its.exr")
    assert set(ours) == set(its) >= {"albedo.G", "depth.Z"}
    np.testing.assert_array_equal(ours["depth.Z"], image.aovs["depth"])
    for name in its:
        np.testing.assert_allclose(ours[name], its[name], rtol=1e-4, atol=1e-5)


def test_strategies_are_those_of_the_program(both):
    image, folder = both
    stated = json.loads((folder / "its" / "techniques.json").read_text())["entries"]
    assert json.loads((folder / "ours" / "techniques.json").read_text())["entries"][0].keys() == stated[0].keys()
    assert [(i.s, i.t, i.merge) for i in image.strategies] == [(e["s"], e["t"], e["merge"]) for e in stated]
    for ours, its in zip(image.strategies, stated):
        assert ours.raw.shape == (18, 32, 3)
        np.testing.assert_allclose(ours.weighted.mean(), its["mean_weighted"], rtol=1e-4, atol=1e-7)


def test_outliers_and_traces_are_those_of_the_program(both):
    image, folder = both
    stated = json.loads((folder / "its.json").read_text())["outliers"]
    assert len(image.outliers) == 2
    for ours, its in zip(image.outliers, stated):
        command = its.pop("command")
        assert ours.pixel == its["pixel"] and ours.sample == its["sample"]
        np.testing.assert_allclose(ours.value, its["value"], rtol=1e-4)
    trace = image.outliers[1].trace()
    its = json.loads(program(*command.split()[1:], "--json", "-"))
    assert trace.to_dict() == its
    assert str(trace).startswith(f"pixel {trace.pixel[0]},{trace.pixel[1]}, sample {trace.sample}, seed 3")
    np.testing.assert_allclose(trace.total, image.outliers[1].replayed)


def test_a_trace_is_of_a_pixel_or_of_a_light_subpath(glass):
    only = ambilux.trace(glass, (5, 7), 1, "bdpt", strategy="s1t2", backend="cpu")
    assert {(c.s, c.t) for c in only.candidates} <= {(1, 2)}
    light = ambilux.trace(glass, sample=1, integrator="bdpt", light_subpath=3)
    assert light.light_subpath.number == 3 and "eye_subpath" not in light
    compared = ambilux.trace(glass, np.array([5, 7]), 1, "path", compare=True, backend="cpu")
    assert not any(part.differs for part in compared.by_segments)
    for wrong, message in (({}, "pixel"), ({"pixel": (32, 0)}, "32x18"), ({"pixel": 5}, "32x18"), ({"pixel": (1.5, 0)}, "whole number"), ({"pixel": (0, 0), "sample": -1}, "sample -1"),
                           ({"pixel": (0, 0), "strategy": "x"}, "x"), ({"pixel": (0, 0), "settings": {"sampler": "sobol"}}, "sobol"),
                           ({"light_subpath": 3, "compare": True}, "compare")):
        with pytest.raises(ambilux.UsageError, match=message):
            ambilux.trace(glass, **wrong)


def test_extras_are_checked_before_the_render(glass):
    for wrong, message in (({"aovs": ["colour"]}, "albedo"), ({"aovs": "depth"}, "list"), ({"aovs": ["depth", "depth"]}, "twice"), ({"outliers": -1}, "outliers"),
                           ({"aovs": ["variance"], "settings": {"sampler": "sobol"}}, "sobol"), ({"outliers": 1, "device": "cuda"}, "backend='cuda'"),
                           ({"outliers": 1, "settings": {"sampler": "sobol"}}, "replay")):
        with pytest.raises(ambilux.UsageError, match=message):
            ambilux.render(glass, spp=10**9, **wrong)


def test_info_and_devices_are_those_of_the_program(glass):
    its = json.loads(program("info", SCENES / "glass.xml", *RENDER, "--json", "-"))
    ours = ambilux.info(glass, "bdpt", backend="cpu", settings={"seed": 3}).to_dict()
    assert ours.pop("seconds").keys() == its.pop("seconds").keys()
    assert ours == its
    assert ambilux.devices() == json.loads(program("devices", "--json", "-"))


def test_a_converted_scene_is_that_of_the_program(glass, tmp_path):
    (tmp_path / "its").mkdir()
    (tmp_path / "ours").mkdir()
    program("convert", SCENES / "glass.xml", tmp_path / "its" / "a.xml", "--size", "32x18")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ambilux.AmbiluxNote)
        ambilux.convert(glass, tmp_path / "ours" / "a.xml")
    assert (tmp_path / "ours" / "a.xml").read_bytes() == (tmp_path / "its" / "a.xml").read_bytes()
    with pytest.raises(ambilux.UsageError, match="xml"):
        ambilux.convert(glass, tmp_path / "a.pbrt")


def test_a_stress_sweep_goes_on_and_is_read(tmp_path):
    wanted = {"families": ["tessellation"], "methods": ["path-mis"], "quick": True, "backend": "cpu"}
    sweep = ambilux.stress(tmp_path / "s", **wanted)
    assert sweep.planned == len(sweep.rows) > 1 and sweep.bad == 0 and set(sweep.rows.method) == {"path-mis"}
    assert (tmp_path / "s" / "stress.csv").read_text().splitlines()[0] == sweep.csv.splitlines()[0]
    with pytest.raises(ambilux.UsageError, match="resume"):
        ambilux.stress(tmp_path / "s", **wanted)
    assert ambilux.stress(tmp_path / "s", resume=True, **wanted).csv == sweep.csv
    with pytest.raises(ambilux.UsageError, match="emission-scale"):
        ambilux.stress(tmp_path / "t", families=["emission"])
    ambilux.stress_export(tmp_path / "scenes", families=["tessellation"], quick=True)
    assert (tmp_path / "scenes" / "expected.csv").exists()
    with pytest.raises(ambilux.SceneError, match="no.csv"):
        ambilux.stress_judge(tmp_path / "no.csv", tmp_path / "j")


NOTED = """<scene version="3.0.0"><integrator type="volpath"/><sensor type="perspective"/><shape type="sphere"/><emitter type="constant"/></scene>"""


def test_notes_of_the_loader_are_warnings_once(tmp_path):
    file = tmp_path / "noted.xml"
    file.write_text(NOTED)
    with pytest.warns(ambilux.AmbiluxNote, match="volpath") as said:
        for _ in range(2):
            scene = ambilux.load(file, size=(4, 4))
    assert {w.filename for w in said} == {__file__}  # the caller's line, by which Python says each once
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bright = scene.resized((8, 8)).with_params({"shape.emitter": None} if "shape.emitter" in scene.params else {})
        # As by the program without -i: what the scene names, in its place the path tracer.
        assert ambilux.render(bright, spp=1, backend="cpu").stats.integrator == "path"


def test_statistics_are_objects(glass):
    image = ambilux.render(glass, "bdpt", "lvc", spp=2, backend="cpu", settings={"connections": 2})
    stats = image.stats
    assert stats.variant == stats["variant"] == "lvc" and stats.connections == 2 and stats.seconds.render > 0
    assert "stages" in stats and {"name", "items", "seconds"} <= set(stats.stages[0])
    assert json.loads(json.dumps(stats.to_dict()))["spp"] == 2 and stats == stats.to_dict()
    with pytest.raises(AttributeError, match="did you mean 'variant'"):
        stats.varient
    with pytest.raises(KeyError):
        stats["varient"]


def test_light_vertices_are_those_of_traces(glass):
    settings = {"seed": 5}
    all_of_them = ambilux.light_vertices(glass, 2, variant="lvc", **settings)
    n = len(all_of_them.depth)
    assert all_of_them.subpath_count == 32 * 18 and n > all_of_them.subpath_count
    assert all_of_them.position.shape == all_of_them.throughput.shape == (n, 3) and 0 < all_of_them.connectible.mean() < 1
    number = int(all_of_them.subpath[n // 2])
    mine = all_of_them.subpath == number
    vertices = [v for v in ambilux.trace(glass, sample=2, integrator="bdpt", variant="lvc", light_subpath=number, **settings).light_subpath.vertices if not v.miss]
    np.testing.assert_array_equal(all_of_them.position[mine], [v.p for v in vertices])
    np.testing.assert_array_equal(all_of_them.throughput[mine], np.array([v.throughput for v in vertices], np.float32))
    assert all_of_them.connectible[mine].tolist() == [v.connectible for v in vertices]
    # Every light subpath starts with the power of the lamp.
    first = all_of_them.throughput[all_of_them.depth == 1]
    np.testing.assert_allclose(first, np.broadcast_to(np.pi * np.pi * 0.25**2 * np.array([110, 100, 85]), first.shape), rtol=1e-3)
    with pytest.raises(ambilux.UsageError, match="light"):
        ambilux.light_vertices(glass, integrator="path")


def test_another_build_is_driven_by_its_module(monkeypatch):
    monkeypatch.syspath_prepend(SCENES.parent / "scripts" / "peers")
    import peer_build

    stated, render = peer_build.start({"module": str(Path(ambilux.__file__).parents[1]), "scene": str(SCENES / "cornell.xml"), "parameters": {}, "film": [8, 6],
                                       "crop": [0, 0, 8, 6], "max_depth": 4, "rr_depth": 5, "settings": [("integrator", "bdpt"), ("backend", "cpu")]})
    image, seconds, samples = render({"render_seed": 1, "seed": 1, "first": 0, "samples": 2})
    assert image.shape == (6, 8, 3) and seconds > 0 and samples == 2 and ambilux.__version__ in stated["version"]

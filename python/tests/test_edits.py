"""Scenes that are changed: by name, by camera, by arrays, and as files and dictionaries."""

import copy

import ambilux
import numpy as np
import pytest
from conftest import BALL, SCENES


@pytest.fixture(scope="module")
def box():
    return ambilux.load(SCENES / "cornell.xml", size=(16, 12))


def same(a, b):
    """Whether two scenes render to the same bits."""
    one, other = (ambilux.render(s, "path", spp=2, seed=3).rgb for s in (a, b))
    return np.array_equal(one, other)


def test_parameters_are_a_mapping_of_numbers_and_arrays(box):
    assert box.params["red.reflectance"].tolist() == pytest.approx([0.61, 0.06, 0.05])
    assert box.params["sensor.fov"] == 39.0
    assert box.params["sensor.to_world"].shape == (4, 4)
    assert box.params["sensor.near_clip"] == pytest.approx(0.01)  # the file does not say
    assert "red.reflectance" in box.params and len(box.params) == len(list(box.params))
    assert "W/(m² sr)" in repr(box.params)
    with pytest.raises(KeyError, match="is red.reflectance meant"):
        box.params["red.albedo"]


def test_an_edit_is_the_file_that_is_written_with_it(box, tmp_path):
    other = box.with_params({"red.reflectance": np.array([0.1, 0.2, 0.6]), "sensor.fov": np.float32(30), "red": {"type": "plastic"}})
    other.save(tmp_path / "a.xml")
    assert same(other, ambilux.load(tmp_path / "a.xml", size=(16, 12)))  # a size of the loader is no part of the scene
    assert not same(other, box)


def test_edits_share_what_they_leave(box):
    other = box.with_params({"red.reflectance": 0.2})
    assert other._core.shares_structure(box._core)
    assert other._core.shared_bytes(box._core) > 0
    moved = box.with_params({"floor.to_world": [{"translate": [0, 1, 0]}]})
    assert not moved._core.shares_structure(box._core)


def test_a_camera(box):
    near = box.with_camera([0, 0, 2], [0, 0, 0], [0, 1, 0], fov=50)
    assert near.params["sensor.to_world"][:3, 3].tolist() == [0, 0, 2]
    assert near._core.shares_structure(box._core)
    with pytest.raises(ambilux.UsageError, match="three numbers"):
        box.with_camera([0, 0])
    seen = ambilux.Scene({"type": "scene", "ball": {"type": "sphere"}, "sky": {"type": "constant"}}).with_camera([0, 0, 5], [0, 0, 0], fov=40)
    assert ambilux.render(seen, spp=1, size=(8, 8)).rgb.max() > 0


@pytest.mark.parametrize("change, message", [
    ({"red.reflectance": [1, 2]}, r"red.reflectance: a number or three of them is needed \(a share, 0 to 1\), not an array of shape \(2,\)"),
    ({"red.reflectance": 2.0}, r"red.reflectance: .*larger than 1.*\(a share"),
    ({"sensor.fov": [1, 2, 3, 4]}, "sensor.fov: a number is needed"),
    ({"sensor.fov": "wide"}, "sensor.fov: a number is needed \\(degrees, between 0 and 180\\), not 'wide'"),
    ({"sensor.fov": True}, "sensor.fov: a number is needed"),
    ({"sensor.fov": 200}, r"sensor.fov: fov must lie between 0 and 180 degrees"),
    ({"rde.reflectance": 1}, "is 'red.reflectance' meant"),
    ({"red.albedo": 1}, "'reflectance' is known"),
    ({"sensor.to_world": np.eye(5)}, "sensor.to_world: a matrix of 4x4"),
])
def test_wrong_changes_name_the_parameter(box, change, message):
    with pytest.raises(ambilux.SceneError, match=message) as caught:
        box.with_params(change)
    assert caught.value.key == next(iter(change))


QUAD = {"vertex_positions": np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32), "faces": np.array([[0, 1, 2], [0, 2, 3]])}


def test_meshes_and_images_from_arrays_and_back(tmp_path):
    description = copy.deepcopy(BALL)
    texels = np.linspace(0, 0.9, 12, dtype=np.float32).reshape(2, 2, 3)
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    description["quad"] = {"type": "mesh", **QUAD, "vertex_texcoords": uvs,
                           "bsdf": {"type": "diffuse", "reflectance": {"type": "bitmap", "data": texels, "filter_type": "nearest"}}}
    description["sky"] = {"type": "envmap", "data": np.ones((4, 8, 3), np.float32)}
    scene = ambilux.Scene(description)
    assert scene.params["quad.vertex_positions"].shape == (4, 3) and scene.params["quad.faces"].dtype == np.uint32
    assert np.array_equal(scene.params["quad.bsdf.reflectance.data"], texels)
    scene.save(tmp_path / "b.xml")
    assert same(scene, ambilux.load(tmp_path / "b.xml"))
    moved = scene.with_params({"quad.vertex_positions": QUAD["vertex_positions"] * 0.5, "sky.data": np.full((4, 8), 0.5)})
    assert moved.params["quad.vertex_positions"].max() == 0.5 and moved.params["sky.data"].max() == 0.5
    assert not same(scene, moved)
    with pytest.raises(ambilux.SceneError, match=r"quad.faces: an array of shape \(n, 3\)"):
        scene.with_params({"quad.faces": np.zeros((2, 4))})
    with pytest.raises(ambilux.SceneError, match="one row for each of 4 vertices"):
        scene.with_params({"quad.vertex_normals": np.zeros((3, 3))})


def test_a_dictionary_of_a_scene_is_that_scene(box):
    again = ambilux.Scene(box.to_dict())
    assert same(box.resized((16, 12)), again.resized((16, 12)))
    ball = ambilux.Scene(BALL)
    assert same(ball, ambilux.Scene(ball.to_dict()))


def test_objects_come_and_go(box):
    lit = box.with_params({"extra": {"type": "point", "position": [0, 0.5, 0], "intensity": {"type": "rgb", "value": [3, 3, 3]}}})
    assert lit.params["extra.position"].tolist() == [0, 0.5, 0]
    assert same(lit.with_params({"extra": None}), box)


@pytest.mark.parametrize("value", [np.bool_(True), True])
def test_truth_values_of_numpy(value):
    description = copy.deepcopy(BALL)
    description["ball"]["flip_normals"] = value
    description["ball"]["to_world"] = np.matrix(np.eye(4))
    description["ball"]["radius"] = np.float32(0.5)
    assert ambilux.Scene(description).params["ball.flip_normals"] is True


def test_an_experiment_from_a_dictionary():
    config = {"name": "d", "seeds": [1], "reference": {"spp": 4}, "budget": {"spp": [2]},
              "scene": [{"name": "c", "path": SCENES / "cornell.xml", "size": [8, 8], "sweep": {"params.red.reflectance": [0.1, [0.1, 0.2, 0.3]]}}],
              "run": [{"name": "p", "integrator": "path"}]}
    assert "params.red.reflectance=0.1_0.2_0.3" in ambilux.experiment(config, dry_run=True)
    with pytest.raises(ambilux.SceneError, match="is 'seeds' meant"):
        ambilux.experiment({**config, "seed": [1]}, dry_run=True)

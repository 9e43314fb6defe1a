"""Scenes from files and dictionaries, and what is wrong with them."""

import copy

import ambilux
import numpy as np
import pytest
from conftest import BALL, SCENES


def changed(path, value):
    description = copy.deepcopy(BALL)
    place = description
    *keys, last = path.split(".")
    for key in keys:
        place = place[key]
    place[last] = value
    return description


def test_parameters_and_size():
    scene = ambilux.load(SCENES / "glass.xml", resx=40, resy=20)
    assert scene.size == (40, 20)
    assert scene.resized((10, 5)).size == (10, 5)
    assert scene.info["film"]["width"] == 40 if "film" in scene.info else scene.info


def test_pbrt_and_gltf_are_told_by_their_endings(tmp_path):
    path = tmp_path / "a.pbrt"
    path.write_text('Film "rgb" "integer xresolution" 8 "integer yresolution" 4\nWorldBegin\nShape "sphere"\n')
    scene = ambilux.load(path)
    assert scene.size == (8, 4)
    path.write_text('WorldBegin\nShape "torus"\n')
    with pytest.raises(ambilux.SceneError, match="a.pbrt:2: shape 'torus' is not supported"):
        ambilux.load(path)
    (tmp_path / "b.gltf").write_text("{}")
    with pytest.raises(ambilux.SceneError, match="not valid glTF"):
        ambilux.load(tmp_path / "b.gltf")


def test_errors_name_file_and_line(tmp_path):
    path = tmp_path / "bad.xml"
    path.write_text('<scene version="3.0.0">\n<sensor type="perspective">\n<float name="nonsense" value="1"/>\n</sensor>\n</scene>\n')
    with pytest.raises(ambilux.SceneError, match="nonsense") as e:
        ambilux.load(path)
    assert (e.value.file, e.value.line) == (str(path), 3)
    with pytest.raises(ambilux.SceneError, match="no parameter") as e:
        ambilux.load(SCENES / "glass.xml", no_such=1)
    assert e.value.file == str(SCENES / "glass.xml") and e.value.line == 0
    with pytest.raises(ambilux.SceneError, match="limits"):
        ambilux.load(SCENES / "glass.xml", limits={"nesting": 1})


def test_usage_errors_are_value_errors():
    for arguments in ({"size": (0, 4)}, {"size": 4}, {"size": "4x4"}, {"size": (4.5, 4)}, {"size": (4, 4, 3)}, {"light_picking": "best"}, {"limits": {"pixels": "many"}}):
        with pytest.raises(ambilux.UsageError):
            ambilux.load(SCENES / "cornell.xml", **arguments)


def test_a_dictionary_is_the_scene_of_its_xml(tmp_path):
    path = tmp_path / "ball.xml"
    path.write_text("""<scene version="3.0.0">
        <sensor type="perspective"><float name="fov" value="40"/>
        <transform name="to_world"><lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform>
        <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="12"/><rfilter type="box"/></film></sensor>
        <shape type="sphere"><bsdf type="diffuse"><rgb name="reflectance" value="0.5 0.4 0.3"/></bsdf></shape>
        <emitter type="constant"><rgb name="radiance" value="2"/></emitter></scene>""")
    images = [ambilux.render(s, spp=4, backend="cpu").rgb for s in (ambilux.Scene(BALL), ambilux.load(path))]
    np.testing.assert_array_equal(*images)


def test_transforms_apply_in_their_order():
    matrix = np.diag([0.5, 0.5, 0.5, 1.0])
    matrix[:3, 3] = [1, 0, 0]
    ways = [matrix, matrix.tolist(), [{"scale": 0.5}, {"translate": [1, 0, 0]}], {"scale": [0.5, 0.5, 0.5], "translate": [1, 0, 0]}]
    images = [ambilux.render(ambilux.Scene(changed("ball.to_world", way)), spp=1, backend="cpu").rgb for way in ways]
    for image in images[1:]:
        np.testing.assert_array_equal(images[0], image)
    other = ambilux.render(ambilux.Scene(changed("ball.to_world", ways[2][::-1])), spp=1, backend="cpu").rgb
    assert np.any(other != images[0])


def test_objects_are_shared_by_references_and_files_are_found(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    description = changed("red", {"type": "diffuse", "reflectance": {"type": "rgb", "value": "#ff0000"}})
    description["mesh"] = {"type": "obj", "filename": "a.obj", "bsdf": {"type": "ref", "id": "red"}}
    assert ambilux.Scene(description, folder=tmp_path).size == (16, 12)
    with pytest.raises(ambilux.SceneError, match="a.obj") as e:
        ambilux.Scene(description)
    assert e.value.key == "mesh.filename"


@pytest.mark.parametrize("path, value, key, text", [
    ("ball.bsdf.reflectance", {"type": "rgb", "value": [1, 2]}, "ball.bsdf.reflectance", "three numbers"),
    ("ball.bsdf.nonsense", 3, "ball.bsdf.nonsense", "unknown parameter"),
    ("ball.radius", "x", "ball.radius", "must be a number"),
    ("ball.center", [1, 2], "ball.center", "three numbers"),
    ("ball.to_world", {"shear": 1}, "ball.to_world.shear", "steps of a transform"),
    ("ball.to_world", "identity", "ball.to_world", "matrix or steps"),
    ("ball.to_world", {"look_at": [0, 0, 1]}, "ball.to_world.look_at", "write it as"),
    ("ball.to_world", {"rotate": {"axis": [0, 1, 0], "angle": "x"}}, "ball.to_world.rotate", "write it as"),
    ("ball.bsdf.reflectance", {"type": "spectrum", "value": [1, 2]}, "ball.bsdf.reflectance", "wavelength:value"),
    ("ball.type", "sfere", "ball.type", "unknown type 'sfere'"),
    ("ball.bsdf", {"type": "ref", "id": "green"}, "ball.bsdf", "unknown id 'green'"),
    ("ball.bsdf", object(), "ball.bsdf", "means nothing"),
    ("ball", 3, "ball", "holds objects"),
    ("type", "film", "type", "'type': 'scene'"),
])
def test_errors_of_dictionaries_name_the_keys(path, value, key, text):
    with pytest.raises(ambilux.SceneError, match=text) as e:
        ambilux.Scene(changed(path, value))
    assert e.value.key == key and str(e.value).startswith(key)


def test_text_cannot_break_out_of_a_dictionary():
    nasty = 'a"/><shape type="cube"/>\n<&$'
    with pytest.raises(ambilux.SceneError) as e:
        ambilux.Scene(changed("ball.bsdf.reflectance", {"type": "bitmap", "filename": nasty}))
    assert e.value.key == "ball.bsdf.reflectance.filename"


def test_what_is_replaced_is_a_warning():
    with pytest.warns(ambilux.AmbiluxWarning, match="nonsense"):
        ambilux.Scene(changed("ball.nonsense", 1), lenient=True)


def test_every_plugin_of_the_reader_is_known_to_dictionaries():
    from ambilux import _core

    tags = _core.plugins()
    for name, tag in {"coating": "bsdf", "roughcoating": "bsdf", "phong": "bsdf", "ward": "bsdf", "difftrans": "bsdf", "mixturebsdf": "bsdf", "principledthin": "bsdf",
                      "projector": "emitter", "collimated": "emitter", "directionalarea": "emitter",
                      "sunsky": "emitter", "sdfgrid": "shape", "bsplinecurve": "shape", "gridtexture": "texture", "mesh_attribute": "texture", "prb": "integrator"}.items():
        assert tags[name] == tag
    # What a list names is known to its reader: alone it may lack something, but not be "not supported".
    outer = {"bsdf": "ball.bsdf", "texture": "ball.bsdf.reflectance", "emitter": "light", "shape": "thing", "integrator": "integrator", "sensor": "sensor",
             "film": "sensor.film", "rfilter": "sensor.film.rfilter", "sampler": "sensor.sampler"}
    for name, tag in tags.items():
        description = changed("ball.emitter" if name in ("area", "directionalarea", "hiddenarea") else outer[tag], {"type": name})
        try:
            ambilux.Scene(description)
        except ambilux.SceneError as e:
            assert "is not supported" not in str(e) or "inside of" in str(e), name
            assert "unknown type" not in str(e), name


def test_coatings_and_grids_stand_in_dictionaries():
    coated = changed("ball.bsdf", {"type": "coating", "bsdf": {"type": "diffuse"}})
    image = ambilux.render(ambilux.Scene(coated), spp=2, backend="cpu")
    plain = ambilux.render(ambilux.Scene(changed("ball.bsdf", {"type": "diffuse"})), spp=2, backend="cpu")
    assert not numpy_equal(image, plain)
    with pytest.raises(ambilux.SceneError, match="is roughdielectric .bsdf. meant"):
        ambilux.Scene(changed("ball.bsdf", {"type": "rough_dielectric"}))


def test_spectra_that_are_objects_stand_in_dictionaries():
    def seen(radiance):
        lamp = changed("ball.emitter", {"type": "area", "radiance": radiance})
        return ambilux.render(ambilux.Scene(lamp), spp=1, max_depth=1, backend="cpu").rgb[6, 8]

    pairs = {"type": "spectrum", "value": [(360, 1), (830, 2)]}
    np.testing.assert_array_equal(seen({"type": "d65", "scale": 2.0}), [2, 2, 2])
    np.testing.assert_array_equal(seen({"type": "regular", "wavelength_min": 360, "wavelength_max": 830, "values": [1, 2]}), seen(pairs))
    np.testing.assert_array_equal(seen({"type": "irregular", "wavelengths": "360, 830", "values": "1, 2"}), seen(pairs))
    red, _, blue = seen({"type": "blackbody", "temperature": 3000})
    assert red > blue > 0
    with pytest.raises(ambilux.SceneError, match="unknown parameter 'colour'") as e:
        seen({"type": "d65", "colour": 1})
    assert e.value.key == "ball.emitter.radiance.colour"


def test_arrays_are_read_as_they_are_or_refused():
    def mesh(**arrays):
        triangle = {"vertex_positions": np.eye(3), "faces": np.array([[0, 1, 2]])}
        return ambilux.Scene(changed("thing", {"type": "mesh", **triangle, **arrays}))

    def image(data):
        return ambilux.Scene(changed("ball.bsdf.reflectance", {"type": "bitmap", "data": data}))

    for faces in (np.array([[0, 1, 2]], ">i8"), np.array([[0.0, 1.0, 2.0]]), [[0, 1, 2]]):
        assert mesh(faces=faces).info.triangles == mesh().info.triangles
    for faces in ([[0, 1, 2.5]], [[0, 1, -1]], [[0, 1, 2**32 + 2]], [[0, 1, np.nan]]):
        with pytest.raises(ambilux.SceneError, match="thing.faces: whole numbers from 0"):
            mesh(faces=np.array(faces))
    for positions in (np.eye(3, dtype=bool), np.eye(3, dtype=complex), np.eye(3).astype("S")):
        with pytest.raises(ambilux.SceneError, match="thing.vertex_positions: numbers are needed, not "):
            mesh(vertex_positions=positions)
    with pytest.raises(ambilux.SceneError, match="rows of one length"):
        mesh(vertex_positions=[[0, 0, 1], [0, 1]])
    image([[0, 1], [1, 0]])
    for wrong, text in ((np.full((2, 2), 300, np.uint16), "floats, which are linear, or bytes"), (np.full((2, 2), np.nan), "a value is not finite")):
        with pytest.raises(ambilux.SceneError, match="ball.bsdf.reflectance.data: " + text):
            image(wrong)
    with pytest.raises(ambilux.UsageError, match="floats, linear radiance, not uint8"):
        ambilux.compare(np.zeros((2, 2, 3), np.uint8), np.zeros((2, 2, 3)))


def numpy_equal(a, b):
    return np.array_equal(a.rgb, b.rgb)

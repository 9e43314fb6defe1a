"""Conversion of scenes for other renderers (scripts/peers), which needs none of them installed."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[4]
sys.path.insert(0, str(ROOT / "scripts" / "peers"))
import luxcore_scene  # noqa: E402
import mitsuba_scene  # noqa: E402
from peer_protocol import Refused  # noqa: E402

OLD = """<scene version="0.6.0"><default name="w" value="7"/><integrator type="bdpt"/>
<sensor type="perspective"><film type="ldrfilm"><integer name="width" value="$w"/><float name="gamma" value="2.2"/><rfilter type="tent"/></film></sensor>
<bsdf type="roughconductor" id="a"><rgb name="eta" value="2, 3, 4"/><rgb name="k" value="1 1 1"/><float name="extEta" value="2"/></bsdf>
<bsdf type="roughdiffuse" id="b"><float name="alpha" value="0.3"/></bsdf>
<bsdf type="roughdielectric" id="c"><float name="intIOR" value="1.5"/><float name="extIOR" value="1"/></bsdf>
<bsdf type="diffuse" id="d"><texture type="bitmap" name="reflectance"><float name="gamma" value="1"/><string name="filename" value="t.png"/>
<float name="uscale" value="2"/></texture></bsdf>
<shape type="rectangle"><transform name="toWorld"><lookAt origin="0,0,$w" target="0,0,0" up="0,1,0"/></transform></shape></scene>"""


def job(tmp_path, text, **more):
    (tmp_path / "scene.xml").write_text(text)
    return {"scene": str(tmp_path / "scene.xml"), "parameters": {}, "film": [64, 32], "crop": [0, 0, 64, 32], "max_depth": 6, "rr_depth": 5, "integrator": "path", **more}


def convert(tmp_path, text, **more):
    tree, changes = mitsuba_scene.convert(job(tmp_path, text, **more))
    return tree.getroot(), changes


def value(root, path):
    return root.find(path).get("value")


def test_an_old_scene_becomes_one_of_format_3_and_says_what_changed(tmp_path):
    root, changes = convert(tmp_path, OLD)
    assert root.get("version") == "3.0.0"
    assert value(root, "bsdf[@id='a']/rgb[@name='eta']") == "1.0, 1.5, 2.0" and root.find("bsdf[@id='a']/float") is None
    assert root.find("bsdf[@id='b']").get("type") == "diffuse" and root.find("bsdf[@id='b']/float") is None
    assert value(root, "bsdf[@id='c']/float[@name='int_ior']") == "1.5"
    texture = root.find("bsdf[@id='d']/texture")
    assert value(texture, "boolean[@name='raw']") == "true" and texture.find("transform/scale").get("x") == "2"
    assert value(texture, "string") == str(tmp_path / "t.png")
    assert root.find("shape/transform/lookat").get("origin") == "0,0,7" and root.find("shape/transform").get("name") == "to_world"
    for text in ("format 0.6.0 is 3.0.0", "extEta is ext_eta", "eta and k are divided by ext_eta", "gamma 1 of a bitmap is raw", "filter tent is box", "film ldrfilm is hdrfilm",
                 "integrator bdpt is path"):
        assert text in changes
    assert any(text.startswith("roughdiffuse is diffuse") for text in changes)


def test_film_integrator_and_parameters_are_those_of_the_job(tmp_path):
    text = '<scene version="3.0.0"><default name="d" value="1"/><integrator type="path"/><sensor type="perspective"/><shape type="$d"/></scene>'
    root, changes = convert(tmp_path, text, parameters={"d": "sphere"}, integrator="ptracer", crop=[4, 2, 8, 8])
    assert root.find("shape").get("type") == "sphere"
    assert root.find("integrator").get("type") == "ptracer" and value(root, "integrator/integer[@name='max_depth']") == "6"
    film = root.find("sensor/film")
    assert [int(value(film, f"integer[@name='{k}']")) for k in ("width", "height", "crop_offset_x", "crop_width")] == [64, 32, 4, 8]
    assert film.find("rfilter").get("type") == "box" and changes == ["integrator path is ptracer"]


def test_the_projects_scenes_need_few_changes(tmp_path):
    for name, expected in (("cornell", []), ("lights", ["filter tent is box"])):
        text = (ROOT / "scenes" / f"{name}.xml").read_text()
        assert convert(tmp_path, text)[1] == expected


def test_bump_and_normal_maps_of_older_formats_have_no_newer_flags(tmp_path):
    text = '<scene version="0.6.0"><sensor type="perspective"/><bsdf type="bumpmap"/></scene>'
    root, changes = convert(tmp_path, text)
    assert {e.get("name"): e.get("value") for e in root.find("bsdf")} == {"flip_invalid_normals": "false", "use_shadowing_function": "false"}
    assert changes[0] == "format 0.6.0 is 3.0.0" and len(changes) == 3
    for newer in ("2.1.0", "3.0.0"):
        root, changes = convert(tmp_path, text.replace("0.6.0", newer))
        assert len(root.find("bsdf")) == 0
        assert not changes


def test_what_cannot_be_divided_is_an_error(tmp_path):
    text = OLD.replace('<rgb name="eta" value="2, 3, 4"/>', '<string name="material" value="Au"/>')
    with pytest.raises(ValueError, match="ext_eta"):
        convert(tmp_path, text)


def test_colours_of_foreign_scenes_are_linear_rgb(tmp_path):
    text = ('<scene version="0.6.0"><sensor type="perspective"/><bsdf type="diffuse" id="a"><srgb name="reflectance" value="#ff8000"/></bsdf>'
            '<bsdf type="diffuse" id="b"><spectrum name="reflectance" value="0.5"/></bsdf><bsdf type="diffuse" id="c"><srgb name="reflectance" value="0.5"/></bsdf>'
            '<emitter type="constant" id="d"><spectrum name="radiance" value="400:1, 700:2"/></emitter></scene>')
    root, changes = convert(tmp_path, text)
    found = {i: root.find(f"*[@id='{i}']")[0] for i in "abcd"}
    assert [found[i].tag for i in "abcd"] == ["rgb", "rgb", "rgb", "spectrum"]
    assert [float(v) for v in found["a"].get("value").split(",")] == pytest.approx([1, 0.215861, 0], abs=1e-6)
    assert found["b"].get("value") == "0.5, 0.5, 0.5" and found["c"].get("value").startswith("0.21404")
    assert "srgb is linear rgb (2 times)" in changes and "a spectrum of one or three numbers is rgb" in changes
    newer, _ = convert(tmp_path, text.replace("0.6.0", "3.0.0"))
    assert newer.find("bsdf[@id='b']")[0].tag == "spectrum"  # the same at all wavelengths, which Mitsuba 3 knows


@pytest.mark.parametrize(("part", "reason"), [
    ('<bsdf type="ward"/>', "bsdf ward: Mitsuba 3 has none"), ('<bsdf type="twosided"><bsdf type="phong"/></bsdf>', "bsdf phong"),
    ('<bsdf type="roughconductor"><string name="distribution" value="phong"/></bsdf>', "distribution phong of roughconductor"),
    ('<bsdf type="diffuse"><srgb name="reflectance" value="1, 2"/></bsdf>', "no colour")])
def test_what_mitsuba_3_lacks_is_refused_by_name_before_it_is_started(tmp_path, monkeypatch, part, reason):
    import peer_mitsuba
    monkeypatch.setitem(sys.modules, "mitsuba", None)  # an import would fail
    with pytest.raises(Refused, match=reason):
        peer_mitsuba.start(job(tmp_path, f'<scene version="3.0.0"><sensor type="perspective"/>{part}</scene>', variant="scalar_rgb", folder=str(tmp_path)))


def lux(tmp_path, shapes, sensor='<sensor type="perspective"><float name="fov" value="90"/></sensor>', size=(64, 32)):
    root, _ = convert(tmp_path, f'<scene version="3.0.0">{sensor}{shapes}</scene>')
    changes = mitsuba_scene.Changes()
    properties, meshes = luxcore_scene.convert(root, size, changes)
    return properties, meshes, changes.texts()


def normals(mesh):
    points, triangles, _ = mesh
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a) / 2


@pytest.mark.parametrize(("shape", "area", "outward"), [("rectangle", 4, False), ("cube", 24, True), ("disk", math.pi, False), ("sphere", 4 * math.pi, True)])
def test_meshes_have_area_and_orientation_of_the_shape(tmp_path, shape, area, outward):
    for transform, factor in (("", 1), ('<transform name="to_world"><scale x="-2" y="2" z="2"/></transform>', 4)):
        _, meshes, _ = lux(tmp_path, f'<shape type="{shape}">{transform}</shape>')
        n = normals(meshes["shape0"])
        assert np.linalg.norm(n, axis=1).sum() == pytest.approx(area * factor, rel=1e-4)
        points, triangles, _ = meshes["shape0"]
        centers = points[triangles].mean(axis=1)
        assert ((n * centers).sum(axis=1) > -1e-9).all() if outward else (n[:, 2] > 0).all()


def test_normals_at_corners_point_as_the_triangles_do(tmp_path):
    _, meshes, _ = lux(tmp_path, '<shape type="sphere"><boolean name="flip_normals" value="true"/><point name="center" x="1" y="2" z="3"/></shape>')
    points, triangles, corners = meshes["shape0"]
    n = normals(meshes["shape0"])
    assert ((n * (points[triangles].mean(axis=1) - [1, 2, 3])).sum(axis=1) < 1e-9).all()
    assert ((corners * (points - [1, 2, 3])).sum(axis=1) < 0).all()


def test_transformations_are_applied_in_the_order_of_the_file(tmp_path):
    shape = '<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><translate y="-1"/><scale value="2"/></transform></shape>'
    _, meshes, _ = lux(tmp_path, shape)
    points, _, _ = meshes["shape0"]
    assert points[:, 1] == pytest.approx(-2) and sorted(points[:, 0]) == pytest.approx([-2, -2, 2, 2])
    assert normals(meshes["shape0"])[0] / 8 == pytest.approx([0, 1, 0], abs=1e-9)


def test_the_field_of_view_is_that_of_the_shorter_side(tmp_path):
    properties, _, _ = lux(tmp_path, '<shape type="cube"/>')
    assert properties["scene.camera.fieldofview"] == pytest.approx(2 * math.degrees(math.atan(0.5)))
    assert properties["scene.camera.screenwindow"][:2] == [-2, 2]


def test_materials_and_lights_that_mean_the_same(tmp_path):
    shapes = ('<bsdf type="dielectric" id="g"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf><shape type="cube"><ref id="g"/></shape>'
              '<shape type="rectangle"><bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.1, 0.2, 0.3"/></bsdf></bsdf>'
              '<emitter type="area"><rgb name="radiance" value="4"/></emitter></shape><emitter type="constant"><rgb name="radiance" value="1, 2, 3"/></emitter>')
    properties, _, changes = lux(tmp_path, shapes)
    assert properties["scene.materials.shape0.type"] == "glass" and properties["scene.materials.shape0.interiorior"] == 1.5
    assert properties["scene.materials.shape1.kd"] == [0.1, 0.2, 0.3] and properties["scene.materials.shape1.emission"] == [4, 4, 4]
    assert properties["scene.lights.sky.gain"] == [1, 2, 3] and changes == []


@pytest.mark.parametrize(("shapes", "reason"), [
    ('<shape type="cube"><bsdf type="roughconductor"/></shape>', "bsdf roughconductor"), ('<emitter type="point"/>', "emitter point"),
    ('<shape type="cylinder"/>', "shape cylinder"),
    ('<shape type="cube"><bsdf type="diffuse"><texture type="bitmap" name="reflectance"/></bsdf></shape>', "reflectance of diffuse is a texture bitmap")])
def test_what_is_not_the_same_is_refused_by_name(tmp_path, shapes, reason):
    with pytest.raises(Refused, match=reason):
        lux(tmp_path, shapes)

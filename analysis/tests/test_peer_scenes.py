"""Conversion of scenes for other renderers (scripts/peers), which needs none of them installed."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "scripts" / "peers"))
import mitsuba_scene  # noqa: E402

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


def test_what_cannot_be_divided_is_an_error(tmp_path):
    text = OLD.replace('<rgb name="eta" value="2, 3, 4"/>', '<string name="material" value="Au"/>')
    with pytest.raises(ValueError, match="ext_eta"):
        convert(tmp_path, text)

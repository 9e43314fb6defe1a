"""`ambilux view`: what it serves, and its page in Chromium."""

import io
import json
import re
import shutil
import signal
import socket
import struct
import subprocess
import sys
import time
import urllib.error
import urllib.request

import ambilux
import numpy as np
import pytest
from conftest import SCENES

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def start(*arguments):
    """A process, and what it says first."""
    process = subprocess.Popen([sys.executable, "-m", "ambilux.cli", "view", *map(str, arguments), "--backend", "cpu"], stderr=subprocess.PIPE, text=True)
    return process, process.stderr.readline()


@pytest.fixture(scope="module")
def viewer(tmp_path_factory):
    truth = tmp_path_factory.mktemp("view") / "truth.exr"
    ambilux.reference(SCENES / "glass.xml", truth, spp=64, size=(96, 72), seed=7, backend="cpu",
                      settings={"integrator": "bdpt", "variant": "lvc", "connections": 1})
    process, said = start(SCENES / "glass.xml", "--size", "96x72", "--port", 0, "--reference", truth)
    if "without cpp-httplib" in said:
        pytest.skip(said.strip())
    found = re.search(r"http://127\.0\.0\.1:\d+/", said)
    assert found, said
    yield found[0]
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=30) == 0


def post(url, value, headers=None):
    """Status, and the number of what is asked for or what is wrong with it."""
    request = urllib.request.Request(url, json.dumps(value).encode(), headers or {})
    try:
        with urllib.request.urlopen(request, timeout=20) as answer:
            return answer.status, json.load(answer)["asked"]
    except urllib.error.HTTPError as e:
        return e.code, e.read().decode()


def frame(url, wanted=lambda facts: True, seconds=30, query=""):
    """The first frame that is wanted, with pixels where they are no JPEG."""
    after, end = 0, time.monotonic() + seconds
    while time.monotonic() < end:
        with urllib.request.urlopen(f"{url}frame?after={after}{query}", timeout=20) as answer:
            body = answer.read()
        if not body:
            continue
        length, = struct.unpack_from("<I", body)
        facts = json.loads(body[4:4 + length])
        after = facts["frame"]
        if wanted(facts):
            pixels = np.frombuffer(body, np.uint8, offset=4 + length)
            return facts, pixels.reshape(facts["height"], facts["width"], 3) if facts["format"] == "rgb" else pixels.tobytes()
    raise AssertionError("no such frame")


def look(viewer, camera, wanted=lambda facts: True):
    """The first frame that is wanted from a camera that is asked for; what was rendered before it does not count."""
    status, asked = post(viewer + "camera", camera)
    assert status == 200, asked
    return frame(viewer, lambda f: f["asked"] >= asked and wanted(f))


def test_frames_become_the_image(viewer):
    facts, pixels = frame(viewer, lambda f: f["samples"] >= 256 and "error" in f)
    assert pixels.shape == (72, 96, 3) and facts["problem"] == "" and facts["method"] == "path wavefront"
    assert {"extend", "eye_vertex"} & {s["name"] for s in facts["stages"]} and facts["rays_per_second"] > 0
    assert 0 < facts["error"]["relmse_corrected"] < 10
    linear = ambilux.render(SCENES / "glass.xml", "bdpt", spp=32, size=(96, 72), backend="cpu").rgb.clip(0, 1)
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055) * 255
    assert abs(float(pixels.mean()) - float(srgb.mean())) < 8
    assert np.corrcoef(pixels.ravel(), srgb.ravel())[0, 1] > 0.8


def test_a_method_and_what_is_wrong_with_one(viewer):
    assert post(viewer + "method", [["integrator", "bdpt"], ["variant", "lvc"], ["connections", "1"]])[0] == 200
    facts, _ = frame(viewer, lambda f: f["method"] == "bdpt lvc" and f["samples"] > 0)
    assert "connect_vertices" in " ".join(s["name"] for s in facts["stages"]) or facts["stages"]
    status, said = post(viewer + "method", [["integrator", "magic"]])
    assert status == 400 and "magic" in said
    # Known, but refused by the renderer: the page says so, and the next choice works.
    assert post(viewer + "method", [["integrator", "path"], ["connections", "2"]])[0] == 200
    assert "connections" in frame(viewer, lambda f: f["problem"])[0]["problem"]
    assert post(viewer + "method", [["integrator", "path"]])[0] == 200
    frame(viewer, lambda f: not f["problem"] and f["method"] == "path wavefront" and f["samples"] > 1)


def test_the_camera_moves_and_returns(viewer):
    with urllib.request.urlopen(viewer + "scene") as answer:
        camera = json.load(answer)["camera"]
    _, before = frame(viewer, lambda f: f["samples"] >= 4)
    facts, moved = look(viewer, {**camera, "origin": [3.0, 1.5, 3.0]}, lambda f: f["samples"] >= 4 and f["width"] == 96)
    assert "error" not in facts
    assert np.abs(moved.astype(int) - before).mean() > 10
    # The camera of the file, said in other words, gives the same picture: the error is measured for the file's alone.
    _, same = look(viewer, camera, lambda f: f["samples"] >= 8 and f["width"] == 96)
    assert np.abs(same.astype(int) - before).mean() < 10
    for wrong in ({**camera, "target": camera["origin"]}, {"origin": [1, 2]}, {**camera, "up": [1e39, 0, 0]}):
        assert post(viewer + "camera", wrong)[0] == 400
    look(viewer, {"reset": True}, lambda f: "error" in f)


def test_a_picture_says_what_it_answers_and_what_it_took(viewer):
    with urllib.request.urlopen(viewer + "scene") as answer:
        camera = json.load(answer)["camera"]
    numbers = []
    for k in range(5):
        asked = post(viewer + "camera", {**camera, "origin": [3.0, 1.5, 3.0 + 0.1 * k], "moving": True})[1]
        facts, _ = frame(viewer, lambda f: f["asked"] >= asked)
        numbers.append(asked)
        assert facts["samples"] >= 1 and {"restart", "first_sample", "picture"} <= facts["picture_seconds"].keys()
    assert numbers == sorted(set(numbers))
    # The same camera at rest does not begin anew where the picture is whole already.
    assert look(viewer, {**camera, "origin": [3.0, 1.5, 3.4], "moving": False})[0]["width"] == 96
    look(viewer, {"reset": True})


def test_a_jpeg_shows_the_same_picture(viewer):
    image = pytest.importorskip("PIL.Image")
    facts, sent = frame(viewer, lambda f: f["samples"] >= 64, query="&as=jpeg&quality=95")
    assert facts["format"] == "jpeg" and facts["picture_seconds"]["jpeg"] > 0 and len(sent) < 96 * 72 * 3
    shown = np.asarray(image.open(io.BytesIO(sent)).convert("RGB")).astype(int)
    _, pixels = frame(viewer, lambda f: f["samples"] >= 64)
    assert shown.shape == pixels.shape and np.abs(shown - pixels).mean() < 6
    assert len(frame(viewer, query="&as=jpeg&quality=20")[1]) < len(sent)


def test_exposure_does_not_begin_anew(viewer):
    facts, before = frame(viewer, lambda f: f["samples"] >= 4)
    assert post(viewer + "exposure", {"stops": -3})[0] == 200
    end = time.monotonic() + 10
    while (later := frame(viewer))[1].mean() > 0.7 * before.mean() and time.monotonic() < end:
        time.sleep(0.02)
    assert later[1].mean() < 0.7 * before.mean() and later[0]["samples"] >= facts["samples"]
    assert post(viewer + "exposure", {"stops": 0})[0] == 200


def test_pages_of_others_are_refused(viewer):
    assert post(viewer + "camera", {"reset": True}, {"Origin": "http://example.org"})[0] == 403
    assert post(viewer + "camera", {"reset": True}, {"Host": "example.org"})[0] == 403


def test_a_taken_port_and_a_wrong_reference_are_told(viewer, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        process, said = start(SCENES / "cornell.xml", "--size", "8x8", "--port", taken.getsockname()[1])
        assert process.wait(timeout=60) == 4 and "the port is taken" in said
    ambilux.render(SCENES / "cornell.xml", spp=2, size=(8, 8), backend="cpu").save(tmp_path / "r.exr", stderr=True)
    process, said = start(SCENES / "cornell.xml", "--size", "8x9", "--port", 0, "--reference", tmp_path / "r.exr")
    assert process.wait(timeout=60) == 3 and "8x8" in said and "8x9" in said


@pytest.fixture
def page(viewer):
    if not CHROMIUM:
        pytest.skip("no Chromium (Debian: apt-get install chromium)")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1200, "height": 800})
        complaints = []
        page.on("pageerror", lambda e: complaints.append(str(e)))
        page.goto(viewer)
        page.wait_for_function("Number(document.body.dataset.samples) > 2", timeout=20000)
        yield page
        assert complaints == []
        browser.close()


def test_the_page_shows_orbits_and_chooses(page):
    picture = "(() => { const c = document.querySelector('canvas'); return [...c.getContext('2d').getImageData(0, 0, c.width, c.height).data].reduce((a, b) => a + b) / (c.width * c.height); })()"
    before = page.evaluate(picture)
    assert before > 300  # not black: alpha alone is 255
    box = page.locator("canvas").bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 330, box["y"] + 260, steps=4)
    page.mouse.up()
    page.wait_for_function("document.getElementById('facts').innerText.includes(\"for the file's camera\")", timeout=20000)
    assert abs(page.evaluate(picture) - before) > 1
    page.locator("#reset").click()
    page.wait_for_function("document.getElementById('facts').innerText.includes('relMSE')", timeout=20000)
    page.locator("#integrator").select_option("bdpt")
    page.wait_for_function("document.getElementById('facts').innerText.includes('bdpt wavefront')", timeout=20000)
    page.locator("#variant").select_option("lvc")
    page.wait_for_function("document.getElementById('facts').innerText.includes('bdpt lvc')", timeout=20000)
    page.locator("#more").fill("nonsense=1")
    page.locator("#more").press("Enter")
    page.wait_for_function("document.getElementById('problem').innerText.includes('nonsense')", timeout=20000)
    page.locator("#more").fill("")
    page.locator("#integrator").select_option("path")
    page.wait_for_function("document.getElementById('facts').innerText.includes('path wavefront') && !document.getElementById('problem').innerText", timeout=20000)
    assert page.locator("#stages tr").count() > 2


def test_the_page_fits_a_phone(page):
    page.set_viewport_size({"width": 390, "height": 844})
    page.wait_for_timeout(300)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    box = page.locator("canvas").bounding_box()
    assert box["y"] < 50 and box["width"] > 350

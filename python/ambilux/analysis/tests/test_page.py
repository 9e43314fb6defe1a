"""report.html: what is in it, and what it does in a real browser."""

import json
import math
import re
import shutil

import numpy as np
import pytest

from ambilux.analysis import __main__ as program
from ambilux.analysis import experiment, figures, hdr_data, images, remarks, report, summary
from ambilux.analysis.tests import synthetic

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = synthetic.make(tmp_path_factory.mktemp("results") / "run")
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["name"] = "a <b>bold</b> name"  # must not become markup
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder


@pytest.fixture(scope="module")
def page_file(folder, tmp_path_factory):
    """The page without figures, which other tests make."""
    out = tmp_path_factory.mktemp("out")
    data = experiment.load(folder)
    lines = summary.lines(data)
    program.write(out / "report.html", report.render(data, lines, remarks.remarks(data, lines), figures.Made(missing=[("x", "</script><i>")]), out))
    return out / "report.html"


def test_half_floats_survive_the_way():
    rng = np.random.default_rng(1)
    image = np.exp(rng.normal(0, 4, size=(7, 5, 3))).astype(np.float32)
    image[0, 0] = (np.nan, 1e9, -2.5)
    back = hdr_data.decode(hdr_data.encode(image), 7, 5)
    assert np.isnan(back[0, 0, 0]) and back[0, 0, 1] == 65504 and back[0, 0, 2] == -2.5
    assert back[1:] == pytest.approx(image[1:], rel=2**-11, abs=2**-25)


def test_wide_images_are_averaged():
    image = np.arange(24, dtype=np.float32).reshape(2, 4, 3)
    assert hdr_data.shrink(image, 2) == pytest.approx(image.mean(axis=(0, 1)).reshape(1, 1, 3) + np.array([[[-3]], [[3]]]).reshape(1, 2, 1))
    assert [hdr_data.factor_for(w) for w in (100, 1280, 1281, 3840)] == [1, 1, 2, 3]
    assert hdr_data.factor_for(1280, 720, 5) == 1 and hdr_data.factor_for(1280, 720, 30) == 2
    assert hdr_data.shrink(image, 1) is image


def test_page_is_self_contained_and_escaped(page_file):
    text = page_file.read_text()
    sources = re.findall(r'(?:src|href)="([^"]*)"', text)
    assert all(s.startswith(("data:image/png;base64,", "#")) for s in sources)
    outside = re.sub(r"http://www.w3.org/2000/svg", "", text)  # a name, not an address
    assert not re.search(r"https?://|<link|@import|url\(|fetch\(", outside)
    assert "a processor &lt;&amp;&gt;" in text and "a &lt;b&gt;bold&lt;/b&gt; name" in text
    assert text.count("<script") == text.count("</script>") == 4
    assert json.loads(report.as_json({"a": [float("nan"), "</script>"]})) == {"a": [None, "</script>"]}


@pytest.fixture(scope="module")
def browser():
    if not CHROMIUM:
        pytest.skip("no Chromium (Debian: apt-get install chromium)")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as p:
        try:
            started = p.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        except playwright.Error as e:
            pytest.skip(f"{CHROMIUM} does not start: {str(e).splitlines()[0]}")
        yield started
        started.close()


@pytest.fixture
def page(browser, page_file):
    page = browser.new_page(viewport={"width": 1200, "height": 900})
    complaints, requests = [], []
    page.on("pageerror", lambda e: complaints.append(str(e)))
    page.on("console", lambda m: complaints.append(m.text) if m.type == "error" else None)
    page.on("request", lambda r: requests.append(r.url))
    page.goto(page_file.as_uri())
    page.wait_for_selector(".viewer[data-ready]", timeout=20000)
    yield page
    assert complaints == []
    assert [u for u in requests if not u.startswith(("file:", "data:", "blob:"))] == []
    page.close()


def pixel(page, canvas, share=(0.51, 0.51)):
    """(r, g, b) of canvas number `canvas` of the first viewer at a place given as share of its size."""
    return page.evaluate("""([i, x, y]) => { const c = document.querySelectorAll('.viewer')[0].querySelectorAll('canvas')[i];
        return [...c.getContext('2d').getImageData(Math.floor(c.width * x), Math.floor(c.height * y), 1, 1).data].slice(0, 3); }""", [canvas, *share])


def expected(folder, run, share=(0.51, 0.51), stops=0):
    """What tone mapping in Python makes of the same pixel."""
    data = experiment.load(folder)
    reference = images.read_exr(data.reference("box"))
    image = reference if run is None else images.read_exr(data.image("box", run)[1])
    height, width = reference.shape[:2]
    return images.tone_map(image, images.exposure(reference) * 2**stops)[int(height * share[1]), int(width * share[0])]


def set_range(locator, value):
    locator.evaluate("(e, v) => { e.value = v; e.dispatchEvent(new Event('input')); }", str(value))


def test_images_are_shown_as_python_would(page, folder):
    viewer = page.locator(".viewer").first
    place = (0.3, 0.7)
    for i, run in enumerate((None, "naive", "nee", "mis")):
        viewer.locator(".tabs button").nth(i).click()
        assert pixel(page, 0, place) == pytest.approx(expected(folder, run, place), abs=1)


def test_exposure_slider(page, folder):
    viewer = page.locator(".viewer").first
    for stops in (-3, 0, 2):
        set_range(viewer.locator(".exposure"), stops)
        assert pixel(page, 0) == pytest.approx(expected(folder, None, stops=stops), abs=1)


def test_keys_flip_through_the_images(page):
    viewer = page.locator(".viewer").first
    viewer.locator("canvas").focus()
    for key, current in (("3", "2"), ("ArrowRight", "3"), ("ArrowRight", "0"), ("ArrowLeft", "3"), ("f", "0"), ("f", "3"), ("9", "3")):
        page.keyboard.press(key)
        assert viewer.get_attribute("data-current") == current, key


def test_zoom_and_pan_are_kept_in_step(page):
    viewer = page.locator(".viewer").first
    viewer.locator(".side").click()
    canvases = viewer.locator("canvas")
    assert canvases.count() == 4
    canvases.nth(1).scroll_into_view_if_needed()
    box = canvases.nth(1).bounding_box()
    x, y = box["x"] + 0.76 * box["width"], box["y"] + 0.51 * box["height"]
    page.mouse.move(x, y)
    told = viewer.locator(".readout").inner_text()
    page.mouse.wheel(0, -1000)
    page.wait_for_function("Number(document.querySelector('.viewer').dataset.zoom) > 2")
    page.mouse.move(x + 1, y)
    assert viewer.locator(".readout").inner_text().split(")")[0] == told.split(")")[0]  # what is under the mouse stays there
    before = [float(v) for v in viewer.get_attribute("data-centre").split(",")]
    page.mouse.down()
    page.mouse.move(x + 40, y + 20)
    page.mouse.up()
    after = [float(v) for v in viewer.get_attribute("data-centre").split(",")]
    assert after[0] < before[0] and after[1] < before[1]
    # All canvases show the same part: the red ramp of the picture (red = 0.2 + x) of the reference and of runs agrees up to their noise.
    shown = [pixel(page, i) for i in range(4)]
    assert max(abs(a - b) for c in shown for a, b in zip(c, shown[0])) < 90
    # Flipping keeps zoom and place.
    zoom, centre = viewer.get_attribute("data-zoom"), viewer.get_attribute("data-centre")
    viewer.locator(".side").click()
    viewer.locator(".tabs button").nth(2).click()
    assert (viewer.get_attribute("data-zoom"), viewer.get_attribute("data-centre")) == (zoom, centre)
    viewer.locator(".fit").click()
    assert viewer.get_attribute("data-zoom") == "1.0000"


def test_error_maps(page, folder):
    viewer = page.locator(".viewer").first
    viewer.locator("select.mode").select_option("relative")
    assert pixel(page, 0) == [0, 0, 4]  # the reference has none: the first colour of magma
    viewer.locator(".tabs button").nth(1).click()
    data = experiment.load(folder)
    reference = images.read_exr(data.reference("box"))
    maps = [images.relative_error(images.read_exr(data.image("box", run)[1]), reference) for run in data.runs]
    colours = images.colour_map(maps[0], images.highest_of(maps))
    assert pixel(page, 0) == pytest.approx(colours[18, 24], abs=6)
    viewer.locator("select.mode").select_option("signed")
    viewer.locator(".tabs button").nth(0).click()
    assert pixel(page, 0) == pytest.approx([247, 247, 246], abs=3)  # white: no difference
    set_range(viewer.locator(".scale"), -6)
    viewer.locator(".tabs button").nth(1).click()
    assert pixel(page, 0) != pytest.approx([247, 247, 246], abs=3)


def test_convergence_plot_tells_the_numbers(page, folder):
    plot = page.locator(".plot")
    assert plot.locator("path.line").count() == 3
    plot.locator(".legend button").first.click()
    assert plot.locator("path.line").count() == 2 and plot.locator(".legend button").first.get_attribute("aria-pressed") == "false"
    plot.locator("select.x").select_option("spp")
    plot.locator("select.y").select_option("relmse")
    plot.locator("select.scene").select_option("glass")
    plot.scroll_into_view_if_needed()
    line = plot.locator('path.line[data-run="mis"]')
    box = line.bounding_box()
    page.mouse.move(box["x"] + box["width"], box["y"] + box["height"])  # the last checkpoint
    told = plot.locator(".readout").inner_text()
    curve = summary.curve(experiment.load(folder), "glass", "mis", "relmse")
    match = re.match(r"mis: relMSE ([\d.]+)(?: \[([\d.]+), ([\d.]+)\])?, 64 spp, 0.128 s, 3 seeds", told)
    assert match, told
    # A band is told where the data support one.
    values = [curve.error[-1], curve.low[-1], curve.high[-1]]
    assert [float(v) for v in match.groups() if v] == pytest.approx([v for v in values if math.isfinite(v)], rel=0.01)


def ends(path):
    """((x, y), (x, y)) of the first and the last point of a path of lines."""
    points = [tuple(map(float, p.split())) for p in path.get_attribute("d").strip("M").split("L")]
    return points[0], points[-1]


def test_guide_of_the_convergence_plot_has_the_slope_that_it_says(page):
    """Errors of the synthetic runs fall as one over the root of time, so that all lines are parallel to the guide, also where the axis cuts it off."""
    plot = page.locator(".plot")
    plot.locator("select.y").select_option("rmse")
    for hidden in (0, 1):
        if hidden:
            plot.locator(".legend button").first.click()
        slopes = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in map(ends, [plot.locator("path.guide"), *plot.locator("path.line").all()])]
        assert slopes == pytest.approx([slopes[0]] * len(slopes), rel=0.03)


def test_page_fits_a_narrow_window(page):
    page.set_viewport_size({"width": 420, "height": 800})
    page.wait_for_timeout(400)
    assert page.evaluate("document.documentElement.scrollWidth") <= 420
    # The plot is drawn anew in that width, so that its words keep their size, and a finger on an image that is shown whole moves the page.
    assert page.evaluate("(() => { const s = document.querySelector('.plot .space > svg'); return s.viewBox.baseVal.width / s.getBoundingClientRect().width; })()") == pytest.approx(1, abs=0.02)
    assert page.evaluate("getComputedStyle(document.querySelector('.viewer canvas')).touchAction") == "pan-y"
    # The leading columns of the table fit; of all columns names stay in sight while it is moved.
    table = page.locator("table.results")
    assert table.evaluate("t => t.offsetWidth <= t.parentElement.clientWidth")
    assert not table.locator("th", has_text="slope").is_visible()
    page.locator("#every-column").check()
    assert table.locator("th", has_text="slope").is_visible() and table.evaluate("t => t.offsetWidth > t.parentElement.clientWidth")
    table.evaluate("t => { t.parentElement.scrollLeft = 1e4; }")
    box = table.locator("tbody td:nth-child(2)").first.bounding_box()
    assert 0 <= box["x"] < 60

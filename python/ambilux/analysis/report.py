"""report.html: one file with figures, tables, images at any exposure and the manifest. It loads nothing from anywhere."""

import base64
import html
import json
import math
import re
from pathlib import Path

from matplotlib import colormaps
from PIL import Image

from ambilux.analysis import captions, convergence, figures, flip_maps, hdr_data, images, peers, statistics, style, summary, tables, verdicts
from ambilux.analysis import remarks as remarks_of

PAGE = Path(__file__).parent / "page"
INTERACTIVE = ("convergence_", "comparison_", "errors_", "flip_")  # figures that the page shows in a way of its own


def page_file(name):
    return (PAGE / name).read_text(encoding="utf-8")


def as_json(value):
    """JSON that may stand inside a script element. NaN, which JSON lacks, is null."""
    def clean(x):
        if isinstance(x, dict):
            return {k: clean(v) for k, v in x.items()}
        if isinstance(x, (list, tuple)):
            return [clean(v) for v in x]
        return None if isinstance(x, float) and not math.isfinite(x) else x
    return json.dumps(clean(value), ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")


def table_of_colours(name):
    """256 colours of 8 bits."""
    return [[int(255 * c + 0.5) for c in colormaps[name](i / 255)[:3]] for i in range(256)]


def plot_data(experiment):
    """Curves for page/plot.js."""
    scenes = {}
    for scene in experiment.scenes:
        curves = {}
        for measure in summary.recorded(experiment):
            curves[measure] = {}
            for x in convergence.AXES:
                found = {run: c for run in experiment.runs if (c := summary.curve(experiment, scene, run, measure, x))}
                curves[measure][x] = {run: {"seconds": c.seconds.tolist(), "spp": c.spp.tolist(), "error": c.error.tolist(), "low": c.low.tolist(),
                                            "high": c.high.tolist(), "seeds": c.seeds} for run, c in found.items()}
        scenes[scene] = {"noise": summary.reference_noise(experiment, scene), "curves": curves}
    return {"runs": experiment.runs, "colours": list(style.COLOURS), "measures": {m: convergence.NAMES[m] for m in summary.recorded(experiment)}, "scenes": scenes}


def scene_data(experiment, scene, full_size=False):
    """Images of one scene for page/viewer.js: the reference and the lowest seed of each run; None without any."""
    path = experiment.reference(scene)
    files = [(run, p) for run in experiment.runs if (entry := experiment.image(scene, run)) for p in entry[1:]]
    if path is None and not files:
        return None
    reference = images.read_exr(path) if path else None
    like = reference if reference is not None else images.read_exr(files[0][1])
    pictures = [(run, images.read_like(p, like)) for run, p in files]
    every = ([("reference", reference)] if reference is not None else []) + pictures
    height, width = like.shape[:2]
    factor = 1 if full_size else hdr_data.factor_for(width, height, len(every) * len(experiment.scenes))
    small = [(name, hdr_data.shrink(p, factor)) for name, p in every]
    height, width = small[0][1].shape[:2]
    entries = [{"name": name, "data": hdr_data.encode(p)} for name, p in small]
    scale = 1.0
    if reference is not None:
        entries[0]["reference"] = True
        if pictures:
            scale = images.highest_of([images.relative_error(p, small[0][1]) for _, p in small[1:]])
        if flip_maps.flip_evaluator is not None:
            for entry, (_, file) in zip(entries[1:], files):
                try:
                    entry["flip"] = hdr_data.deflate(flip_maps.of_files(file, path, factor)[0].tobytes())
                except style.NotMade:
                    break
    return {"name": scene, "width": width, "height": height, "exposure": images.exposure(small[0][1]), "scale": scale, "shrunk": factor, "images": entries}


def scene_section(scene, data):
    out = [f"<h3>{html.escape(scene)}</h3>"]
    if data is None:
        return "\n".join([*out, '<p class="note">No images yet.</p>'])
    if data["shrunk"] > 1:
        out.append(f'<p class="note">Means of {data["shrunk"]}x{data["shrunk"]} pixels; the files in images/ have all of them, and so has a page made with --full-size.</p>')
    return "\n".join([*out, f'<div class="viewer" data-scene="{html.escape(scene)}"></div>'])


def facts(experiment):
    """A line about when, by what and on what, from the manifest."""
    m = experiment.manifest
    versions, machine = m.get("versions") or {}, m.get("machine") or {}
    devices = [d for d in m.get("devices") or [] if d]
    parts = [m.get("date"), versions.get("ambilux") and f"Ambilux {versions['ambilux']} ({versions.get('git_revision', 'revision unknown')})",
             ", ".join(devices + [machine["cpu"]] if machine.get("cpu") else devices), ", ".join(m.get("backends") or []) and "backend " + ", ".join(m["backends"]),
             f"seeds {', '.join(map(str, m['seeds']))}" if m.get("seeds") else None]
    return " · ".join(html.escape(str(p)) for p in parts if p)


def reference_table(experiment):
    """How each scene's reference was made, and what is known of the clocks."""
    rows = "".join(f"<tr><td>{html.escape(scene)}</td><td>{html.escape(captions.reference_facts(experiment.scene_entry(scene).get('reference') or {}) or 'not recorded')}</td></tr>"
                   for scene in experiment.scenes)
    clocks = remarks_of.clock_text(experiment)
    return ('<table class="said"><thead><tr><th>scene</th><th>reference</th></tr></thead><tbody>' + rows + "</tbody></table>"
            + (f'<p class="note">Clocks: {html.escape(clocks)}.</p>' if clocks else ""))


def figure(out, name, title, caption):
    # 7 inches, the page of a paper, are as wide as the page here.
    with Image.open(out / f"{name}.png") as picture:
        width = round(picture.width / style.DPI / style.PAGE * 1100)
    large = ' class="large"' if width > 700 else ""  # too much for a telephone: it can be moved there
    uri = "data:image/png;base64," + base64.b64encode((out / f"{name}.png").read_bytes()).decode()
    return (f'<figure id="{html.escape(name)}"><h3>{html.escape(title)}</h3><div class="sheet"><img src="{uri}" alt="{html.escape(title)}" width="{width}"{large}></div><figcaption>{html.escape(caption)} '
            f"<code>{html.escape(name)}.pdf</code></figcaption></figure>")


def verdict_table(lines):
    """A row for each run; runs of a scene of which the same is said share one."""
    runs = {}
    for (scene, run), said in verdicts.verdicts(lines).items():
        runs.setdefault((scene, *said), []).append(run)
    rows = [f"<tr><td>{tables.breakable(scene)}</td><td>{', '.join(map(tables.breakable, names))}</td><td>{html.escape(tables.minus(slope))}</td><td>{html.escape(tables.minus(bias))}</td></tr>"
            for (scene, slope, bias), names in runs.items()]
    return ('<table class="said verdicts"><thead><tr><th>scene</th><th>run</th><th>convergence</th><th>bias</th></tr></thead><tbody>' + "".join(rows) + "</tbody></table>")


def render(experiment, lines, remarks, made, out, full_size=False):
    """The page as text. `made`: figures.Made, whose PNG files lie in the folder `out`. full_size: large images are not averaged over blocks."""
    name = html.escape(experiment.name)
    scenes = {scene: figures.apart(made, f"images of {scene}", lambda scene=scene: scene_data(experiment, scene, full_size)) for scene in experiment.scenes}
    data = {"plot": plot_data(experiment), "scenes": {k: v for k, v in scenes.items() if v},
            "colours": {"error": table_of_colours(style.ERROR_COLOURS), "signed": table_of_colours(style.SIGNED_COLOURS)}}
    body = [f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
            f"<title>{name}</title><style>{page_file('report.css')}</style></head><body>", f"<h1>{name}</h1>", f'<p class="facts">{facts(experiment)}</p>',
            '<nav><a href="#images">Images</a><a href="#convergence">Convergence</a><a href="#table">Table</a><a href="#references">References</a><a href="#figures">Figures</a>'
            '<a href="#manifest">Manifest</a></nav>']
    if remarks:
        body += ['<div class="remarks"><b>Before you believe the figures</b><ul>', *(f"<li>{html.escape(tables.minus(r))}</li>" for r in remarks), "</ul></div>"]
    body += ['<h2 id="images">Images</h2>', '<p class="note">Of the lowest seed, at the end of the run. Wheel: zoom; drag: pan; double click: twice as large. '
             "With an image focused: 1–9 or ← → change it, f flips to the one before.</p>"]
    body += [scene_section(scene, found) for scene, found in scenes.items()]
    body += ['<h2 id="convergence">Convergence</h2>', '<div class="plot"></div>',
             '<p class="note">Lines: arithmetic mean over seeds (RMSE: root of the mean of squares); bands: its 95 % interval over seeds, where the data support one. The noise of the reference is subtracted where it is known. '
             f"{html.escape(summary.rows_used(experiment))}</p>",
             '<h2 id="table">Table</h2>', f'<div>{tables.to_html(experiment, lines)}{tables.marks_html(experiment, lines)}</div>',
             f'<details class="note"><summary>How these numbers are made</summary><p>{html.escape(tables.caption(experiment, lines))} '
             "Bias |z|: the greatest over seeds of the standardised difference between the image's mean and the reference's.</p></details>",
             f'<div class="wide">{verdict_table(lines)}</div>',
             '<p class="note">Slope of log RMSE against log samples, over checkpoints in samples (over all, if the experiment has one kind) above the noise of the '
             "reference. Bias: mean over seeds of the difference of means at the checkpoint of the table; its interval includes the noise of the reference. A departure is claimed where chance alone makes it, or any other "
             f"statement of the tables, in less than 1 % of such reports. “Would have been”: with a chance of {statistics.POWER:.0%} at that level. A test that could not find a slope of {verdicts.WEAK - 0.5:g} is not counted as one.</p>".replace("0%", "0 %")]
    body += ['<h2 id="references">References</h2>', f'<div class="wide">{reference_table(experiment)}</div>']
    if peers.entries(experiment):
        body += ['<h2 id="peers">Other renderers</h2>', f'<div class="wide">{peers.to_html(experiment)}</div>', f'<p class="note">{html.escape(peers.NOTE)}</p>']
    body.append('<h2 id="figures">Figures</h2>')
    body += [figure(out, *entry) for entry in made.pictures if not entry[0].startswith(INTERACTIVE)]
    others = [n for n, _, _ in made.pictures if n.startswith(INTERACTIVE)]
    if others:
        body.append(f'<p class="note">As files only, since the page has them above in another form: {html.escape(", ".join(others))}.</p>')
    if made.missing or made.broken:
        body += ['<p class="note">Not made:</p><ul class="note">', *(f"<li>{html.escape(n)}: {html.escape(why)}</li>" for n, why in made.missing),
                 *(f"<li>{html.escape(message)}</li>" for message in made.broken), "</ul>"]
    manifest = html.escape(json.dumps(experiment.manifest, indent=2, ensure_ascii=False))
    body += ['<h2 id="manifest">Manifest</h2>', f"<details><summary>manifest.json</summary><pre>{manifest}</pre></details>",
             f'<script type="application/json" id="data">{as_json(data)}</script>',
             *(f"<script>{page_file(f)}</script>" for f in ("viewer.js", "plot.js", "start.js")), "</body></html>\n"]
    return "\n".join(body)

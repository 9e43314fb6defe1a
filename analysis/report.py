"""report.html: one file that holds figures, table, pictures and manifest."""

import base64
import html
import json
from pathlib import Path

import numpy as np

from analysis import images, tables

STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, sans-serif; color: #222; background: #fff; max-width: 1100px; margin: 2em auto; padding: 0 1em; }
h1 { font-size: 1.5em; margin-bottom: .2em; } h2 { font-size: 1.2em; margin-top: 2em; border-bottom: 1px solid #ddd; } h3 { font-size: 1em; margin-bottom: .4em; }
.facts, .note { color: #555; font-size: .9em; }
.remarks { background: #fff6e0; border-left: 4px solid #e69f00; padding: .5em 1em; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .85em; font-variant-numeric: tabular-nums; border-top: 2px solid #222; border-bottom: 2px solid #222; }
th, td { padding: .25em .7em; text-align: right; white-space: nowrap; } th:nth-child(-n+2), td:nth-child(-n+2) { text-align: left; }
thead { border-bottom: 1px solid #222; } tr.first td { border-top: 1px solid #ccc; }
.figure { max-width: 100%; }
.pictures { display: flex; flex-wrap: wrap; gap: 12px; } figure { margin: 0; } figcaption { font-size: .85em; }
.pictures img { display: block; width: 256px; image-rendering: auto; }
.bar { display: inline-block; width: 160px; height: .8em; vertical-align: middle; margin: 0 .4em; }
pre { font-size: .8em; background: #f6f6f6; padding: 1em; overflow-x: auto; }
"""


def picture(caption, pixels):
    name = html.escape(caption)
    return f'<figure><img src="{images.png_uri(pixels)}" alt="{name}"><figcaption>{name}</figcaption></figure>'


def file_uri(path, kind):
    return f"data:{kind};base64," + base64.b64encode(Path(path).read_bytes()).decode()


def scene_section(experiment, scene):
    """Reference, renderings and error maps of one scene, as far as there are files."""
    out = [f"<h3>{html.escape(scene)}</h3>"]
    reference_path = experiment.reference(scene)
    pictures = {run: images.read_exr(path) for run in experiment.runs if (path := experiment.image(scene, run))}
    if reference_path is None and not pictures:
        return "\n".join([*out, '<p class="note">No images yet.</p>'])
    reference = images.read_exr(reference_path) if reference_path else None
    factor = images.exposure(reference if reference is not None else next(iter(pictures.values())))
    shown = [("reference", reference)] if reference is not None else []
    shown += pictures.items()
    out.append(f'<p class="note">Shown at {tables.number(factor)} times the recorded radiance, sRGB.</p><div class="pictures">')
    out += [picture(name, images.tone_map(pixels, factor)) for name, pixels in shown]
    out.append("</div>")
    maps = {run: images.relative_error(p, reference) for run, p in pictures.items() if reference is not None and p.shape == reference.shape}
    if maps:
        # One scale for all runs of a scene, so that brightness compares; the brightest 1 % are cut.
        highest = max(1e-6, float(np.nanpercentile(np.stack(list(maps.values())), 99)))
        bar = f'0<span class="bar" style="background: {images.colour_bar_css()}"></span>{tables.number(highest, 2)} and above'
        out.append(f'<p class="note">Error |x − r| / (|r| + 0.01), mean of the channels: {bar}</p><div class="pictures">')
        out += [picture(f"{run}: error", images.colour_map(m, highest)) for run, m in maps.items()]
        out.append("</div>")
    return "\n".join(out)


def facts(experiment):
    """A line about when, by what and on what, from the manifest."""
    m = experiment.manifest
    versions, machine = m.get("versions") or {}, m.get("machine") or {}
    devices = [d for d in m.get("devices") or [] if d]
    parts = [m.get("date"), versions.get("ambilux") and f"Ambilux {versions['ambilux']} ({versions.get('git_revision', 'revision unknown')})",
             ", ".join(devices) or machine.get("cpu"), ", ".join(m.get("backends") or []) and "backend " + ", ".join(m["backends"]),
             f"seeds {', '.join(map(str, m['seeds']))}" if m.get("seeds") else None]
    return " · ".join(html.escape(str(p)) for p in parts if p)


def render(experiment, lines, remarks, figures):
    """The page as text. `figures`: (title, PNG path) pairs."""
    name = html.escape(str(experiment.manifest.get("name", experiment.folder.name)))
    out = [f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
           f"<title>{name}</title><style>{STYLE}</style></head><body>", f"<h1>{name}</h1>", f'<p class="facts">{facts(experiment)}</p>']
    if remarks:
        out += ['<div class="remarks"><b>Before you believe the figures</b><ul>', *(f"<li>{html.escape(r)}</li>" for r in remarks), "</ul></div>"]
    out.append("<h2>Convergence</h2>")
    for title, path in figures:
        out.append(f'<figure><img class="figure" src="{file_uri(path, "image/png")}" alt="{html.escape(title)}"><figcaption class="note">{html.escape(title)}</figcaption></figure>')
    out += ["<h2>Table</h2>", f'<div class="wide">{tables.to_html(lines, experiment.runs[0])}</div>', f'<p class="note">{html.escape(tables.CAPTION)} '
            "Bias |z|: the greatest over seeds of the standardised difference between the image's mean and the reference's.</p>", "<h2>Images</h2>",
            '<p class="note">Of the first seed, at the end of the run.</p>']
    out += [scene_section(experiment, scene) for scene in experiment.scenes]
    manifest = html.escape(json.dumps(experiment.manifest, indent=2, ensure_ascii=False))
    out += ["<h2>Manifest</h2>", f"<details><summary>manifest.json</summary><pre>{manifest}</pre></details>", "</body></html>\n"]
    return "\n".join(out)

"""stress.html: the states of all cells as tables, what each limit covers, and the figures. It loads nothing from anywhere."""

import html

from ambilux.analysis.report import figure, page_file
from ambilux.analysis.stress_maps import STATES
from ambilux.analysis.stress_sweep import VERDICTS, backend_differences, disagreeing, limits, measured
from ambilux.analysis.tables import minus

CSS = """
table.map { border: 0; font-size: .72em; margin-bottom: 1em; } table.map td, table.map th { padding: 0 .3em; text-align: center; border: 1px solid #e4e4e4; }
table.map th { font-weight: normal; border: 0; } table.map th:first-child { text-align: right; } table.map thead th { writing-mode: vertical-rl; text-align: left; padding: .3em 0; }
table.map td.gap, table.map th.gap { border: 0; min-width: .8em; } table.map { border: 0; } .key span { display: inline-block; padding: 0 .6em; margin: 0 .6em .3em 0; border: 1px solid #ccc; }
"""


def tip(row):
    """What a pointer over a field shows."""
    if not measured(row):
        return row["note"] or row["verdict"]
    parts = [f"mean {row['mean']:.6g} ± {row['standard_error']:.2g}", f"expected {row['expected']:.6g}", f"bias {100 * row['relative_bias']:.3g} %", f"z {row['z']:.3g}"]
    if row["box_z"]:
        parts.append(f"box z {row['box_z']:.3g}")
    if row["variance_ratio"]:
        parts.append(f"variance x {row['variance_ratio']:.3g}")
    parts += [f"{int(row[name])} {name}" for name in ("invalid", "lost", "underflow") if row[name]]
    return "; ".join([*parts, f"{row['paths']:.3g} paths", *([row["note"]] if row["note"] else [])])


def field(row):
    if row is None:
        return "<td></td>"
    letter, colour, _ = STATES[row["verdict"]]
    return f'<td style="background:{colour}" title="{html.escape(tip(row), quote=True)}">{letter}</td>'


def with_gaps(columns, fields, tag):
    out = []
    for i, (column, text) in enumerate(zip(columns, fields)):
        if i and column[0] != columns[i - 1][0]:
            out.append(f'<{tag} class="gap"></{tag}>')
        out.append(text)
    return "".join(out)


def family_table(sweep, family, cells):
    columns = sweep.columns
    head = with_gaps(columns, [f"<th>{html.escape(b)} {html.escape(m)}</th>" for b, m in columns], "th")
    rows = [f"<tr><th>{html.escape(cell[len(family) + 1:])}</th>{with_gaps(columns, [field(sweep.rows.get((*c, cell))) for c in columns], 'td')}</tr>" for cell in cells]
    return f'<h3 id="{html.escape(family)}">{html.escape(family)}</h3><div class="wide"><table class="map"><thead><tr><th></th>{head}</tr></thead><tbody>{"".join(rows)}</tbody></table></div>'


def counts_table(sweep, before):
    """Rows of each state; with `before`, those of an earlier sweep first."""
    def entry(verdict, backend):
        now = sweep.count(verdict, backend)
        return f"{before.count(verdict, backend)} → {now}" if before else str(now)
    head = "".join(f"<th>{html.escape(v)}</th>" for v in VERDICTS)
    rows = "".join(f"<tr><td>{html.escape(b)}</td>{''.join(f'<td>{entry(v, b)}</td>' for v in VERDICTS)}</tr>" for b in sweep.backends)
    return f"<table><thead><tr><th>backend</th>{head}</tr></thead><tbody>{rows}</tbody></table>"


def said_table(head, rows):
    return ('<div class="wide"><table class="said"><thead><tr>' + "".join(f"<th>{html.escape(h)}</th>" for h in head) + "</tr></thead><tbody>"
            + "".join("<tr>" + "".join(f"<td>{html.escape(minus(str(x)))}</td>" for x in row) + "</tr>" for row in rows) + "</tbody></table></div>")


def off_rows(sweep, verdicts):
    return [(r["family"], r["cell"][len(r["family"]) + 1:], r["method"], r["backend"], r["verdict"], f"{100 * r['relative_bias']:.3g} %", f"{r['z']:.3g}", f"{r['box_z']:.3g}", r["note"])
            for r in sweep.rows.values() if r["verdict"] in verdicts]


def changes(sweep, before):
    return [(b, m, cell, before.rows[key]["verdict"], row["verdict"]) for key, row in sweep.rows.items() for b, m, cell in [key]
            if key in before.rows and before.rows[key]["verdict"] != row["verdict"]]


def render(sweep, before, pictures, out):
    """The page as text. `pictures`: of stress_maps, whose PNG files lie in the folder `out`."""
    ours = [b for b in sweep.backends if b in ("cpu", "cuda")]
    body = [f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>Stress sweep</title>'
            f"<style>{page_file('report.css')}{CSS}</style></head><body><h1>Stress sweep</h1>",
            f'<p class="facts">{len(sweep.rows)} rows: {sum(map(len, sweep.families.values()))} cells of {len(sweep.families)} families, '
            f"{len(sweep.columns)} methods on {html.escape(', '.join(sweep.backends))}. docs/stress.md says how a row is judged.</p>", counts_table(sweep, before)]
    wrong = off_rows(sweep, ("failed", "invalid", "refused"))
    body.append("<h2>Wrong, invalid or refused</h2>")
    body.append(said_table(("family", "cell", "method", "backend", "state", "bias", "z", "box z", "note"), wrong) if wrong else '<p class="note">None.</p>')
    if found := limits(sweep):
        body += ["<h2>Known limits that were met</h2>", said_table(("section of docs/numerics.md", "family", "backend", "cells", "largest bias"),
                 [(name, family, b, ", ".join(c[len(family) + 1:] for c in cells), f"{100 * worst:.3g} %") for name, family, b, cells, worst in found])]
    if len(ours) == 2:
        differences = backend_differences(sweep)
        apart = disagreeing(differences)
        body += ["<h2>CPU against CUDA</h2>", f'<p class="note">{len(differences)} rows were measured on both; {len(apart)} differ at the level of five standard deviations, '
                 "corrected for all of them.</p>"]
        if apart:
            body.append(said_table(("method", "cell", "z", "relative difference at equal samples"), [(m, c, f"{z:.3g}", f"{d:.3g}") for m, c, z, _, d in apart]))
    if before and (changed := changes(sweep, before)):
        body += ["<h2>Changed since the earlier sweep</h2>", said_table(("backend", "method", "cell", "before", "now"), changed)]
    key = "".join(f'<span style="background:{STATES[v][1]}">{STATES[v][0]} {html.escape(STATES[v][2])}</span>' for v in VERDICTS)
    body += ["<h2>All cells</h2>", f'<p class="key">{key}</p><p class="note">A pointer over a field shows its numbers.</p>']
    body += [family_table(sweep, family, cells) for family, cells in sweep.families.items()]
    body += ["<h2>Figures</h2>", *(figure(out, p.name, p.title, p.caption) for p in pictures), "</body></html>\n"]
    return "\n".join(body)

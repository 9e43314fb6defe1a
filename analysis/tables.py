"""The table of an experiment as CSV, LaTeX (booktabs) and HTML."""

import csv
import html
import io
import math

CAPTION = (
    "Each run at the last checkpoint that all runs of the scene have reached. RMSE, relMSE and efficiency are geometric means over "
    "seeds, with the noise of the reference subtracted where it is known; time is the arithmetic mean, inside the renderer. "
    "Efficiency is 1 / (relMSE · time). The speed-up is the ratio of efficiencies to the first run, with a 95 % interval from pairs of equal "
    "seeds. The slope is that of log RMSE against log time, fitted for each seed; ± is the standard error of the mean over seeds "
    "(with one seed that of the fit, which is then too small)."
)


def number(x, digits=3):
    """Three significant digits without an exponent where that is readable; an en dash for unknown."""
    if x is None or math.isnan(x):
        return "–"
    if x == 0 or math.isinf(x):
        return f"{x:g}"
    if 1e-4 <= abs(x) < 1e6:
        places = max(0, digits - 1 - math.floor(math.log10(abs(x))))
        return f"{x:.{places}f}"
    return f"{x:.{digits - 1}e}"


def speedup_text(line, is_first):
    s = line.speedup
    if is_first:
        return "1"
    if s is None:
        return "–"
    return number(s.value) if math.isnan(s.low) else f"{number(s.value)} [{number(s.low, 2)}, {number(s.high, 2)}]"


def slope_text(line):
    s = line.slope
    if s is None:
        return "–"
    return f"{s.value:.3f}" if math.isnan(s.error) else f"{s.value:.3f} ± {s.error:.3f}"


def cells(line, is_first):
    """What a person reads, in the order of HEADINGS."""
    return [line.scene, line.run, str(line.seeds), number(line.spp), number(line.seconds), number(line.rmse), number(line.relmse), number(line.efficiency),
            speedup_text(line, is_first), slope_text(line)]


HEADINGS = ("scene", "run", "seeds", "spp", "time (s)", "RMSE", "relMSE", "efficiency", "speed-up [95 %]", "slope")


def to_csv(lines):
    """All numbers in full precision, for further work."""
    columns = ("scene", "run", "seeds", "spp", "seconds", "rmse", "relmse", "relmse_low", "relmse_high", "mape", "rays_per_second", "efficiency")
    estimates = ("speedup", "slope")
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([*columns, *(f"{e}{part}" for e in estimates for part in ("", "_error", "_low", "_high")), "bias_z", "invalid"])
    for line in lines:
        row = [getattr(line, c) for c in columns]
        for name in estimates:
            e = getattr(line, name)
            row += [e.value, e.error, e.low, e.high] if e else [math.nan] * 4
        writer.writerow([f"{v:.9g}" if isinstance(v, float) else v for v in [*row, line.bias_z, line.invalid]])
    return out.getvalue()


def latex_escape(text):
    special = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"} | {c: "\\" + c for c in "&%$#_{}"}
    symbols = {"±": r"$\pm$", "–": "--", "−": "$-$", "·": r"$\cdot$"}
    return "".join(special.get(c) or symbols.get(c) or c for c in text)


def latex_number(text):
    """Typesets minus signs and powers of ten of a cell."""
    if "e" in text and text.replace("e", "").replace(".", "").replace("-", "").replace("+", "").isdigit():
        mantissa, exponent = text.split("e")
        return rf"${mantissa}\cdot 10^{{{int(exponent)}}}$"
    return "$-$" + latex_escape(text[1:]) if text.startswith("-") and text != "-" else latex_escape(text)


def to_latex(lines, first_run):
    """A tabular for \\usepackage{booktabs}; scenes are separated by \\midrule, the best efficiency of each scene is bold."""
    out = [r"% Needs \usepackage{booktabs}. " + latex_escape(CAPTION), r"\begin{tabular}{ll" + "r" * (len(HEADINGS) - 2) + "}", r"\toprule",
           " & ".join(latex_escape(h) for h in HEADINGS) + r" \\"]
    scene = None
    for line in lines:
        row = [latex_escape(c) for c in cells(line, line.run == first_run)[:2]] + [latex_number(c) for c in cells(line, line.run == first_run)[2:]]
        if line.scene != scene:
            out.append(r"\midrule")
        else:
            row[0] = ""
        scene = line.scene
        if line is best(lines, scene):
            row[7] = rf"\textbf{{{row[7]}}}"
        out.append(" & ".join(row) + r" \\")
    return "\n".join([*out, r"\bottomrule", r"\end{tabular}", ""])


def best(lines, scene):
    """The most efficient line of a scene; None if it has only one."""
    rows = [line for line in lines if line.scene == scene and math.isfinite(line.efficiency)]
    return max(rows, key=lambda line: line.efficiency) if len(rows) > 1 else None


def to_html(lines, first_run):
    head = "".join(f"<th>{html.escape(h)}</th>" for h in (*HEADINGS, "Mrays/s", "bias |z|"))
    out = [f"<table><thead><tr>{head}</tr></thead><tbody>"]
    scene = None
    for line in lines:
        row = [html.escape(c).replace("-", "−") if i > 1 else html.escape(c) for i, c in enumerate(cells(line, line.run == first_run))]
        row += [number(line.rays_per_second / 1e6), f"{line.bias_z:.1f}"]
        if line is best(lines, line.scene):
            row[7] = f"<b>{row[7]}</b>"
        kind = ' class="first"' if line.scene != scene else ""
        scene = line.scene
        out.append(f"<tr{kind}>" + "".join(f"<td>{c}</td>" for c in row) + "</tr>")
    return "\n".join([*out, "</tbody></table>"])

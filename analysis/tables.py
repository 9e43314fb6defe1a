"""The table of an experiment as CSV, LaTeX (booktabs) and HTML."""

import csv
import html
import io
import math
import re

from analysis import summary

CAPTION = (
    "Each run at the last checkpoint that all runs of the scene have reached, of those in seconds if the experiment has both kinds. RMSE, relMSE and efficiency are geometric means over seeds, with "
    "the noise of the reference subtracted where it is known (RMSE weighs bright pixels, relMSE all alike, and methods may rank differently by "
    "them); time is the arithmetic mean, inside the renderer. Efficiency is 1 / (relMSE · time). The speed-up over {base} is the ratio of times"
    " to equal RMSE, with a 95 % interval from pairs of equal seeds; a star marks times extrapolated by more than a factor of 4, a dagger that "
    "the mean of one of both runs is off by more than chance allows. The slope is that of log RMSE against log samples, fitted for each seed; ±"
    " is the standard error of the mean over seeds (with one seed that of the fit, which is then too small)."
)
TRIMMED_CAPTION = (" Trimmed relMSE leaves out the worst {share} of the pixels; ×N is relMSE over it, mean over seeds. It is no estimate of relMSE: a method that finds light only "
                   "in rare outliers looks better by it than it is.")


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


def interval(e):
    return number(e.value) if math.isnan(e.low) else f"{number(e.value)} [{number(e.low, 2)}, {number(e.high, 2)}]"


def speedup_text(line, base, biased):
    if line.run == base:
        return "1"
    if line.speedup is None:
        return "–"
    return interval(line.speedup.estimate) + summary.marks(line.speedup, (line.scene, line.run) in biased or (line.scene, base) in biased)


def slope_text(line):
    s = line.slope
    if s is None:
        return "–"
    return f"{s.value:.3f}" if math.isnan(s.error) else f"{s.value:.3f} ± {s.error:.3f}"


def trimmed_text(line):
    return number(line.trimmed.value) + (f" (×{number(line.few_pixels.value, 2)})" if line.few_pixels else "")


# What a person reads: heading and text of a line, which also takes base and summary.biased.
COLUMNS = {
    "scene": lambda line, *_: line.scene, "run": lambda line, *_: line.run, "seeds": lambda line, *_: str(line.seeds), "spp": lambda line, *_: number(line.spp),
    "time (s)": lambda line, *_: number(line.seconds), "RMSE": lambda line, *_: number(line.rmse.value), "relMSE": lambda line, *_: number(line.relmse.value),
    "trimmed relMSE": lambda line, *_: trimmed_text(line), "efficiency": lambda line, *_: number(line.efficiency.value), "speed-up [95 %]": speedup_text,
    "slope": lambda line, *_: slope_text(line),
}


def has_trimmed(lines):
    return any(not math.isnan(line.trimmed.value) for line in lines)


def headings(lines):
    """Those of COLUMNS for which there are numbers."""
    return [h for h in COLUMNS if h != "trimmed relMSE" or has_trimmed(lines)]


def cells(line, base, biased, shown):
    """Texts of the columns `shown`."""
    return [COLUMNS[h](line, base, biased) for h in shown]


def caption(experiment, lines):
    return CAPTION.format(base=experiment.base) + (TRIMMED_CAPTION.format(share=summary.trimmed_share(experiment)) if has_trimmed(lines) else "")


def to_csv(lines):
    """All numbers in full precision, for further work. Of each estimate: value, standard error (of the logarithm, but for slope and bias), ends of the interval."""
    columns = ("scene", "run", "seeds", "spp", "seconds", "mape", "rays_per_second", "bias_z", "invalid")
    estimates = {
        "rmse": lambda x: x.rmse, "relmse": lambda x: x.relmse, "relmse_trimmed": lambda x: x.trimmed, "relmse_over_trimmed": lambda x: x.few_pixels,
        "efficiency": lambda x: x.efficiency, "efficiency_ratio": lambda x: x.gain,
        "speedup": lambda x: x.speedup and x.speedup.estimate, "slope": lambda x: x.slope, "slope_time": lambda x: x.slope_time,
        "bias": lambda x: x.bias and x.bias.estimate,
    }
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([*columns, *(f"{e}{part}" for e in estimates for part in ("", "_error", "_low", "_high")), "speedup_at_rmse", "speedup_extrapolated", "bias_p"])
    for line in lines:
        row = [getattr(line, c) for c in columns]
        for get in estimates.values():
            e = get(line)
            row += [e.value, e.error, e.low, e.high] if e else [math.nan] * 4
        row += [line.speedup.target, line.speedup.extrapolated] if line.speedup else [math.nan] * 2
        row.append(line.bias.p if line.bias else math.nan)
        writer.writerow([f"{v:.9g}" if isinstance(v, float) else v for v in row])
    return out.getvalue()


def variances_to_csv(rows):
    """`rows`: (scene, run, s, t, Estimate, share, seeds)."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["scene", "run", "s", "t", "variance", "variance_error", "variance_low", "variance_high", "share", "seeds"])
    for scene, run, s, t, e, share, seeds in rows:
        writer.writerow([scene, run, s, t, *(f"{v:.9g}" for v in (e.value, e.error, e.low, e.high, share)), seeds])
    return out.getvalue()


def latex_escape(text):
    special = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"} | {c: "\\" + c for c in "&%$#_{}"}
    symbols = {"±": r"$\pm$", "–": "--", "−": "$-$", "·": r"$\cdot$", "†": r"$^\dagger$", "≥": r"$\geq$", "×": r"$\times$"}
    return "".join(special.get(c) or symbols.get(c) or c for c in text)


def latex_number(text):
    """Typesets minus signs and powers of ten of a cell."""
    match = re.fullmatch(r"(-?[\d.]+)e([-+]\d+)", text)
    if match:
        return rf"${match[1]}\cdot 10^{{{int(match[2])}}}$"
    return "$-$" + latex_escape(text[1:]) if text.startswith("-") and text != "-" else latex_escape(text)


def to_latex(experiment, lines):
    """A tabular for \\usepackage{booktabs}; scenes are separated by \\midrule, the best efficiency of each scene is bold."""
    shown = headings(lines)
    out = [r"% Needs \usepackage{booktabs}. " + latex_escape(caption(experiment, lines)), r"\begin{tabular}{ll" + "r" * (len(shown) - 2) + "}", r"\toprule",
           " & ".join(latex_escape(h) for h in shown) + r" \\"]
    scene, biased = None, summary.biased(lines)
    for line in lines:
        row = cells(line, experiment.base, biased, shown)
        row = [latex_escape(c) for c in row[:2]] + [latex_number(c) for c in row[2:]]
        if line.scene != scene:
            out.append(r"\midrule")
        else:
            row[0] = ""
        scene = line.scene
        if line is best(lines, scene):
            row[shown.index("efficiency")] = rf"\textbf{{{row[shown.index('efficiency')]}}}"
        out.append(" & ".join(row) + r" \\")
    return "\n".join([*out, r"\bottomrule", r"\end{tabular}", ""])


def best(lines, scene):
    """The most efficient line of a scene; None if it has only one."""
    rows = [line for line in lines if line.scene == scene and math.isfinite(line.efficiency.value)]
    return max(rows, key=lambda line: line.efficiency.value) if len(rows) > 1 else None


TEST_HEADINGS = ("scene", "run", "slope [95 %]", "bias [95 %]", "p of the bias", "greatest |z|")


def test_cells(line):
    """What was found on convergence and bias."""
    s, b = line.slope, line.bias
    slope = "–" if s is None else f"{s.value:.3f}" if math.isnan(s.low) else f"{s.value:.3f} [{s.low:.3f}, {s.high:.3f}]"
    bias = "–" if b is None else f"{b.estimate.value:+.1e} [{b.estimate.low:+.1e}, {b.estimate.high:+.1e}]"
    return [line.scene, line.run, slope, bias, "–" if b is None else f"{b.p:.2g}", f"{line.bias_z:.1f}"]


def tests_to_latex(lines):
    """A tabular of slopes and bias for \\usepackage{booktabs}."""
    out = [r"% Needs \usepackage{booktabs}. Slope of log RMSE against log samples (over checkpoints in samples if there are both kinds), -1/2 without bias; mean difference to the reference over seeds at the checkpoint of the table, its noise included.",
           r"\begin{tabular}{llrrrr}", r"\toprule", " & ".join(latex_escape(h) for h in TEST_HEADINGS) + r" \\"]
    scene = None
    for line in lines:
        row = test_cells(line)
        if line.scene != scene:
            out.append(r"\midrule")
        else:
            row[0] = ""
        scene = line.scene
        out.append(" & ".join([*map(latex_escape, row[:2]), *(latex_text(c) for c in row[2:])]) + r" \\")
    return "\n".join([*out, r"\bottomrule", r"\end{tabular}", ""])


def latex_text(cell):
    """latex_number of every number of a cell such as "-1.2e-05 [-2.0e-05, 1.0e-06]"."""
    return re.sub(r"[-+]?\d[\d.]*(?:e[-+]\d+)?", lambda m: latex_number(m[0].lstrip("+")), cell).replace("–", "--")


def to_html(experiment, lines):
    shown = headings(lines)
    head = "".join(f"<th>{html.escape(h)}</th>" for h in (*shown, "Mrays/s", "bias |z|"))
    out = [f"<table><thead><tr>{head}</tr></thead><tbody>"]
    scene, biased = None, summary.biased(lines)
    for line in lines:
        row = [html.escape(c).replace("-", "−") if i > 1 else html.escape(c) for i, c in enumerate(cells(line, experiment.base, biased, shown))]
        row += [number(line.rays_per_second / 1e6), f"{line.bias_z:.1f}"]
        if line is best(lines, line.scene):
            row[shown.index("efficiency")] = f"<b>{row[shown.index('efficiency')]}</b>"
        kind = ' class="first"' if line.scene != scene else ""
        scene = line.scene
        out.append(f"<tr{kind}>" + "".join(f"<td>{c}</td>" for c in row) + "</tr>")
    return "\n".join([*out, "</tbody></table>"])

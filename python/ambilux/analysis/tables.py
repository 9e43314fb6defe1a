"""The table of an experiment as CSV and HTML (LaTeX: latex.py)."""

import csv
import html
import io
import math
import re

from ambilux.analysis import efficiency, heavy_tails, remarks, summary, verdicts

CAPTION = (
    "Each run at the last checkpoint {kind}that all runs of the scene have reached: {equal}. Errors are arithmetic means over seeds, of all pixels "
    "(RMSE: root of the mean of squares), less the noise of the reference where it is known; time is inside the renderer. "
    "Efficiency is 1 / ({metric} · time){own}; its ratio is over that of {base}; brackets are 95 % intervals over {units}; where the data support none, there is no ratio either. "
    "{same}"
    "Bold: the best run of a scene, if it is above every other by more than chance (1 % over all statements of the tables). "
    "Time to equal RMSE is that of {base} over that of the run, from mean errors{marks}. "
    "The slope is that of log RMSE against log samples, fitted for each seed; ± is the standard error of the mean over seeds (with one seed that of the fit, which is then too small)."
)
SAME_CAPTION = "An equals sign: the run makes the images of {base} at equal seeds, so that the ratio is that of times per sample, over pairs of seeds. "
MARKS = {  # of the column of times: what a sign in a cell means
    "†": "the mean of the run, or of {base}, is off by more than chance allows, so that the two do not approach the same image",
    "?": "an RMSE behind the number has no interval: it may be off by more than it seems",
    "> <": "a bound: one of the times lies outside of what was measured by more than a factor of 4",
}
EQUAL = {"time": "equal time", "samples": "equal samples, at times that differ"}
UNITS = {"batches": "batches of passes of all seeds (of times: over seeds)", "seeds": "seeds", "pairs of seeds": "pairs of seeds"}
REASONS = {  # what the words of a doubt mean, by how they begin or end
    "few samples decide": f"the error of one batch of passes is {heavy_tails.LARGEST:g} times the mean or more, so that rarer and larger ones may exist",
    "batches do not average out": f"the error of the whole image is {heavy_tails.AVERAGING:g} times what independent batches make of it or more, because of bias, or of light that no batch has found",
    "seeds differ": "batches of different seeds differ by more than chance",
    "seeds ran different methods": "bdpt.auto selected another method with another seed",
    "few pixels decide": f"the worst pixels hold {1 - 1 / heavy_tails.TRIMMED:.0%} of relMSE or more".replace("%", " %"),
    "batches": f"fewer than {heavy_tails.FEWEST_BATCHES}", "seeds": f"fewer than {heavy_tails.FEWEST_SEEDS}, or fewer than {heavy_tails.FEWEST_RESAMPLED_SEEDS} without a trimmed error, which would show whether few pixels decide",
    "seed": "a single seed does not show how much seeds differ",
}
COUNTED = {"batches": "N batches", "seeds": "N seeds", "seed": "1 seed"}  # of REASONS: what cells say
TRIMMED_CAPTION = (" Trimmed relMSE leaves out the worst {share} of the pixels; ×N is relMSE over it. It is no estimate of relMSE: a method that finds light only "
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
    """A value with its interval; alone where that is not stated. Digits end where the shorter side of the interval has its first one, so that the ends as printed hold the value as printed."""
    if math.isnan(e.low):
        return number(e.value)
    half = min(e.value - e.low, e.high - e.value)
    if half < 1e-4 * e.value:
        return f"{number(e.value)} [{number(e.low)}, {number(e.high)}]"

    def digits(x, least):
        return max(least, math.floor(math.log10(x)) - math.floor(math.log10(half)) + 1) if x > 0 else least
    return f"{number(e.value, digits(e.value, 3))} [{number(e.low, digits(e.low, 2))}, {number(e.high, digits(e.high, 2))}]"


def ratio_text(line, base):
    """A ratio of efficiencies with its interval, or why there is none."""
    if line.run == base:
        return "1"
    if line.ratio is None:
        return "–"
    return line.ratio.doubt or interval(line.ratio) + (" =" if line.ratio is line.ratio_time else "")


def speedup_text(line, base, biased):
    s = line.speedup
    if line.run == base or s is None:
        return "1" if line.run == base else "–"
    dagger = "†" if (line.scene, line.run) in biased or (line.scene, base) in biased else ""
    return (f"{s.sign} " if s.sign else "") + number(s.value, 2) + ("?" if s.doubt and line.ratio_time is None else "") + dagger


def slope_text(line):
    s = line.slope
    if s is None:
        return "–"
    return f"{s.value:.3f}" if math.isnan(s.error) else f"{s.value:.3f} ± {s.error:.3f}"


def trimmed_text(line):
    return number(line.trimmed.value) + (f" (×{number(line.few_pixels, 2)})" if line.few_pixels > 0 else "")


def methods_text(line):
    """What ran; where seeds differ, each with its seeds."""
    if len(line.methods) < 2:
        return next(iter(line.methods), "–")
    return "; ".join(f"{method} (seed{'s' if len(seeds) > 1 else ''} {', '.join(map(str, seeds))})" for method, seeds in line.methods.items())


# What a person reads: heading and text of a line, which also takes base and verdicts.biased.
COLUMNS = {
    "scene": lambda line, *_: line.scene, "run": lambda line, *_: line.run, "seeds": lambda line, *_: str(line.seeds), "spp": lambda line, *_: number(line.spp),
    "time (s)": lambda line, *_: number(line.seconds), "relMSE": lambda line, *_: interval(line.relmse), "RMSE": lambda line, *_: interval(line.rmse),
    "efficiency": lambda line, *_: number(line.efficiency.value), "ratio [95 %]": lambda line, base, _: ratio_text(line, base),
    "MAPE": lambda line, *_: number(line.mape), "FLIP": lambda line, *_: number(line.flip), "FLIP median": lambda line, *_: number(line.flip_median),
    "trimmed relMSE": lambda line, *_: trimmed_text(line), "time to equal RMSE": speedup_text, "slope": lambda line, *_: slope_text(line),
    "method actually used": lambda line, *_: methods_text(line),
}
OPTIONAL = {
    "trimmed relMSE": lambda line: not math.isnan(line.trimmed.value), "FLIP": lambda line: not math.isnan(line.flip),
    "FLIP median": lambda line: not math.isnan(line.flip_median), "method actually used": lambda line: len(line.methods) > 1,
}


def headings(experiment, lines):
    """Those of COLUMNS for which there are numbers, the error of the metric that leads before the others."""
    shown = [h for h in COLUMNS if h not in OPTIONAL or any(OPTIONAL[h](line) for line in lines)]
    if experiment.metric == "mse":
        at = shown.index("relMSE")
        shown[at:at + 2] = ["RMSE", "relMSE"]
    return shown


def cells(line, base, biased, shown):
    """Texts of the columns `shown`."""
    return [COLUMNS[h](line, base, biased) for h in shown]


def kind_of(doubt):
    """Which of REASONS a doubt is, None without: "29 batches" is "batches"; that of the base run stands behind its name."""
    return next((key for key in REASONS if re.search(rf"(^|: |\d ){re.escape(key)}( \(|$)", doubt)), None)


def units(lines):
    """Over what the intervals of the ratios are, such as "batches of passes of all seeds (of times: over seeds) and pairs of seeds"."""
    over = {line.ratio.over for line in lines if line.ratio is not None and line.ratio.trusted}
    return " and ".join(UNITS[o] for o in sorted(over)) or "seeds"


def same_sentence(lines, base):
    return SAME_CAPTION.format(base=base) if any(line.ratio_time is not None for line in lines) else ""


def marks(experiment, lines):
    """[(sign or words, meaning)] of what cells of the table hold beside numbers."""
    base, biased = experiment.base, verdicts.biased(lines)
    told = "".join(speedup_text(line, base, biased) for line in lines)
    found = [(sign, text.format(base=base)) for sign, text in MARKS.items() if any(s in told for s in sign.split())]
    if same := same_sentence(lines, base):
        found.insert(0, ("=", same.removeprefix("An equals sign: ").rstrip(". ")))
    kinds = {kind_of(line.ratio.doubt) for line in lines if line.ratio is not None and line.run != base}
    return found + [(COUNTED.get(words, words), f"no interval and no ratio: {text}") for words, text in REASONS.items() if words in kinds]


def caption(experiment, lines, with_marks=False):
    """with_marks: what signs in cells mean, where no list stands beside the table (marks_html)."""
    equal, base = summary.equal(experiment), experiment.base
    batches = any(line.efficiency is line.efficiency_batches and line.efficiency is not None for line in lines)
    told = "".join(f"; {sign}: {text.format(base=base)}" for sign, text in MARKS.items()) if with_marks else ""
    return (CAPTION.format(base=base, metric=efficiency.NAMES[experiment.metric], units=units(lines), marks=told, same=same_sentence(lines, base) if with_marks else "",
                           kind="" if len(experiment.budgets) < 2 else {"time": "in seconds ", "samples": "in samples "}[equal], equal=EQUAL[equal],
                           own=", from batches where their interval can be stated, so that it may differ a little from that of the columns beside it" if batches else "")
            + (TRIMMED_CAPTION.format(share=remarks.trimmed_share(experiment)) if "trimmed relMSE" in headings(experiment, lines) else ""))


PARTS = ("", "_low", "_high", "_units", "_doubt")  # of a Judged
ESTIMATES = {
    "relmse": lambda x: x.relmse, "rmse": lambda x: x.rmse, "relmse_trimmed": lambda x: x.trimmed,
    "efficiency_batches": lambda x: x.efficiency_batches, "efficiency_seeds": lambda x: x.efficiency_seeds,
    "ratio_batches": lambda x: x.ratio_batches, "ratio_seeds": lambda x: x.ratio_seeds, "ratio_time": lambda x: x.ratio_time,
}
FITS = {"slope": lambda x: x.slope, "slope_time": lambda x: x.slope_time, "bias": lambda x: x.bias and x.bias.estimate}
PLAIN = ("scene", "run", "seeds", "spp", "seconds", "time_per_sample", "mape", "flip", "flip_median", "rays_per_second", "averaging", "bias_z", "invalid", "few_pixels")


def csv_columns():
    """Names of the columns of table.csv."""
    return [*PLAIN[:-1], "relmse_over_trimmed", *(f"{e}{part}" for e in ESTIMATES for part in PARTS), *(f"{e}{part}" for e in FITS for part in ("", "_error", "_low", "_high")),
            "ratio_p", "differs", "best", "speedup", "speedup_bound", "speedup_at_rmse", "speedup_extrapolated", "speedup_doubt", "bias_p", "method_actually_used"]


def to_csv(lines):
    """All numbers in full precision, for further work. Columns: docs/analysis.md."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(csv_columns())
    for line in lines:
        row = [getattr(line, c) for c in PLAIN]
        for get in ESTIMATES.values():
            e = get(line)
            row += [e.value, e.low, e.high, e.units, e.doubt] if e else [math.nan] * 3 + [0, "not recorded"]
        for get in FITS.values():
            e = get(line)
            row += [e.value, e.error, e.low, e.high] if e else [math.nan] * 4
        s = line.speedup
        row += [line.ratio.p if line.ratio else math.nan, int(verdicts.differs(line, lines)), int(line is verdicts.best(lines, line.scene))]
        row += [s.value, s.sign or "=", s.target, s.extrapolated, s.doubt] if s else [math.nan, "", math.nan, math.nan, ""]
        row += [line.bias.p if line.bias else math.nan, methods_text(line)]
        writer.writerow([f"{v:.9g}" if isinstance(v, float) else v for v in row])
    return out.getvalue()


def variances_to_csv(rows):
    """`rows`: (scene, run, Strategy, Estimate, share, seeds, share of its greatest pixel)."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["scene", "run", "s", "t", "merge", "variance", "variance_error", "variance_low", "variance_high", "share", "seeds", "largest_pixel"])
    for scene, run, strategy, e, share, seeds, pixel in rows:
        writer.writerow([scene, run, strategy.s, strategy.t, int(strategy.merge), *(f"{v:.9g}" for v in (e.value, e.error, e.low, e.high, share)), seeds, f"{pixel:.9g}"])
    return out.getvalue()


TEST_HEADINGS = ("scene", "run", "slope [95 %]", "bias [95 %]", "p of the bias", "greatest |z|")


def test_cells(line):
    """What was found on convergence and bias."""
    s, b = line.slope, line.bias
    slope = "–" if s is None else f"{s.value:.3f}" if math.isnan(s.low) else f"{s.value:.3f} [{s.low:.3f}, {s.high:.3f}]"
    bias = "–" if b is None else f"{b.estimate.value:+.1e} [{b.estimate.low:+.1e}, {b.estimate.high:+.1e}]"
    return [line.scene, line.run, slope, bias, "–" if b is None else number(b.p, 2), f"{line.bias_z:.1f}"]


def minus(text):
    """Hyphens before numbers as minus signs."""
    return re.sub(r"(?<![\w)])-(?=\d)|(?<=e)-(?=\d)", "−", text)


def breakable(name):
    """A name as HTML that may be broken before a bracket and behind commas, plus signs and underscores."""
    return re.sub(r"(?=\[)|(?<=[,+_])", "<wbr>", html.escape(name))


def is_words(cell):
    """Whether a cell is a sentence, which may stand on several lines, and no number with its interval."""
    return cell.count(" ") > 1 and not re.match(r"[\d<−–]", cell)


def leading(experiment):
    """Columns that a page shows at once; the others when asked."""
    return ("scene", "run", "spp" if summary.equal(experiment) == "time" else "time (s)", "relMSE" if experiment.metric == "relmse" else "RMSE", "ratio [95 %]", "time to equal RMSE")


def to_html(experiment, lines):
    """A box that shows all columns, without a script, and the table. Columns of the class more are those that it adds; those of the class roomy are left out of a narrow window, too."""
    leads, last = leading(experiment), ("Mrays/s", "bias |z|")
    shown = sorted(headings(experiment, lines), key=lambda h: h not in leads)
    kinds = ["" if h in leads[:2] or h in leads[3:5] else "roomy" if h in leads else "more" for h in (*shown, *last)]
    attribute = [f' class="{kind}"' if kind else "" for kind in kinds]
    out = [f'<input type="checkbox" id="every-column"><label for="every-column">all columns ({html.escape(", ".join(h for h in (*shown, *last) if h not in leads))})</label>',
           '<div class="wide"><table class="results"><thead><tr>' + "".join(f"<th{a}>{html.escape(h)}</th>" for a, h in zip(attribute, (*shown, *last))) + "</tr></thead><tbody>"]
    scene, biased = None, verdicts.biased(lines)
    bold = {scene: verdicts.best(lines, scene) for scene in experiment.scenes}
    for line in lines:
        row = [html.escape(minus(c)) if i > 1 else breakable(c) for i, c in enumerate(cells(line, experiment.base, biased, shown))]
        row += [number(line.rays_per_second / 1e6), f"{line.bias_z:.1f}"]
        if line is bold.get(line.scene):
            at = shown.index("ratio [95 %]")
            row[at] = f"<b>{row[at]}</b>"
        first = ' class="first"' if line.scene != scene else ""
        if line.scene == scene:
            row[0] = ""
        scene = line.scene
        classes = [" ".join(filter(None, (kind, "words" if is_words(c) else ""))) for kind, c in zip(kinds, row)]
        out.append(f"<tr{first}>" + "".join(f'<td class="{kind}">{c}</td>' if kind else f"<td>{c}</td>" for kind, c in zip(classes, row)) + "</tr>")
    return "\n".join([*out, "</tbody></table></div>"])


def marks_html(experiment, lines):
    """What signs and words of the table mean, to stand right below it; those of a column that a narrow window leaves out with that column."""
    found = marks(experiment, lines)
    entries = "".join("<dt{0}>{1}</dt><dd{0}>{2}</dd>".format(' class="roomy"' if sign in MARKS else "", html.escape(sign), html.escape(text)) for sign, text in found)
    return f'<dl class="marks">{entries}</dl>' if found else ""

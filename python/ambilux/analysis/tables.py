"""The table of an experiment as CSV and HTML (LaTeX: latex.py)."""

import csv
import html
import io
import math
import re

from ambilux.analysis import efficiency, heavy_tails, remarks, summary, verdicts

CAPTION = (
    "Each run at the last checkpoint {kind}that all runs of the scene have reached: {equal}. All errors are of all pixels and arithmetic "
    "means over seeds (RMSE: root of the mean of squares), with the noise of the reference subtracted where it is known; time is inside the renderer. "
    "Efficiency is 1 / ({metric} · time){own}, and its ratio that over {base}'s; brackets are 95 % intervals over {units}; where data cannot support one, words say why and there is no ratio{reasons}. "
    "{same}"
    "Bold: the best of a scene, if it is above every other by more than chance (1 % over all statements of the table). "
    "Time to equal RMSE is that of {base} over the run's, from mean errors; > and < are bounds, since a time lies outside of what was measured by more than a factor of 4; a question mark: there is no "
    "interval of an RMSE behind it; a dagger marks runs whose "
    "mean, or {base}'s, is off by more than chance allows. The slope is that of log RMSE against log samples, fitted for each seed; ±"
    " is the standard error of the mean over seeds (with one seed that of the fit, which is then too small)."
)
SAME_CAPTION = ("An equals sign: the run makes {base}'s images at equal seeds, so that the ratio is that of times per "
                "sample, over pairs of seeds. ")
EQUAL = {"time": "equal time", "samples": "equal samples, at times that differ"}
UNITS = {"batches": "batches of passes of all seeds (of times: over seeds)", "seeds": "seeds", "pairs of seeds": "pairs of seeds"}
REASONS = {  # what the words of a doubt mean, by how they begin or end
    "few samples decide": f"one batch of passes holds {heavy_tails.LARGEST:g} times the mean error or more, so that there may be more beyond",
    "batches do not average out": f"the error of the whole image is {heavy_tails.AVERAGING:g} times what independent batches make of it or more, because of bias, or of light that no batch has found",
    "seeds differ": "batches of different seeds differ by more than chance",
    "seeds ran different methods": "bdpt.auto selected another one, and batches of one seed are all of one",
    "few pixels decide": f"the worst pixels hold {1 - 1 / heavy_tails.TRIMMED:.0%} of relMSE or more".replace("%", " %"),
    "batches": f"fewer than {heavy_tails.FEWEST_BATCHES}", "seeds": f"fewer than {heavy_tails.FEWEST_SEEDS}, or than {heavy_tails.FEWEST_RESAMPLED_SEEDS} of which it is not known whether few pixels decide",
    "seed": "how much seeds differ is not known",
}
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


def reasons(doubts):
    """Sentences on the words of doubts, for those that are there."""
    return "; ".join(f"{key}: {REASONS[key]}" for key in REASONS if key in set(map(kind_of, doubts)))


def units(lines):
    """Over what the intervals of the ratios are, such as "batches of passes of all seeds (of times: over seeds) and pairs of seeds"."""
    over = {line.ratio.over for line in lines if line.ratio is not None and line.ratio.trusted}
    return " and ".join(UNITS[o] for o in sorted(over)) or "seeds"


def same_sentence(lines, base):
    return SAME_CAPTION.format(base=base) if any(line.ratio_time is not None for line in lines) else ""


def caption(experiment, lines, with_reasons=True):
    """with_reasons: what the words of doubts mean (tables for papers have them below)."""
    equal = summary.equal(experiment)
    told = reasons([line.ratio.doubt for line in lines if line.ratio is not None and line.run != experiment.base]) if with_reasons else ""
    batches = any(line.efficiency is line.efficiency_batches and line.efficiency is not None for line in lines)
    return (CAPTION.format(base=experiment.base, metric=efficiency.NAMES[experiment.metric], units=units(lines), reasons=f" ({told})" if told else "", same=same_sentence(lines, experiment.base),
                           kind="" if len(experiment.budgets) < 2 else {"time": "in seconds ", "samples": "in samples "}[equal], equal=EQUAL[equal],
                           own=", from batches where they are to be trusted, so that it may differ a little from that of the columns beside it" if batches else "")
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


def to_html(experiment, lines):
    shown = headings(experiment, lines)
    head = "".join(f"<th>{html.escape(h)}</th>" for h in (*shown, "Mrays/s", "bias |z|"))
    out = [f'<table class="results"><thead><tr>{head}</tr></thead><tbody>']
    scene, biased = None, verdicts.biased(lines)
    bold = {scene: verdicts.best(lines, scene) for scene in experiment.scenes}
    for line in lines:
        row = [html.escape(minus(c)) if i > 1 else breakable(c) for i, c in enumerate(cells(line, experiment.base, biased, shown))]
        row += [number(line.rays_per_second / 1e6), f"{line.bias_z:.1f}"]
        if line is bold.get(line.scene):
            row[shown.index("efficiency")] = f"<b>{row[shown.index('efficiency')]}</b>"
        kind = ' class="first"' if line.scene != scene else ""
        if line.scene == scene:
            row[0] = ""
        scene = line.scene
        out.append(f"<tr{kind}>" + "".join(f'<td class="words">{c}</td>' if is_words(c) else f"<td>{c}</td>" for c in row) + "</tr>")
    return "\n".join([*out, "</tbody></table>"])

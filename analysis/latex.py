"""Tables for papers (booktabs). Of two columns: those of a page's width go into a table*, table_column.tex into one column."""

import re

from analysis import style, tables, verdicts

# Widest names on one line, in letters.
RUN, RUN_BESIDE_MUCH, SCENE, METHOD = 32, 22, 14, 60
LEADS = {"relmse": ("relMSE", "RMSE"), "mse": ("RMSE", "relMSE")}  # of a metric: the error that leads, the other


def escape(text):
    special = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"} | {c: "\\" + c for c in "&%$#_{}"}
    symbols = {"±": r"$\pm$", "–": "--", "−": "$-$", "·": r"$\cdot$", "†": r"$^\dagger$", "≥": r"$\geq$", "×": r"$\times$", "<": "$<$", ">": "$>$", "|": r"$|$"}
    return "".join(special.get(c) or symbols.get(c) or c for c in text)


def number(text):
    """Typesets minus signs and powers of ten of a cell."""
    match = re.fullmatch(r"(-?[\d.]+)e([-+]\d+)", text)
    if match:
        return rf"${match[1]}\cdot 10^{{{int(match[2])}}}$"
    return "$-$" + escape(text[1:]) if text.startswith("-") and text != "-" else escape(text)


NUMBER = re.compile(r"(?<![\w.])([-+]?\d[\d.]*(?:e[-+]\d+)?)(?!\w)")


def text(cell):
    """number of every number of a cell such as "-1.2e-05 [-2.0e-05, 1.0e-06]", escape of the rest."""
    return "".join(number(part.lstrip("+")) if i % 2 else escape(part) for i, part in enumerate(NUMBER.split(cell)))


def name(words, letters):
    """A name, on several lines where it is long."""
    lines = [escape(line) for line in style.wrap(words, letters).split("\n")]
    return lines[0] if len(lines) == 1 else r"\begin{tabular}[t]{@{}l@{}}" + r"\\{}".join(lines) + r"\end{tabular}"  # {}: a bracket would be a distance


class Notes:
    """Reasons for which there is no ratio, by letters: they would not fit into a column."""

    def __init__(self):
        self.letters = {}

    def mark(self, reason):
        reason = re.sub(r" \(x[\d.]+\)$", "", re.sub(r"^\d+ (batches|seeds)$", r"too few \1", reason))
        return "--$^{" + self.letters.setdefault(reason, "abcdefghijklmnopqrstuvwxyz"[min(len(self.letters), 25)]) + "}$"

    def below(self):
        told = "; ".join(f"$^{{{letter}}}$ {text(reason)}" for reason, letter in self.letters.items())
        return rf"\par\smallskip\begin{{minipage}}{{0.95\linewidth}}\raggedright {told}\end{{minipage}}" if told else ""


def tabular(about, headings, align, body, notes=None):
    return "\n".join([rf"% Needs \usepackage{{booktabs}}. {escape(about)}", r"{\footnotesize\setlength{\tabcolsep}{3.5pt}%", rf"\begin{{tabular}}{{{align}}}", r"\toprule",
                      " & ".join(map(escape, headings)) + r" \\", *body, r"\bottomrule", r"\end{tabular}" + (notes.below() if notes else "") + "}", ""])


def rows_by_scene(lines, cells, letters=RUN):
    """Rows of a table with columns scene and run, whose other cells are cells(line): the scene stands in its first row."""
    body, scene = [], None
    for line in lines:
        if line.scene != scene:
            body.append(r"\midrule")
        body.append(" & ".join([name(line.scene, SCENE) if line.scene != scene else "", name(line.run, letters), *cells(line)]) + r" \\")
        scene = line.scene
    return body


def cells_of(experiment, lines, headings, notes):
    """Function of a line: its cells, the best run of a scene bold in what leads to the ratio, reasons by letters."""
    biased, bold = verdicts.biased(lines), {scene: verdicts.best(lines, scene) for scene in experiment.scenes}

    def cells(line):
        found = [text(c) for c in tables.cells(line, experiment.base, biased, headings)]
        for i, heading in enumerate(headings):
            if heading.startswith("ratio") and line.run != experiment.base and line.ratio is not None and line.ratio.doubt:
                found[i] = notes.mark(line.ratio.doubt)
            if line is bold[line.scene] and heading == ("efficiency" if "efficiency" in headings else "ratio [95 %]"):
                found[i] = rf"\textbf{{{found[i]}}}"
        return found
    return cells


def results(experiment, lines):
    """table.tex: error, efficiency and ratio of every run, as wide as a page."""
    shown = ["spp", LEADS[experiment.metric][0], "efficiency", "ratio [95 %]", "time to equal RMSE"]
    notes = Notes()
    body = rows_by_scene(lines, cells_of(experiment, lines, shown, notes))
    return tabular(tables.caption(experiment, lines), ["scene", "run", *shown], "ll" + "r" * len(shown), body, notes)


def errors(experiment, lines):
    """errors.tex: the other errors at the same checkpoint, as wide as a page."""
    optional = [h for h in ("trimmed relMSE", "FLIP", "FLIP median") if any(tables.OPTIONAL[h](line) for line in lines)]
    shown = ["seeds", "time (s)", LEADS[experiment.metric][1], "MAPE", *optional]
    body = rows_by_scene(lines, cells_of(experiment, lines, shown, Notes()))
    return tabular("Further errors of table.tex.", ["scene", "run", *shown], "ll" + "r" * len(shown), body)


def column(experiment, lines):
    """table_column.tex: error and ratio, as wide as a column."""
    shown = [LEADS[experiment.metric][0], "ratio [95 %]"]
    notes, body, scene = Notes(), [], None
    cells = cells_of(experiment, lines, shown, notes)
    for line in lines:
        if line.scene != scene:
            body += [r"\midrule", rf"\multicolumn{{3}}{{l}}{{\emph{{{escape(line.scene)}}}}} \\"]
        scene = line.scene
        error, ratio = cells(line)
        body.append(" & ".join([name(line.run, RUN_BESIDE_MUCH), re.sub(r" \[.*", "", error), ratio]) + r" \\")
    return tabular(tables.caption(experiment, lines), ["run", *shown], "lrr", body, notes)


def methods(lines):
    """methods.tex: what ran where seeds of a run differ; None if they do not."""
    body, place = [], None
    for line in (x for x in lines if len(x.methods) > 1):
        body.append(r"\midrule")
        for method, seeds in line.methods.items():
            first = (line.scene, line.run) != place
            place = (line.scene, line.run)
            body.append(" & ".join([name(line.scene, SCENE) if first else "", name(line.run, RUN) if first else "", name(method, METHOD), ", ".join(map(str, seeds))]) + r" \\")
    return tabular("Seeds of a run that selected different methods.", ["scene", "run", "method actually used", "seeds"], "llll", body) if body else None


def tests(lines):
    """tests.tex: slopes and bias, as wide as a page."""
    about = ("Slope of log RMSE against log samples (over checkpoints in samples if there are both kinds), -1/2 without bias; mean difference to the reference over seeds at the "
             "checkpoint of the table, its noise included.")
    headings = tables.TEST_HEADINGS
    body = rows_by_scene(lines, lambda line: [text(c) for c in tables.test_cells(line)[2:]], RUN_BESIDE_MUCH)
    return tabular(about, headings, "llrrrr", body)


def files(experiment, lines):
    """{name: text} of all tables."""
    found = {"table.tex": results(experiment, lines), "errors.tex": errors(experiment, lines), "table_column.tex": column(experiment, lines), "tests.tex": tests(lines),
             "methods.tex": methods(lines)}
    return {file: content for file, content in found.items() if content}

"""Tables for papers (booktabs). Of two columns: those of a page's width go into a table*, table_column.tex into one column.

Names are broken where a table would be wider than that, and tables where they would be longer than a page: table.tex, table_2.tex, ...
"""

import re
from functools import lru_cache

from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

from ambilux.analysis import style, tables, verdicts

SCENE, METHOD = 14, 60  # widest names on one line, in letters
RUN = range(46, 9, -1)  # of runs: the widest one that the table has room for
BETWEEN = 3.5  # points on either side of a column
LINES = 56  # of \\footnotesize on a page, beside a caption
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


@lru_cache(maxsize=4096)
def points(words):
    """Width of words in \\footnotesize: Computer Modern of 8 points, whose letters are 6 % wider than those of 10 points made smaller."""
    return 1.06 * text_to_path.get_text_width_height_descent(words, FontProperties(family="cmr10", size=8), ismath=False)[0] if words.strip() else 0.0


def width(cell):
    """Points of a cell as it stands in a table, without its commands; a superscript counts as if it were large."""
    cell = re.sub(r"\\(?:begin|end)\{[a-z]+\}(?:\[t\])?(?:\{@\{\}l@\{\}\})?", "", cell).replace(r"\cdot", ".").replace(r"\times", "x").replace(r"\pm", "+")
    cell = re.sub(r"\$[^$]*\$", lambda m: m[0].replace("-", "+"), cell)  # a minus is as wide as a plus
    return max(points(re.sub(r"\\(?:textbf|emph|dagger|textbackslash)|[${}^\\]", "", part)) for part in cell.split(r"\\"))


def letters_of_runs(lines, columns, inches):
    """How many letters of the runs' names stand on a line, so that the table is `inches` wide at most. `columns`: widths of the others, in points."""
    room = 0.97 * 72 * inches - sum(columns) - 2 * BETWEEN * (len(columns) + 1)
    return next((n for n in RUN if all(width(name(line.run, n)) <= room for line in lines)), RUN[-1])


def in_parts(lines, letters):
    """The lines in lists that a page has room for, of whole scenes where one fits on a page."""
    parts, used = [[]], 0
    for scene in dict.fromkeys(line.scene for line in lines):
        of_scene = [(line, name(line.run, letters).count(r"\\") + 1) for line in lines if line.scene == scene]
        whole = 1 + sum(needs for _, needs in of_scene)
        for i, (line, needs) in enumerate(of_scene):
            if parts[-1] and used + (whole if i == 0 and whole <= LINES else needs + 1) > LINES:
                parts.append([])
                used = 0
            used += needs + (not parts[-1] or i == 0)
            parts[-1].append(line)
    return parts


class Notes:
    """Reasons for which there is no ratio, by letters: they would not fit into a column."""

    def __init__(self):
        self.letters = {}

    def mark(self, reason):
        key = tables.kind_of(reason)
        reason = re.sub(r" \(×[\d.]+\)$", "", re.sub(r"(^|: )\d+ (batches|seeds?)$", r"\1too few \2", reason))
        if key and not any(tables.kind_of(r) == key for r in self.letters):
            reason += f" ({tables.REASONS[key]})"
        reason = next((r for r in self.letters if r.startswith(f"{reason} (")), reason)
        return "--$^{" + self.letters.setdefault(reason, "abcdefghijklmnopqrstuvwxyz"[min(len(self.letters), 25)]) + "}$"

    def below(self):
        told = "; ".join(f"$^{{{letter}}}$ {text(reason)}" for reason, letter in self.letters.items())
        return rf"\par\smallskip\begin{{minipage}}{{0.95\linewidth}}\raggedright {told}\end{{minipage}}" if told else ""


def tabular(about, headings, align, body, notes=None):
    return "\n".join([rf"% Needs \usepackage{{booktabs}}. {escape(about)}", r"{\footnotesize\setlength{\tabcolsep}{3.5pt}%", rf"\begin{{tabular}}{{{align}}}", r"\toprule",
                      " & ".join(map(escape, headings)) + r" \\", *body, r"\bottomrule", r"\end{tabular}" + (notes.below() if notes else "") + "}", ""])


def rows_by_scene(lines, cells, letters):
    """Rows of a table with columns scene and run, whose other cells are cells(line): the scene stands in its first row."""
    body, scene = [], None
    for line in lines:
        if line.scene != scene:
            body.append(r"\midrule")
        body.append(" & ".join([name(line.scene, SCENE) if line.scene != scene else "", name(line.run, letters), *cells(line)]) + r" \\")
        scene = line.scene
    return body


def of_page_width(about, headings, lines, make_cells):
    """[tabular] with columns scene, run and `headings`, one for each page. make_cells: of Notes, a function of a line that returns its cells."""
    cells = make_cells(Notes())
    others = [max(map(width, column)) for column in zip([escape(h) for h in headings], *map(cells, lines))]
    letters = letters_of_runs(lines, [max(width(name(line.scene, SCENE)) for line in lines), *others], style.PAGE)
    made = []
    for part in in_parts(lines, letters):
        notes = Notes()
        body = rows_by_scene(part, make_cells(notes), letters)
        made.append(tabular(about, ["scene", "run", *headings], "ll" + "r" * len(headings), body, notes))
    return made


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
    return of_page_width(tables.caption(experiment, lines, with_marks=True), shown, lines, lambda notes: cells_of(experiment, lines, shown, notes))


def errors(experiment, lines):
    """errors.tex: the other errors at the same checkpoint, as wide as a page."""
    optional = [h for h in ("trimmed relMSE", "FLIP", "FLIP median") if any(tables.OPTIONAL[h](line) for line in lines)]
    shown = ["seeds", "time (s)", LEADS[experiment.metric][1], "MAPE", *optional]
    return of_page_width("Further errors of table.tex.", shown, lines, lambda notes: cells_of(experiment, lines, shown, notes))


def column(experiment, lines):
    """table_column.tex: error and ratio, as wide as a column."""
    shown = [LEADS[experiment.metric][0], "ratio [95 %]"]

    def make_cells(notes):
        cells = cells_of(experiment, lines, shown, notes)
        return lambda line: [re.sub(r" \[.*", "", cells(line)[0]), cells(line)[1]]
    cells, made = make_cells(Notes()), []
    letters = letters_of_runs(lines, [max(map(width, c)) for c in zip(map(escape, shown), *map(cells, lines))], style.COLUMN)
    for part in in_parts(lines, letters):
        notes, body, scene = Notes(), [], None
        cells = make_cells(notes)
        for line in part:
            if line.scene != scene:
                body += [r"\midrule", rf"\multicolumn{{3}}{{l}}{{\emph{{{escape(line.scene)}}}}} \\"]
            scene = line.scene
            body.append(" & ".join([name(line.run, letters), *cells(line)]) + r" \\")
        made.append(tabular(tables.caption(experiment, lines, with_marks=True), ["run", *shown], "lrr", body, notes))
    return made


def methods(lines):
    """methods.tex: what ran where seeds of a run differ; None if they do not."""
    body, place = [], None
    for line in (x for x in lines if len(x.methods) > 1):
        body.append(r"\midrule")
        for method, seeds in line.methods.items():
            first = (line.scene, line.run) != place
            place = (line.scene, line.run)
            body.append(" & ".join([name(line.scene, SCENE) if first else "", name(line.run, RUN[0]) if first else "", name(method, METHOD), ", ".join(map(str, seeds))]) + r" \\")
    return tabular("Seeds of a run that selected different methods.", ["scene", "run", "method actually used", "seeds"], "llll", body) if body else None


def tests(lines):
    """tests.tex: slopes and bias, as wide as a page."""
    about = ("Slope of log RMSE against log samples (over checkpoints in samples if there are both kinds), -1/2 without bias; mean difference to the reference over seeds at the "
             "checkpoint of the table, its noise included.")
    return of_page_width(about, tables.TEST_HEADINGS[2:], lines, lambda _: lambda line: [text(c) for c in tables.test_cells(line)[2:]])


def files(experiment, lines):
    """{name: text} of all tables."""
    if not lines:
        return {}
    found = {"table": results(experiment, lines), "errors": errors(experiment, lines), "table_column": column(experiment, lines), "tests": tests(lines),
             "methods": [content] if (content := methods(lines)) else []}
    return {f"{file}.tex" if i == 0 else f"{file}_{i + 1}.tex": content for file, parts in found.items() for i, content in enumerate(parts)}

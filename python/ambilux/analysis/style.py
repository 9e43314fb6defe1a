"""One style for all figures: fonts, widths, colours; how numbers are written; how a figure is saved."""

import math
import re
from dataclasses import dataclass

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

# Okabe and Ito 2008, "Color universal design": told apart with every common kind of colour vision (tests/test_colour_vision.py simulates
# them). Yellow is left out: it is too light for lines. Lines differ by markers too, bars by hatching.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
DASHES = ("-", "--", "-.", ":")
HATCHES = ("", "////", "....", "\\\\\\\\", "xx", "--", "oo")
ERROR_COLOURS = "magma"  # lightness rises evenly, so that it survives grey print
SIGNED_COLOURS = "PuOr"  # diverging, without red against green (Brewer)

COLUMN, PAGE = 3.4, 7.0  # widths in inches of one column and of a page, as in ACM's and Eurographics' two-column layouts
LEGEND_ROOM = 0.45  # inches below the panels; what a legend needs beyond them is added
DPI = 200

STYLE = {
    "font.size": 8, "axes.titlesize": 8.5, "axes.labelsize": 8, "legend.fontsize": 7.5, "xtick.labelsize": 7, "ytick.labelsize": 7,
    "pdf.fonttype": 42, "axes.spines.top": False, "axes.spines.right": False, "axes.linewidth": 0.6, "svg.hashsalt": "ambilux", "hatch.linewidth": 0.5,
}


@dataclass
class Picture:
    """A figure to be saved under `name`; `caption` says what is drawn and how, captions.py adds where the data come from."""

    name: str
    figure: Figure
    title: str
    caption: str
    runs: list
    scenes: list


class NotMade(Exception):
    """Why the results do not support a figure. No fault of the input."""


def file_name(*parts):
    """Name of a figure that LaTeX and shells take as it is: lvc[connections=4] becomes lvc-connections-4."""
    return "_".join(re.sub(r"[^A-Za-z0-9._]+", "-", part).strip("-") for part in parts)


def colour(i):
    return COLOURS[i % len(COLOURS)]


def marker(i):
    """Past seven of them, each colour has another one than before."""
    return MARKERS[(i + i // len(COLOURS)) % len(MARKERS)]


def line_style(i):
    """Keywords for run number i. Past seven runs colours repeat and dashes and markers tell them apart."""
    return {"color": colour(i), "marker": marker(i), "ls": DASHES[i // len(COLOURS) % len(DASHES)], "ms": 3, "lw": 1.2}


def pieces(part, width):
    """A part that is longer than a line: behind =, else behind _ or -, else anywhere."""
    if len(part) <= width:
        return [part]
    at = part.rfind("=", 0, width) + 1 or max(part.rfind(c, 0, width) for c in "_-") + 1 or width
    return [part[:at], *pieces(part[at:], width)]


def wrap(text, width=18):
    """Long names on several lines, for titles of narrow panels: a bracket on a line of its own, breaks behind + , and spaces, elsewhere only where a part is longer than a line."""
    head, bracket, rest = text.partition("[")  # lvc[connections=4]
    if len(text) > width and head and bracket:
        return wrap(head, width) + "\n" + wrap(bracket + rest, width)
    lines = [""]
    for part in re.findall(r"[^+, ]+[+,]*|[+, ]+", text):
        for piece in pieces(part, width):
            if len(lines[-1]) + len(piece.rstrip()) <= width:
                lines[-1] += piece
            else:
                lines.append(piece.lstrip())
    return "\n".join(line.strip() for line in lines if line.strip()) or text


def fit(text, inches, points=8):
    """wrap to a width in inches of a font of `points`."""
    return wrap(text, max(5, int(inches * 72 / (0.6 * points))))


def row_height(names, least):
    """(inches of a row of bars whose labels are `names`, font size of the labels): labels of several lines do not run into each other."""
    lines = max((name.count("\n") + 1 for name in names), default=1)
    return (least, 7) if lines < 3 else (max(least, 0.1 * lines + 0.04), 6)


def balanced(count, most):
    """Columns of a grid of `count` cells, `most` beside each other, so that its rows are as even as they can be: 6 of at most 5 are 3 and 3."""
    return math.ceil(count / math.ceil(count / most))


def short_number(x, digits=3):
    """`digits` significant digits, for labels."""
    if not math.isfinite(x):
        return "–"
    if x == 0 or 1e-3 <= abs(x) < 1e5:
        places = max(0, digits - 1 - math.floor(math.log10(abs(x)))) if x else 0
        return f"{x:.{places}f}"
    return f"{x:.{digits - 1}e}"


def plain_number(x, _=None):
    """Label of a logarithmic tick: digits where they are short, else a power of ten."""
    if 0.001 <= x < 10000:
        return f"{x:g}"
    exponent = math.floor(math.log10(x) + 1e-9)
    factor = round(x / 10**exponent)
    return (rf"${factor}\cdot" if factor != 1 else "$") + rf"10^{{{exponent}}}$"


def label_log_axis(axis, limits):
    """Decades alone where there are several; numbers between them where the range is short, so that no axis has fewer than two."""
    decades = math.log10(limits[1] / limits[0])
    between = () if decades > 2.7 else (3.0,) if decades > 1.5 else (2.0, 5.0) if decades > 0.8 else (1.5, 2.0, 3.0, 4.0, 5.0, 7.0)
    axis.set_major_locator(LogLocator(10, subs=(1.0, *between)))
    axis.set_major_formatter(FuncFormatter(plain_number))
    axis.set_minor_formatter(NullFormatter())


def across(count, width):
    """Panels beside each other in a figure for a "page" (None: as many as panels() takes) or a "column"."""
    return {"page": None, "column": 1}[width] if count > 1 else 1


def panels(count, height, columns=None, widest=2.35):
    """Figure and `count` axes in rows of up to three; those left over are hidden. `height`: inches of a row."""
    columns = columns or (2 if count == 4 else min(3, count))
    rows = math.ceil(count / columns)
    width = COLUMN if columns == 1 else min(PAGE, widest * columns + 0.2)
    figure, grid = plt.subplots(rows, columns, figsize=(width, height * rows + LEGEND_ROOM), squeeze=False, layout="constrained")
    for axes in grid.flat[count:]:
        axes.set_axis_off()
    return figure, list(grid.flat[:count]), columns


def name_ticks(axes, at, names):
    """Names below an axis of one column: lists such as hits+next_event on several lines; upright, in a higher figure, where they would still run into each other."""
    lines = [name.replace("+", "+\n") for name in names]
    room = 42 // max(1, len(names))  # letters
    if max((len(part) for name in lines for part in name.split("\n")), default=0) <= room:
        axes.set_xticks(at, lines)
        return
    axes.set_xticks(at, names, rotation=90)
    axes.figure.set_figheight(axes.figure.get_figheight() + 0.055 * max(map(len, names)))


def legend_below(figure, handles, labels, **options):
    """A legend in as many columns as fit below all panels. The figure grows by its rows, so that any number of runs leaves the panels their size."""
    if not labels:
        return
    renderer = figure.canvas.get_renderer()
    for columns in range(len(labels), 0, -1):
        legend = figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False, **options)
        size = legend.get_window_extent(renderer)
        if size.width <= (figure.get_figwidth() - 0.2) * figure.dpi or columns == 1:
            break
        legend.remove()
    figure.set_figheight(figure.get_figheight() + max(0, size.height / figure.dpi - LEGEND_ROOM))


def save(figure, path_without_suffix):
    """Writes PDF and PNG and closes the figure. The same data give the same bytes: no dates in the files."""
    with plt.rc_context(STYLE):
        figure.savefig(f"{path_without_suffix}.pdf", metadata={"CreationDate": None}, dpi=300)
        figure.set_layout_engine("none")  # what the first file has laid out holds for the second
        figure.savefig(f"{path_without_suffix}.png", dpi=DPI)
    plt.close(figure)

"""Places in C++ sources where a fault can be put, found in the text: no compiler, no syntax tree.

The project's sources are formatted (binary operators have spaces around them, pointers and template brackets have not), which is what
makes this possible. What is found wrongly does not compile, and scripts/checks/mutate.py drops it.
"""

import re
from dataclasses import dataclass

OPENING, CLOSING = "([{", ")]}"


@dataclass(frozen=True)
class Site:
    """One fault: text[start:end] of a file, an expression or a statement, becomes `mutated`."""

    file: str
    line: int
    last_line: int
    start: int
    end: int
    kind: str
    original: str
    mutated: str
    statement: bool = False

    def wrapped(self, number):
        if self.statement:
            return f"{{ if (!::ambilux::mutated({number})) {self.original} }}"
        return f"(::ambilux::mutated({number}) ? ({self.mutated}) : ({self.original}))"

    def describe(self):
        text = lambda s: " ".join(s.split())
        return f"{self.file}:{self.line}: {self.kind}: {text(self.original)}  ->  {text(self.mutated) or '(nothing)'}"


def mask(text):
    """The text with comments, strings and preprocessor lines blanked, of the same length."""
    pattern = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])\'|^[ \t]*#(?:[^\n]*\\\n)*[^\n]*', re.DOTALL | re.MULTILINE)
    return pattern.sub(lambda m: re.sub(r"[^\n]", " ", m[0]), text)


def functions(masked):
    """(start, end, header) of every function body: braces that follow a parameter list, outside of constexpr functions."""
    found, stack, previous = [], [], 0
    for i, c in enumerate(masked):
        if c == "{":
            header = masked[previous:i]
            is_body = bool(re.search(r"\)\s*(const)?\s*(noexcept)?\s*(->\s*[\w:<>& ]+)?\s*$", header))
            stack.append((i, header if is_body else None))
        elif c == "}" and stack:
            start, header = stack.pop()
            outermost = not any(h is not None for _, h in stack)
            if header is not None and outermost and not re.search(r"\b(constexpr|requires|concept)\b", header):
                found.append((start, i, header))
        if c in ";{}":
            previous = i + 1
    return found


def _is_angle(masked, i):
    """Whether < or > at i is a template bracket: comparisons have spaces on both sides."""
    if masked[i] == "<":
        return masked[i - 1] not in " <" and masked[i + 1] not in "=<"
    return masked[i - 1] not in " -" and masked[i + 1] != "="


ASSIGNMENT = re.compile(r" (?:=|\+=|-=|\*=|/=|%=|\|=|&=|<<=|>>=) $")


def _left(masked, i, low, stops):
    """Start of the segment that ends at i: after the nearest delimiter at the same depth."""
    depth = 0
    while i > low:
        c = masked[i - 1]
        if c in CLOSING or (c == ">" and _is_angle(masked, i - 1)):
            depth += 1
        elif c in OPENING or (c == "<" and _is_angle(masked, i - 1)):
            if depth == 0:
                return i
            depth -= 1
        elif depth == 0:
            if c in ",;?" or (c == ":" and masked[i] == " "):
                return i
            if ASSIGNMENT.search(masked, max(low, i - 5), i) or masked[max(low, i - 7):i].endswith("return "):
                return i
            if any(masked.startswith(s, i - len(s)) for s in stops):
                return i
        i -= 1
    return i


def _right(masked, i, high, stops):
    depth = 0
    while i < high:
        c = masked[i]
        if c in OPENING or (c == "<" and _is_angle(masked, i)):
            depth += 1
        elif c in CLOSING or (c == ">" and _is_angle(masked, i)):
            if depth == 0:
                return i
            depth -= 1
        elif depth == 0:
            if c in ",;?" or (c == ":" and masked[i - 1] == " " and masked[i + 1] == " "):
                return i
            if any(masked.startswith(s, i) for s in stops):
                return i
        i += 1
    return i


def _trim(masked, start, end):
    while start < end and masked[start].isspace():
        start += 1
    while end > start and masked[end - 1].isspace():
        end -= 1
    return start, end


LOGICAL = (" && ", " || ")
SUMS = (" + ", " - ", " < ", " > ", " <= ", " >= ", " == ", " != ", " && ", " || ", " & ", " | ", " << ", " >> ", " ^ ")
PRODUCTS = SUMS + (" * ", " / ", " % ")
SWAPPED = {"*": "/", "/": "*", "+": "-", "-": "+", "<": ">=", ">": "<=", "<=": ">", ">=": "<", "==": "!=", "!=": "==", "&&": "||", "||": "&&"}
SYMMETRIC = {"dot", "min", "max", "fmin", "fmax", "fminf", "fmaxf", "if", "for", "while", "switch", "return", "sizeof", "decltype", "static_assert"}
TWINS = {"min": "max", "max": "min", "sqrtf": "", "sinf": "cosf", "cosf": "sinf", "fabsf": "", "sqr": "", "term": "", "safe_sqrt": ""}


class Finder:
    """Collects the sites of one file."""

    def __init__(self, file, text):
        self.file, self.text, self.masked = file, text, mask(text)
        self.sites = []

    def add(self, kind, start, end, mutated, statement=False):
        start, end = _trim(self.masked, start, end)
        original = self.text[start:end]
        line = self.text.count("\n", 0, start) + 1
        header = self.masked[self.masked.rfind("\n", 0, start) + 1:start]
        if not original or mutated == original or "//" in original or re.search(r"\b(constexpr|case|static_assert|using)\b", header):
            return
        self.sites.append(Site(self.file, line, line + original.count("\n"), start, end, kind, original, mutated, statement))

    def segment(self, low, high, at):
        """Extent of the whole expression around `at`: between delimiters, logical operators among them."""
        return _trim(self.masked, _left(self.masked, at, low, LOGICAL), _right(self.masked, at, high, LOGICAL))

    def operators(self, low, high):
        for m in re.finditer(r"(?<=[\w)\]>]) (\*|/|\+|-|<=|>=|<|>|==|!=|&&|\|\|)(?=\s)", self.masked[low:high]):
            op, at = m[1], low + m.start(1)
            start, end = self.segment(low, high, at)
            if op in ("&&", "||"):
                start, end = _trim(self.masked, _left(self.masked, at, low, ()), _right(self.masked, at, high, ()))
            text = self.text
            self.add(f"{op} to {SWAPPED[op]}", start, end, text[start:at] + SWAPPED[op] + text[at + len(op):end])
            if op in ("*", "/", "+", "-"):
                stops = PRODUCTS if op in ("*", "/") else SUMS
                right = _right(self.masked, at + len(op) + 1, end, stops)
                self.add(f"without what follows {op}", start, end, text[start:at].rstrip() + text[right:end])
                if op == "*":
                    left = max(start, _left(self.masked, at - 1, low, stops))
                    self.add("without what precedes *", start, end, text[start:left] + text[at + 1:end].lstrip())

    def constants(self, low, high):
        for m in re.finditer(r"(?<![\w.])(\d+\.\d*(?:e-?\d+)?f?|\d+u?)(?![\w.])", self.masked[low:high]):
            at, value = low + m.start(1), m[1]
            start, end = self.segment(low, high, at)
            if "." in value:
                new = "1e-2f" if float(value.rstrip("f")) == 0 else f"(1.01f * {value})"
                kind = "constant off by 1 %" if new != "1e-2f" else "constant 0.01 for 0"
            else:
                new, kind = str(int(value.rstrip("u")) + 1) + ("u" if value.endswith("u") else ""), "constant off by one"
            self.add(kind, start, end, self.text[start:at] + new + self.text[at + len(value):end])

    def calls(self, low, high):
        for m in re.finditer(r"(?<![\w.])([A-Za-z_]\w*)(?:<[\w, ]+>)?\(", self.masked[low:high]):
            name, at = m[1], low + m.end()
            end = _right(self.masked, at, high, ())
            cuts = [at]
            while end < high and self.masked[end] == ",":
                cuts.append(end)
                end = _right(self.masked, end + 1, high, ())
            if end >= high or self.masked[end] != ")":
                continue
            cuts.append(end)
            start, stop = self.segment(low, high, low + m.start(1))
            before, after = self.text[start:low + m.start(1)], self.text[low + m.end(1):stop]
            if name in TWINS:
                self.add(f"{name} to {TWINS[name] or 'nothing'}", start, stop, before + TWINS[name] + after)
            if name in SYMMETRIC:
                continue
            arguments = [self.text[a:b].lstrip(", ") for a, b in zip(cuts, cuts[1:])]
            for k in range(len(arguments) - 1):
                swapped = arguments[:k] + [arguments[k + 1], arguments[k]] + arguments[k + 2:]
                self.add(f"arguments {k + 1} and {k + 2} of {name} swapped", start, stop, self.text[start:at] + ", ".join(swapped) + self.text[end:stop])

    def values(self, low, high, header):
        """Values that are 1 % too large: initialised or assigned floats and colours, and what functions of them return."""
        kinds = r"(?:const )?(?:float|double|Rgb) \w+ = |[\w.]*(?:pdf|ratio|radiance|value|throughput|weight|cos_theta)\w* = "
        if re.search(r"\b(float|double|Rgb)\s+\w+\([^;{}]*\)\s*(const)?\s*$", header):
            kinds += "|return "
        for m in re.finditer(kinds, self.masked[low:high]):
            start, end = _trim(self.masked, low + m.end(), _right(self.masked, low + m.end(), high, ()))
            if end < high and self.masked[end] in ";," and not re.fullmatch(r"0(\.0)?f?", self.text[start:end]):
                self.add("value 1 % too large", start, end, f"({self.text[start:end]}) * 1.01f")

    def statements(self, low, high):
        for m in re.finditer(r"(?<=[;{}) \n])[A-Za-z_][\w.\->\[\]]* (?:\+=|-=|\*=|/=) ", self.masked[low:high]):
            start = low + m.start()
            before = self.masked[low:start].rstrip()
            end = _right(self.masked, low + m.end(), high, ())
            if end < high and self.masked[end] == ";" and before and (before[-1] in ";{}" or before[-1] == ")"):
                self.add("statement dropped", start, end + 1, "", statement=True)

    def conditions(self, low, high):
        for m in re.finditer(r"\b(if|while) \(", self.masked[low:high]):
            start = low + m.end()
            end, depth = start, 1
            while depth and end < high:
                depth += {"(": 1, ")": -1}.get(self.masked[end], 0)
                end += 1
            if ";" not in self.masked[start:end]:
                self.add("condition negated", start, end - 1, f"!({self.text[start:end - 1]})")


def sites_of(file, text):
    """All sites of a file, in a fixed order."""
    finder = Finder(file, text)
    for low, high, header in functions(finder.masked):
        low += 1
        finder.operators(low, high)
        finder.constants(low, high)
        finder.calls(low, high)
        finder.values(low, high, header)
        finder.statements(low, high)
        finder.conditions(low, high)
    unique = {(s.start, s.end, s.mutated): s for s in finder.sites}
    return sorted(unique.values(), key=lambda s: (s.start, s.end, s.kind, s.mutated))


def draw(sites, count, generator, dropped=frozenset()):
    """`count` sites, one of every file after the other until there are enough; files and sites in random order. No two overlap."""
    by_file = {}
    for site in sites:
        by_file.setdefault(site.file, []).append(site)
    files = sorted(by_file)
    generator.shuffle(files)
    for file in files:
        generator.shuffle(by_file[file])
    drawn = []
    while len(drawn) < count and any(by_file.values()):
        for file in files:
            while by_file[file] and len(drawn) < count:
                site = by_file[file].pop()
                if site not in dropped and not any(d.file == file and site.start < d.end and d.start < site.end for d in drawn):
                    drawn.append(site)
                    break
    return drawn


def rewrite(text, numbered):
    """The text of a file with its faults, (number, site) each, and the header that chooses among them."""
    for number, site in sorted(numbered, key=lambda n: -n[1].start):
        text = text[:site.start] + site.wrapped(number) + text[site.end:]
    include = '#include "core/mutation.h"\n'
    return text.replace("#pragma once\n", "#pragma once\n" + include, 1) if "#pragma once\n" in text else include + text

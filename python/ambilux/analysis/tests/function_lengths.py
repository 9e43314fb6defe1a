"""How many lines functions of C++ and CUDA sources have, counted by their braces: no compiler is needed."""

import re

# What is no code and may hold braces: comments, raw and other strings, characters (not the ' of 1'000), lines for the preprocessor.
NO_CODE = re.compile(r'//[^\n]*|/\*.*?\*/|R"([^(\s]*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|(?<![0-9A-Fa-f])\'(?:\\.|[^\'\\\n])+\'|^[ \t]*#(?:\\\n|[^\n])*', re.DOTALL | re.MULTILINE)
# What a brace opens whose inside may hold functions.
HOLDS_FUNCTIONS = re.compile(r'(?:^|[\s>])(?:namespace|class|struct|union|enum|concept)\b')


def blank(match):
    return re.sub(r"[^\n]", " ", match.group())


def without_no_code(text):
    return NO_CODE.sub(blank, text)


def without_templates(head):
    return re.sub(r"\btemplate\s*<[^{};]*?>\s*(?=\w)", "", head)


def opens_function(head):
    """Whether a brace behind `head`, the code since the last statement ended, opens the body of a function."""
    head = without_templates(head)
    if HOLDS_FUNCTIONS.search(head.split("(")[0]):
        return False
    return "(" in head and not re.search(r"=\s*$", head)


def functions(text):
    """(first line, name, lines) of each function outside of others: lambdas are lines of the function that they are in."""
    code = without_no_code(text)
    line, start, head_line, depth, parentheses = 1, 0, None, 0, 0
    body = None  # (depth outside, first line, head) of the function that we are in
    for at, c in enumerate(code):
        if c == "\n":
            line += 1
        elif not c.isspace() and head_line is None:
            head_line = line
        if body is None:
            parentheses += (c == "(") - (c == ")")
            if parentheses:  # an argument by default, such as = {}
                continue
        if c == "{":
            if body is None and opens_function(code[start:at]):
                body = (depth, head_line, code[start:at])
            depth += 1
        elif c == "}":
            depth -= 1
            if depth < 0:
                raise ValueError(f"line {line}: a brace closes that none opened")
            if body and depth == body[0]:
                before_body = re.match(r"\s*[,{]", code[at + 1:at + 200])  # a_{1}, of a list of initialisers
                if not before_body:
                    yield body[1], name(body[2]), line - body[1] + 1
                body = None
                if before_body:
                    continue
        if body is None and c in ";{}":
            start, head_line = at + 1, None
    if depth or parentheses:
        raise ValueError(f"{depth} braces and {parentheses} parentheses stay open")


def name(head):
    found = re.findall(r"((?:[~\w]|::|<[^()]*?>)*?(?:operator\(\)|operator[^\w\s(]+|[~\w>]))\s*\(", without_templates(head))
    return next((n for n in found if n not in ("requires", "decltype", "alignas", "noexcept", "explicit", "__attribute__")), head.strip())

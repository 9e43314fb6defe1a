"""Rules for the sources: who includes and imports whom, lengths, format."""

import ast
import graphlib
import re
import subprocess
from pathlib import Path

import pytest

from ambilux.analysis.tests.function_lengths import functions

ROOT = Path(__file__).parents[4]

# A folder includes those above it, and none below or beside it (docs/architecture.md, "Who may include whom").
ORDER = [
    ["core"], ["models"], ["scene"], ["transport"], ["accel"], ["formats"], ["items", "queues", "film"], ["stages"],
    ["integrators"], ["backends"], ["render"], ["session"], ["experiments"], ["stress"], ["view"], ["cli"], ["python"],
]
# The same of the folders of formats/: what reads a format does not know the others.
FORMATS = [["images"], ["meshes"], ["document"], ["mitsuba", "pbrt", "gltf", "convert"]]
RANK = {folder: rank for rank, folders in enumerate(ORDER) for folder in folders}
# (file, included file): why it is right all the same. docs/architecture.md lists them too.
EXCEPTIONS: dict[tuple[str, str], str] = {}

MAX_COLUMNS = 120
MAX_LINES = 400
MAX_FUNCTION_LINES = 60
# Longer files, and functions as "file: name", that are yet to be split.
LONG_FILES: set[str] = set()
LONG_FUNCTIONS: set[str] = set()
SUFFIXES = (".h", ".cpp", ".cu", ".cuh", ".cpp.in", ".cu.in", ".h.in")
# Templates of cmake/ become files of these folders.
GENERATED_IN = {"cmake/registry.cpp.in": "integrators"}


def sources():
    """Paths, relative to the root, of what is not a test: all folders of the order, and the templates of cmake/."""
    for folder in [*RANK, "cmake"]:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.name.endswith(SUFFIXES):
                yield path.relative_to(ROOT).as_posix()


def folder_of(path):
    if path.startswith("cmake/"):
        return GENERATED_IN.get(path, "render")
    return path.split("/")[0]


def includes(text):
    return re.findall(r'^\s*#\s*include\s+"([^"]+)"', text, re.MULTILINE)


def wrong_arrows(path, text):
    """What a file includes and may not."""
    own = folder_of(path)
    wrong = []
    for included in includes(text):
        other = folder_of(included)
        if other not in RANK:
            wrong.append(f"{path} includes {included}, which is in no folder of the order")
        elif other != own and RANK[other] >= RANK[own] and (path, included) not in EXCEPTIONS:
            wrong.append(f"{path} includes {included}, but {own}/ does not lie below {other}/")
    return wrong


def wrong_arrows_of_formats(path, text):
    if not path.startswith("formats/") or path.count("/") < 2:
        return []
    rank = {folder: rank for rank, folders in enumerate(FORMATS) for folder in folders}
    own = path.split("/")[1]
    others = [included.split("/")[1] for included in includes(text) if included.startswith("formats/") and included.count("/") > 1]
    return [f"{path} includes formats/{other}/" for other in others if other != own and rank[other] >= rank[own]]


def too_long(path, text):
    lines = text.splitlines()
    wrong = [f"{path}:{i} has {len(line)} columns" for i, line in enumerate(lines, 1) if len(line) > MAX_COLUMNS]
    if len(lines) > MAX_LINES and path not in LONG_FILES:
        wrong.append(f"{path} has {len(lines)} lines")
    return wrong


def long_functions(path, text):
    """"file: name" of functions with too many lines."""
    return [f"{path}: {name}" for _, name, lines in functions(text) if lines > MAX_FUNCTION_LINES]


def method_names():
    """Of integrators and variants, from the registry."""
    lines = (ROOT / "integrators" / "registry.list").read_text(encoding="utf-8").splitlines()
    return sorted({name for line in lines if line and line[0] != "#" for name in line.split()[:2]})


# Who may ask for a method by its name: the registry, what finds a method's renderer, and what a method says of itself.
# Formats and peers have names of other renderers' plugins.
NAMING = re.compile(r"integrators/registry[^/]*|render/make_renderer\.cpp|integrators/.*/variant\.h|formats/.*|(experiments/)?peers/.*")


def compared_names(path, text):
    """Lines that compare the name of a method, or look a method up by its name."""
    if NAMING.fullmatch(path):
        return []
    name = f'"(?:{"|".join(method_names())})"'
    field = r"\b(?:integrator|variant)"
    asks = re.compile(rf"[=!]=\s*{name}|{name}\s*[=!]=|(?:\.|->){field}\s*[=!]=|[=!]=\s*(?:\w+(?:\.|->))+{field}\b|"
                      rf"(?:find_variant|\bis|makes_references)\([^)]*{name}|(?:compare|starts_with|find)\({name}")
    return [f"{path}:{i} asks for a method by its name: {line.strip()}"
            for i, line in enumerate(text.splitlines(), 1) if asks.search(line.split("//")[0])]


# nvcc copies a struct up to its first member without an address, and leaves out what follows.
NO_ADDRESS_INSIDE = re.compile(r"no_unique_address\]\][^;]*;[^\n]*\n[ \t]*[^\s}]")


def members_without_address(path, text):
    return [f"{path}: a member without an address must be the last of its struct: {found.group().splitlines()[0]}"
            for found in NO_ADDRESS_INSIDE.finditer(text)]


def all_wrong(check):
    found = list(sources())
    assert len(found) > 200
    return [line for path in found for line in check(path, (ROOT / path).read_text(encoding="utf-8"))]


def test_a_folder_includes_only_those_above_it():
    wrong = all_wrong(wrong_arrows)
    assert not wrong, "\n".join(["", *wrong])


def test_formats_know_their_tree_and_not_each_other():
    wrong = all_wrong(wrong_arrows_of_formats)
    assert not wrong, "\n".join(["", *wrong])


def test_exceptions_are_still_needed():
    for path, included in EXCEPTIONS:
        assert included in includes((ROOT / path).read_text(encoding="utf-8")), (path, included)
    for path in LONG_FILES:
        lines = len((ROOT / path).read_text(encoding="utf-8").splitlines())
        assert lines > MAX_LINES, f"{path} has {lines} lines: take it out of LONG_FILES"


def test_no_line_and_no_file_is_too_long():
    wrong = all_wrong(too_long)
    assert not wrong, "\n".join(["", *wrong])


def python_functions():
    """(file, name, lines) of what is no test."""
    for folder in ("python", "scripts"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            if "tests" not in path.parts:
                for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                    if isinstance(node, ast.FunctionDef):
                        yield path.relative_to(ROOT).as_posix(), node.name, node.end_lineno - node.lineno + 1


def test_no_function_is_too_long():
    assert set(all_wrong(long_functions)) == LONG_FUNCTIONS
    assert not [f"{path}: {name}" for path, name, lines in python_functions() if lines > MAX_FUNCTION_LINES]


@pytest.mark.parametrize(("text", "found"), [
    ("int f() { return 1; }", [(1, "f", 1)]),
    ("struct S {\n    S() : a_{1}, b_(2) {\n        g();\n    }\n    int a_{0}, b_;\n};\nint h(S s = {}) {\n}", [(2, "S", 3), (7, "h", 2)]),
    ("namespace n {\ntemplate <class T>\n    requires(T::k > 0)\nvoid S<T>::operator()(int i) const {\n    if (i) {\n    }\n    auto l = [] {\n    };\n}\n}",
     [(2, "S<T>::operator()", 8)]),
    ('const char* a[] = {\n"}", R"x({{)x"};\n// {\nconstexpr int b = 1\'000, c = \'{\';\n#define M {\nint f() {\n}', [(6, "f", 2)]),
    ("struct A {\n    enum class E { a };\n    int x = 0;\n    bool operator==(const A&) const = default;\n    A operator+(A a) const { return a; }\n};", [(5, "operator+", 1)]),
])
def test_functions_are_found_by_their_braces(text, found):
    assert list(functions(text)) == found


def test_only_the_registry_asks_for_a_method_by_its_name():
    wrong = all_wrong(compared_names)
    assert not wrong, "\n".join(["What others ask of a method stands in its variant.h (integrators/registry.h):", *wrong])


@pytest.mark.parametrize(("members", "wrong"), [
    ("    [[no_unique_address]] A a;  ///< why\n};", 0),
    ("    [[no_unique_address]] A a = {};\n\n    int f() const;\n};", 0),
    ("    [[no_unique_address]] A a;\n    int b;\n};", 1),
])
def test_members_without_address_are_found(members, wrong):
    assert len(members_without_address("a.h", f"struct S {{\n{members}\n")) == wrong


def test_members_without_address_come_last():
    wrong = all_wrong(members_without_address)
    assert not wrong, "\n".join(["", *wrong])


@pytest.mark.parametrize(("path", "line", "wrong"), [
    ("render/a.cpp", 'if (settings.integrator == "path") return;', 1),
    ("render/a.cpp", 'if ("lvc" != settings.variant) return;', 1),
    ("render/a.cpp", "for (const char* name : names) if (settings.integrator == name) return;", 1),
    ("render/a.cpp", "if (name == r.variant) return;", 1),
    ("render/a.cpp", "if (of == \"learned\") return;", 1),
    ("render/a.cpp", 'find_variant("bdpt", kPaired)', 1),
    ("render/a.cpp", "if (settings.variant_count == 2) return;", 0),
    ("render/a.cpp", 'const char* const name = "path";  // == "path"', 0),
    ("integrators/bdpt/lvc/variant.h", 'if (settings.variant == "lvc") return;', 0),
    ("integrators/registry.cpp", "if (v.integrator == name) return;", 0),
    ("integrators/reachability.cpp", 'if (settings.integrator == "light") return;', 1),
    ("formats/mitsuba/a.cpp", 'if (type == "path") return;', 0),
])
def test_comparisons_of_names_are_found(path, line, wrong):
    assert len(compared_names(path, line)) == wrong


def test_every_folder_of_sources_has_its_place_in_the_order():
    known = {*RANK, "tests", "examples", "cmake", "scripts"}  # scripts: a driver for another renderer's classes
    ignored = (".", "build", "out", "bundle")
    folders = [path for path in ROOT.iterdir() if path.is_dir() and not path.name.startswith(ignored)]
    found = {folder.name for folder in folders if any(path.name.endswith(SUFFIXES) for path in folder.rglob("*"))}
    assert found <= known


@pytest.mark.parametrize(("path", "line", "wrong"), [
    ("core/a.h", '#include "core/b.h"', 0),
    ("stages/a.h", '#include "film/b.h"', 0),
    ("core/a.h", '#include "scene/b.h"', 1),
    ("film/a.h", '#include "queues/b.h"', 1),
    ("film/a.h", '  # include "cli/b.h"  // why', 1),
    ("film/a.h", "#include <queues/b.h>", 0),
    ("cli/a.h", '#include "tests/b.h"', 1),
    ("cmake/registry.cpp.in", '#include "render/b.h"', 1),
    ("cmake/renderers.cpp.in", '#include "render/b.h"', 0),
])
def test_arrows_are_judged_by_their_folders(path, line, wrong):
    assert len(wrong_arrows(path, f"// x\n{line}\n")) == wrong


def imports(path):
    """Modules of the package analysis that a file of it imports, wherever in the file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module == "ambilux.analysis":
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("ambilux.analysis."):
            yield node.module.split(".")[2]
        elif isinstance(node, ast.Import):
            yield from (alias.name.split(".")[2] for alias in node.names if alias.name.startswith("ambilux.analysis."))


def test_modules_of_the_analysis_import_each_other_in_no_circle():
    modules = {path.stem: set(imports(path)) for path in (ROOT / "python/ambilux/analysis").glob("*.py")}
    assert modules["stress"] >= {"stress_maps", "stress_page"}
    graphlib.TopologicalSorter(modules).prepare()  # throws CycleError with the circle


def test_sources_are_formatted():
    if not (ROOT / ".git").exists():
        pytest.skip("no git checkout")
    done = subprocess.run([ROOT / "scripts" / "checks" / "check_format.sh"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr

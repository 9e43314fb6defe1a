"""Code that docs/ show as that of a file is in that file, and files that docs/extending.md names are there."""

import re
import textwrap
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[4]
SHOWN = re.compile(r"^From `([^`\n]+)`[^\n]*\n\n```(?:cpp|list)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"^```(?:cpp|list)$", re.MULTILINE)


def shown():
    pages = sorted((ROOT / "docs").glob("*.md"))
    return [(page.name, *found) for page in pages for found in SHOWN.findall(page.read_text(encoding="utf-8"))]


def plain(code):
    """Without what indentation of a function or a class adds."""
    return textwrap.dedent(code).strip("\n")


@pytest.mark.parametrize(("page", "path", "code"), shown())
def test_shown_code_is_that_of_its_file(page, path, code):
    source = (ROOT / path).read_text(encoding="utf-8")
    for part in code.split("// ...\n"):
        lines = plain(part).splitlines()
        depths = {line[: len(line) - len(line.lstrip())] for line in source.splitlines() if line.strip() == lines[0].strip()}
        indented = ["\n".join(depth + line if line else line for line in lines) for depth in depths]
        assert any(text in source for text in indented), f"{page}: {path} no longer has\n{part}"


def test_schedules_and_the_tutorial_are_shown():
    found = [(page, path) for page, path, _ in shown()]
    assert ("architecture.md", "integrators/bdpt/shared/two_sides.h") in found
    assert ("architecture.md", "examples/methods/photon_density/integrator.h") in found
    tutorial = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
    assert len(CODE.findall(tutorial)) == sum(page == "extending.md" for page, _ in found) >= 8


def test_files_that_the_tutorial_names_are_there():
    page = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
    folders = "integrators|transport|stages|queues|models|formats|film|tests|backends|scene|cmake|render|examples"
    names = [name for name in re.findall(rf"`((?:{folders})/[^`]*)", page) if "NAME" not in name and " " not in name]
    assert names
    missing = [name for name in names if not (ROOT / name).exists()]
    assert not missing

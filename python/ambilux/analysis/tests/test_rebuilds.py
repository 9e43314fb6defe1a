"""What an edited leaf rebuilds, by the dependencies that compilers wrote in the build folder."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[4]
BUILD = Path(os.environ.get("AMBILUX_BUILD_DIR", ROOT / "build"))
# Those of integrators, levels and backends: as many as a build is configured with.
UNITS = "render/CMakeFiles/ambilux_renderers.dir/"

# What a leaf may rebuild besides tests: folders, and objects that are no units. Pilots, replays, AOVs and the twin.
LEAVES = {
    "transport/bsdf/phong.h": ({"integrators", "render"}, 8),
    "transport/mis/heuristic.h": ({"backends", "integrators", "render"}, 16),
}


def dependencies(text):
    """Of `ninja -t deps`: for each object that is up to date, the files that it was compiled from."""
    found = {}
    for block in text.split("\n\n"):
        head, *files = block.strip().splitlines() or [""]
        name, _, state = head.partition(": ")
        if state.endswith("(VALID)"):
            found[name] = [file.strip() for file in files]
    return found


@pytest.fixture(name="built", scope="module")
def built_objects():
    if not (BUILD / "build.ninja").exists() or not shutil.which("ninja"):
        pytest.skip(f"{BUILD} was not built with ninja, which knows what objects depend on")
    done = subprocess.run(["ninja", "-C", BUILD, "-t", "deps"], capture_output=True, text=True, check=True)
    built = dependencies(done.stdout)
    if not any(name.startswith(UNITS) for name in built) or not any(name.startswith("cli/") for name in built):
        pytest.skip(f"{BUILD} is not built, or objects are older than what they depend on")
    return built


@pytest.mark.parametrize("leaf", LEAVES)
def test_an_edited_leaf_rebuilds_what_renders_or_tests_it(built, leaf):
    folders, most = LEAVES[leaf]
    rebuilt = [name for name, files in built.items() if any(file.endswith(leaf) for file in files)]
    of_program = [name for name in rebuilt if not name.startswith("tests/")]
    wrong = [name for name in of_program if name.split("/")[0] not in folders]
    assert not wrong, "\n".join([f"{leaf} rebuilds", *wrong])
    units = [name for name in of_program if name.startswith(UNITS)]
    assert units, f"no renderer depends on {leaf}"
    others = [name for name in of_program if name not in units]
    assert len(others) <= most, "\n".join([f"{leaf} rebuilds {len(others)} objects besides renderers", *others])


def test_with_one_level_an_edited_bsdf_rebuilds_at_most_20_objects(built):
    rebuilt = [name for name, files in built.items() if any(f.endswith("transport/bsdf/phong.h") for f in files)]
    one_level = [name for name in rebuilt if not name.startswith("tests/") and
                 (not name.startswith(UNITS) or name.endswith("_All.cpp.o"))]
    assert len(one_level) <= 20, "\n".join(one_level)


def test_dependencies_are_read_as_ninja_writes_them():
    text = "a.o: #deps 2, deps mtime 12 (VALID)\n    ../a.cpp\n    ../a.h\n\nb.o: #deps 1, deps mtime 3 (STALE)\n    ../b.cpp\n\n"
    assert dependencies(text) == {"a.o": ["../a.cpp", "../a.h"]}
    assert not dependencies("")

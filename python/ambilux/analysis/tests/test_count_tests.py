"""scripts/checks/count_tests.py on files as ctest and pytest write them."""

import importlib.util
from pathlib import Path

import pytest

path = Path(__file__).parents[4] / "scripts" / "checks" / "count_tests.py"
spec = importlib.util.spec_from_file_location("count_tests", path)
count_tests = importlib.util.module_from_spec(spec)
spec.loader.exec_module(count_tests)

CTEST = """<testsuite>
<testcase name="ok" classname="ok" status="run"><system-out>skipped: AMBILUX_DATA is not set
nothing skipped here
tests/test_x.cpp:70: warning:
  no CUDA device

All tests passed</system-out></testcase>
<testcase name="bad" classname="bad" status="fail"><failure message="Failed"/></testcase>
<testcase name="gone" classname="gone" status="notrun"><skipped message="Unable to find executable"/></testcase>
<testcase name="device" classname="device" status="notrun"><skipped message="SKIP_RETURN_CODE=4"/></testcase>
</testsuite>"""
PYTEST = """<testsuites><testsuite>
<testcase classname="a.b" name="t1"/><testcase classname="a.b" name="t2"><skipped/></testcase><testcase classname="a.b" name="t3"/>
</testsuite></testsuites>"""


@pytest.fixture
def files(tmp_path):
    (tmp_path / "ctest.xml").write_text(CTEST)
    (tmp_path / "pytest.xml").write_text(PYTEST)
    return tmp_path


def last_line(capsys):
    return capsys.readouterr().out.splitlines()[-1]


def test_totals_and_names(files, capsys):
    assert count_tests.main([files / "ctest.xml", files / "pytest.xml"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == "3 passed, 2 failed, 2 skipped"
    assert "within ok: skipped: AMBILUX_DATA is not set" in lines
    assert "within ok: no CUDA device" in lines
    assert sum(line.startswith("within") for line in lines) == 2
    assert "failed: gone (not run: Unable to find executable)" in lines


def test_success(files, capsys):
    assert count_tests.main([files / "pytest.xml"]) == 0
    assert last_line(capsys) == "2 passed, 0 failed, 1 skipped"


def test_a_missing_file_is_a_failure(files, capsys):
    assert count_tests.main([files / "pytest.xml", files / "none.xml"]) == 1
    assert last_line(capsys) == "2 passed, 1 failed, 1 skipped"

"""Adds up JUnit files: names what failed and what was skipped, then prints "N passed, N failed, N skipped".

Usage: count_tests.py FILE...
Exit status 1 when a test failed, no test ran, or a file is missing (a runner that died writes none, which must not look like success).
"""

import re
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

# Catch2 2 cannot skip a single test case, so a case that lacks a device or data says so by WARN (printed as "FILE:LINE: warning:" and the
# text below) or by a line that begins with "skip", and returns.
REMARK = re.compile(r"^\S+:\d+: warning:\s*\n\s*(\S.*)$|^\s*(\[?skip(?:ped|ping)?\]?\b[: ].*)$", re.IGNORECASE | re.MULTILINE)


def tally(path):
    """Returns (passed, failed, skipped, notes) of one JUnit file; notes are lines for the reader."""
    passed, failed, skipped, notes = 0, 0, 0, []
    for case in ET.parse(path).getroot().iter("testcase"):
        name = ".".join(filter(None, [case.get("classname"), case.get("name")]))
        if case.get("classname") == case.get("name"):
            name = case.get("name")
        skip = case.find("skipped")
        # ctest writes a test whose executable is missing as skipped too, with another message.
        not_run = case.get("status") == "notrun" and not (skip is not None and (skip.get("message") or "").startswith("SKIP_"))
        if case.find("failure") is not None or case.find("error") is not None or case.get("status") == "fail" or not_run:
            failed += 1
            notes.append(f"failed: {name}" + (f" (not run: {skip.get('message')})" if not_run and skip is not None else ""))
        elif skip is not None or case.get("status") == "disabled":
            skipped += 1
            notes.append(f"skipped: {name}")
        else:
            passed += 1
            output = case.findtext("system-out") or ""
            remarks = dict.fromkeys((m[1] or m[2]).strip() for m in REMARK.finditer(output))
            notes += [f"within {name}: {remark}" for remark in remarks]
    return passed, failed, skipped, notes


def main(paths):
    totals, broken, all_notes = [0, 0, 0], False, []
    for path in map(Path, paths):
        if not path.exists():
            all_notes.append(f"failed: {path.name} was not written: its test runner did not finish")
            broken = True
            continue
        *counts, notes = tally(path)
        totals = [a + b for a, b in zip(totals, counts)]
        all_notes += notes
    passed, failed, skipped = totals
    failed += broken
    for note in all_notes:
        print(note)
    print(f"{passed} passed, {failed} failed, {skipped} skipped")
    return 1 if failed or passed == 0 else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Places for faults that scripts/checks/mutation_sites.py finds, and what it makes of them."""

import random
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[4] / "scripts" / "checks"))

import mutation_sites  # noqa: E402

SOURCE = """#pragma once
// a * b in a comment is no place.
template <class T, int N>
inline float area(const Shape& s, float scale) {
    static_assert(N > 1);
    const float r = s.radius * scale, inv = 1.0f / (2.0f * r);
    if (r < 0.0f && s.flip) return -1.0f;
    sum += weight<T, N>(r, inv);
    return r * r - max(inv, r);
}
constexpr int kTwo = 1 + 1;
"""


def faults():
    return {(s.original, s.mutated) for s in mutation_sites.sites_of("f.h", SOURCE)}


def test_expressions_end_at_commas_brackets_and_logical_operators():
    found = faults()
    assert ("s.radius * scale", "s.radius / scale") in found
    assert ("s.radius * scale", "s.radius") in found
    assert ("1.0f / (2.0f * r)", "1.0f") in found
    assert ("2.0f * r", "r") in found
    assert ("r < 0.0f", "r >= 0.0f") in found
    assert ("r < 0.0f && s.flip", "r < 0.0f || s.flip") in found
    assert ("r * r - max(inv, r)", "r * r + max(inv, r)") in found
    assert ("r * r - max(inv, r)", "(r * r - max(inv, r)) * 1.01f") in found


def test_calls_statements_and_conditions():
    found = faults()
    assert ("weight<T, N>(r, inv)", "weight<T, N>(inv, r)") in found
    assert ("sum += weight<T, N>(r, inv);", "") in found
    assert ("r < 0.0f && s.flip", "!(r < 0.0f && s.flip)") in found
    assert not any(m == "max(r, inv)" for _, m in found)  # the same value


def test_comments_constants_of_the_compiler_and_templates_are_left_alone():
    for site in mutation_sites.sites_of("f.h", SOURCE):
        line = SOURCE.splitlines()[site.line - 1]
        assert "comment" not in line and "static_assert" not in line and "constexpr" not in line and "template" not in line


def test_faults_do_not_overlap_and_a_seed_draws_the_same():
    sites = [s for name in ("a.h", "b.h") for s in mutation_sites.sites_of(name, SOURCE)]
    drawn = mutation_sites.draw(sites, 8, random.Random(3))
    assert drawn == mutation_sites.draw(sites, 8, random.Random(3))
    assert {s.file for s in drawn[:2]} == {"a.h", "b.h"}
    for i, a in enumerate(drawn):
        assert not any(a.file == b.file and a.start < b.end and b.start < a.end for b in drawn[:i])
    assert drawn[0] not in mutation_sites.draw(sites, 8, random.Random(3), {drawn[0]})


def test_the_rewritten_text_holds_both_and_nothing_else_changes():
    sites = [s for s in mutation_sites.sites_of("f.h", SOURCE) if s.mutated in ("s.radius / scale", "")]
    text = mutation_sites.rewrite(SOURCE, list(enumerate(sites, 1)))
    for number, site in enumerate(sites, 1):
        assert site.wrapped(number) in text
        text = text.replace(site.wrapped(number), site.original)
    assert text.replace('#include "core/mutation.h"\n', "") == SOURCE

"""Patterns are read as ECMA-262 has them, in a bounded time; some are rewritten for Python, to generate texts."""

import re
import time

import pytest

from conformance.documents.json_shape import shape_of
from conformance.documents.patterns import (
    PatternError,
    SlowPatternError,
    check,
    for_python,
    matches,
    with_python_patterns,
)


@pytest.mark.parametrize(
    ("pattern", "fits", "other"),
    [
        (r"^(?<k>[ab])\k<k>$", "aa", "ab"),
        (r"^\p{L}+$", "aé", "a1"),
        (r"^\p{Script=Greek}+$", "αβ", "ab"),
        (r"^\P{L}$", "1", "é"),
        (r"^\d$", "3", "٣"),
        (r"^\w$", "_", "é"),
        (r"^[\w.]+$", "a.b", "é"),
        (r"^\W$", "é", "a"),
        (r"^a$", "a", "a\n"),
        (r"^.$", "😀", "\u2028"),
        (r"^.$", "x", "\r"),
        (r"^\s$", "\ufeff", "x"),
        (r"^[^]$", "\n", ""),
        (r"^a[]?$", "a", "b"),
        (r"^\cA$", "\x01", "A"),
        (r"^\x41\0?$", "A", "B"),
        (r"^\u{1F600}$", "😀", "x"),
        (r"^\ud83d\ude00$", "😀", "x"),
        (r"(?<=a+)b", "aab", "cb"),
        (r"(?<!ab|c)d", "xd", "cd"),
        (r"^(?!.*\.\.)[a-z.]+$", "a.b", "a..b"),
        (r"^\p{L}\-\_x$", "é-_x", "e_x"),
        (r"^a{,3}$", "a{,3}", "aa"),
        (r"^[a-z&&[b]]$", "&]", "b"),
        (r"^(a+)+$", "a" * 50, "a" * 50 + "!"),
        (r"^[+-]?\d+(?:\.\d+)?$", "-1.5", "1."),
        (r"^\p{L}$", "é", "\ud83d"),
        (r"^a$", "a", "\ud83d"),
    ],
)
def test_a_pattern_matches_what_ecma_262_says(pattern, fits, other):
    assert matches(pattern, fits)
    assert not matches(pattern, other)
    shape = shape_of({"pattern": pattern})
    assert (shape.problem(fits), shape.holds(fits), shape.holds(other)) == ("", True, False)


@pytest.mark.parametrize(
    "pattern", ["(", "a**", "a++", "(?P<n>a)", r"\Z", r"\A", "(?i)a", "(?>a)", r"\p{Nope}", "[z-a]", "a{3,1}"]
)
def test_what_ecma_262_does_not_have_is_no_pattern(pattern):
    with pytest.raises(PatternError, match="ECMA-262"):
        check(pattern)
    with pytest.raises(PatternError):
        shape_of({"patternProperties": {pattern: {}}})


@pytest.mark.parametrize("pattern", [r"^(?=a)(a+)+$", r"^(?=a)(?:a|aa)+$", r"^(a|a)*\1$(?=x)"])
def test_a_pattern_that_backtracks_for_ever_ends(pattern):
    started = time.process_time()
    for _ in range(10):
        with pytest.raises(SlowPatternError, match="takes too long"):
            shape_of({"pattern": pattern}).problem("a" * 100 + "!")
    assert time.process_time() - started < 2


def test_another_text_of_a_pattern_with_nested_quantifiers_is_judged():
    assert matches(r"^(?=a)(b|a+)+?$", "aab")
    assert not matches(r"^(?=a)(b|a+)+?$", "aac")


def test_names_of_members_are_matched_as_ecma_262_says():
    shape = shape_of({"patternProperties": {r"^(?<k>[ab])\k<k>$": {"type": "integer"}}, "additionalProperties": False})
    assert shape.holds({"aa": 1})
    assert "'ab' was unexpected" in shape.problem({"ab": 1})
    assert "not of type integer" in shape.problem({"aa": "x"})
    numbers = shape_of({"patternProperties": {r"^\d$": {"type": "integer"}}, "additionalProperties": False})
    assert numbers.holds({"3": 1})
    assert not numbers.holds({"٣": 1})


@pytest.mark.parametrize(
    ("pattern", "text"),
    [
        (r"^\p{L}{1,8}$", "é"),
        (r"^(?<a>x)(y)(?<b>z)\k<b>\2$", "xyzzy"),
        (r"^[^\p{L}]\d$", "-3"),
        (r"^[\p{L}\d_-]+$", "é3_"),
        (r"^\u{1F600}\ud83d\ude00\x41\cA$", "😀😀A\x01"),
        (r"^[^]x\/$", "\nx/"),
        ("^[[]$", "["),
    ],
)
def test_a_pattern_for_python_matches_the_same(pattern, text):
    assert re.search(for_python(pattern), text)
    assert matches(pattern, text)


def test_a_description_for_generating_has_only_patterns_that_python_reads():
    schema = {
        "properties": {"pattern": {"pattern": r"(?<=a+)b"}, "x": {"pattern": "^a$"}},
        "patternProperties": {r"^\p{L}$": {"pattern": r"^\cA$"}, "(": {}},
    }
    found = with_python_patterns({"a": [schema]})["a"][0]
    assert found["properties"] == {"pattern": {}, "x": {"pattern": "^a$"}}
    (name,) = found["patternProperties"]
    assert re.search(name, "é")
    assert found["patternProperties"][name] == {"pattern": "^\x01$"}

"""A count and its noun agree: "1 request", "2 requests".

A sentence with a count is written by `counted`, in Python and in templates, unless it can never speak of one.
"""

import re
from pathlib import Path

import pytest

from conformance.verdict.finding import count_of as in_terminal
from reports.pages.page import counted as in_pages

ROOT = Path(__file__).parents[1]
PLACES = (
    "conformance/cli", "conformance/engine", "conformance/verdict", "conformance/api", "conformance/fleet",
    "reports",
)  # fmt: skip
NOUNS = "operations|requirements|requests|robots|checks|scenarios|findings|failures|messages|rules|classes|envelopes"
COUNT = re.compile(rf"(?<!of )\{{[^{{}}]*\}}+ (?:more |other |new )?(?:{NOUNS})\b(?!/s)")
# Sentences that never speak of one, by words of theirs.
NEVER_ONE = (
    "if count > 1",
    'if count == 1 else f"All {count}',
    "operations show it",
    "roaas explain ID explains one",  # the requirements of a ledger
    "all {count} requirements of the",
    "the mutants took",
    "else lists",
    "{self._total} checks, ",  # 3/120 checks
    'found[1].decode()} checks"',
    "<summary>{{ number }} requirements",  # a list that is long
    "at most {{ fleet.parallel }} robots",
    "but lists {there}",
    "findings, but ended with",
    ":.0%} of the cases",
    "coverage.operations[1] }} operations",  # 3 of 12
    "resends",
    "{% endfor %} requirements |",  # the head of a column
)


def lines():
    for place in PLACES:
        for path in sorted((ROOT / place).rglob("*")):
            if path.suffix in {".py", ".j2"}:
                for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
                    yield f"{path.relative_to(ROOT)}:{number}: {line.strip()}"


def test_no_sentence_speaks_of_one_as_of_several():
    found = [line for line in lines() if COUNT.search(line) and not any(words in line for words in NEVER_ONE)]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("counted", [in_terminal, in_pages])
@pytest.mark.parametrize(("number", "text"), [(0, "0 requests"), (1, "1 request"), (2, "2 requests")])
def test_a_count_and_its_noun_agree(counted, number, text):
    assert counted(number, "request") == text

"""The verdict's first line says to what, how it was seen, and on how many of the cases."""

import pytest

from conformance.contract.pack import Contract
from conformance.verdict.effort import Effort, Tally
from conformance.verdict.run import Run
from conformance.verdict.verdicts import ClassValue, Overall, overall, verdict_line

_ALL = tuple(Contract.load().classes)
_VERSION = Contract.load().version
_TWO = ("http", "safety")
_PASSED = {"http": (ClassValue.PASS, "")}


@pytest.mark.parametrize(
    ("claims", "value", "expected"),
    [
        (_ALL, Overall.CONFORMANT, f"conformant to full (contract {_VERSION}), black box"),
        (_ALL[:1], Overall.NOT_CONFORMANT, f"not conformant to {_ALL[0]} only (contract {_VERSION}), black box"),
        (
            ("safety", "http"),
            Overall.INCONCLUSIVE,
            f"inconclusive for safety, http only (contract {_VERSION}), black box",
        ),
    ],
)
def test_a_verdict_says_to_what(claims, value, expected):
    assert verdict_line(Run(claims=claims), value, []) == expected


def test_what_was_cut_stands_in_the_first_line():
    slow = Run(claims=_ALL, effort=Effort().slowed_to(240))
    assert verdict_line(slow, Overall.CONFORMANT, []).endswith("black box, on 5 % of the cases: 240 ms an answer")
    cut = Run(claims=_ALL, tally=Tally(planned=100, cut_short={"test_x": 30}))
    assert cut.less == "on 70 % of the cases: time ran out"
    assert Run(claims=_ALL, tally=Tally(planned=1000, cut_short={"test_x": 3})).less == ""


def test_too_few_cases_are_no_verdict_unless_the_robot_failed():
    assert Run(effort=Effort().slowed_to(240)).enough
    assert not Run(effort=Effort().slowed_to(2000)).enough
    assert overall(_PASSED) is Overall.CONFORMANT
    assert overall(_PASSED, enough=False) is Overall.INCONCLUSIVE
    assert overall({"http": (ClassValue.FAIL, "")}, enough=False) is Overall.NOT_CONFORMANT


def test_a_busy_machine_changes_no_case():
    """The same robot, beside others: some answers come late, and the shortest time stays."""
    assert Effort().slowed_to(90, 3).cases(200) == Effort().slowed_to(2, 1).cases(200)
    assert Effort().slowed_to(300, 240).speed.name == "far"

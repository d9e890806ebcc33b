"""What a run says of itself that cannot be true, and how it departs from a ledger."""

import msgspec
import pytest
from vendors import make_conformant, requirement

from reports.attestation.outcomes import Entry, contradictions, departures, first_names, musts_of
from reports.attestation.statement import run_of


@pytest.fixture
def run(result):
    make_conformant(result)
    return run_of(result)


LEDGER = {
    "http/a": Entry("MUST", ("http", "safety"), decides=True, sets=("1",), aliases=("http/former",)),
    "http/b": Entry("MUST", ("http",), sets=("1",)),
    "safety/c": Entry("SHOULD", ("safety",)),
    "describe/d": Entry("MAY", ("describe",)),
}


def test_what_a_run_wrote_agrees(run):
    assert contradictions(run) == []
    assert departures(run, LEDGER, "1", same=True) == []


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"verdict": "Conformant"}, "no verdict of a run"),
        ({"requirements": {"pass": 3}}, "counts"),
        ({"accepted": ["http/z"]}, "not listed"),
        ({"intermittent": ["http/z"]}, "not listed"),
        ({"classes": {"http": "pass", "safety": "fail"}}, "not all claimed classes passed"),
        ({"classes": {"http": "not-claimed"}}, "not all claimed classes passed"),
        ({"outcomes": {"must": {"pass": ["http/a"]}}}, "is no level"),
    ],
)
def test_a_contradiction_is_named(run, changes, said):
    assert any(said in one for one in contradictions(msgspec.structs.replace(run, **changes)))


def listed(*requirements):
    outcomes = {}
    for one in requirements:
        outcomes.setdefault(one["level"], {}).setdefault(one["verdict"], []).append(one["id"])
    return outcomes


A, B, C = requirement(id_="http/a"), requirement(id_="http/b"), requirement("pass", "SHOULD", "safety/c")
D = requirement("not-claimed", "MAY", "describe/d")


@pytest.mark.parametrize(
    ("outcomes", "same", "said"),
    [
        ((A, B, C), True, ["1 of 4 requirements are not listed: describe/d"]),
        ((A,), False, ["1 of 2 requirements are not listed: http/b"]),
        ((A, B), False, []),
        ((A | {"id": "http/former"}, B), False, []),
        ((A | {"id": "http/former"}, B, C, D), True, ["not listed: http/a", "no requirement http/former"]),
        ((A, B, C, D, A | {"id": "http/new"}), True, ["no requirement http/new"]),
        ((A, B, A | {"id": "http/new"}), False, []),
        ((A | {"level": "SHOULD"}, B, C, D), True, ["http/a is listed as SHOULD, but is a MUST"]),
        ((A | {"verdict": "skip"}, B, C, D), True, ["class http passed, although the MUST http/a"]),
        ((A | {"verdict": "not-claimed"}, B, C, D), True, []),
        ((A, B | {"verdict": "skip"}, C, D), True, []),
        ((A, B | {"verdict": "fail"}, C, D), True, ["class http passed, although the MUST http/b"]),
    ],
)
def test_a_departure_from_the_ledger_is_named(run, outcomes, same, said):
    found = departures(msgspec.structs.replace(run, outcomes=listed(*outcomes)), LEDGER, "1", same=same)
    assert len(found) == len(said)
    assert all(words in one for words, one in zip(said, found, strict=True)), found


def test_a_must_of_two_classes_counts_in_both(run):
    assert musts_of(run, LEDGER, ("safety",)) == {"http/a": "pass"}
    assert musts_of(run, {}, ("safety",)) == {}


def test_many_names_are_cut():
    assert first_names(["a", "b", "c"]) == "a, b, c"
    assert first_names(["a", "b", "c", "d", "e"]) == "a, b, c and 2 more"

"""Composed faults: each strikes at its time, for its client or for its values, and nowhere else."""

import pytest

from conformance.contract.pack import Contract
from proof.mutation.messages import Request, Response
from proof.selftest.generated import mutant
from proof.selftest.generated.adversary import compose, kinds_in_requests, unreached_names
from proof.selftest.generated.catalogue import generated_mutants
from proof.selftest.generated.mutant import Tally

CONTRACT = Contract.load()
JSON = [("Content-Type", "application/json")]
_VELOCITY = b'{"linear": {"x": %b, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.5}}'


@pytest.fixture(scope="module")
def faults():
    return {one.name: one for one in compose(generated_mutants(CONTRACT), kinds_in_requests(CONTRACT))}


def _get(**more):
    return Request("rest", "GET", "/robot/velocity/", **more)


def _put(x=b"0.5"):
    return Request("rest", "PUT", "/robot/velocity/", fields=list(JSON), body=_VELOCITY % x)


def _statuses(fault, requests, status=200):
    """Return what a fault that makes 500 of 200 answers to requests."""
    change = fault.make(Tally())
    return [change(one, lambda _: Response(status, list(JSON), _VELOCITY % b"0.5")).status for one in requests]


def test_there_are_many_and_each_has_its_own_name(faults):
    assert len(faults) > 20_000
    always = [one for one in faults.values() if "@" not in one.operator]
    assert {one.operator.partition("@")[2] for one in faults.values()} - {""} == (
        mutant.TIMES.keys() | mutant.OF_NUMBERS.keys() | mutant.OF_TEXTS.keys() | mutant.OF_FORMATS.keys()
    )
    assert len(always) < len(faults) / 10


@pytest.mark.parametrize(
    ("when", "requests", "struck"),
    [
        ("first", [_get(), _get()], [0]),
        ("late", [_get()] * 31, [29, 30]),
        ("rarely", [_get()] * 40, [19, 39]),
        ("new-connection", [_get(nth=1), _get(nth=2), _get(nth=1)], [0, 2]),
        ("kept-connection", [_get(nth=9), _get(nth=10)], [1]),
        ("second-client", [_get(), _get(beside=True)], [1]),
        ("after-write", [_get(), _put(), _get(), _get()], [2]),
    ],
)
def test_a_fault_strikes_when_it_says(faults, when, requests, struck):
    statuses = _statuses(faults[f"status@{when}:getVelocity:200-500"], requests)
    assert [number for number, status in enumerate(statuses) if status == 500] == struck


@pytest.mark.parametrize(
    ("when", "x", "strikes"),
    [
        ("negative", b"-0.5", True),
        ("negative", b"0.5", False),
        ("small", b"0.01", True),
        ("small", b"0.2", False),
        ("exact", b"0.123456789", True),
        ("exact", b"0.125", False),
    ],
)
def test_a_fault_strikes_for_its_values(faults, when, x, strikes):
    fault = faults[f"scale@{when}:putVelocity:request.linear.x:json"]
    seen = []
    fault.make(Tally())(_put(x), lambda request: seen.append(request.body) or Response(204))
    assert (seen[0] != _VELOCITY % x) == strikes


def test_times_of_texts_and_formats(faults):
    assert mutant.OF_TEXTS["markup"][1](mutant.Seen(Request("rest", "GET", "/a?b=c%3Cd"), 1, 0, 0, 0, None))
    assert mutant.OF_TEXTS["beyond-ascii"][1](mutant.Seen(Request("rest", "GET", "/a/%C3%A9"), 1, 0, 0, 0, None))
    wants = Request("rest", "GET", "/robot/velocity/", fields=[("Accept", "application/xml")])
    assert _statuses(faults["status@xml:getVelocity:200-500"], [_get(), wants]) == [200, 500]


def test_times_pass(faults, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(mutant.time, "monotonic", lambda: now[0])
    pause, spell = (faults[f"status@{when}:getVelocity:200-500"] for when in ("after-pause", "now-and-then"))
    for fault, moments, struck in ((pause, [0, 0.5, 1.6, 2], [2]), (spell, [0, 7, 8.5, 9.5, 11], [2, 3])):
        change, found = fault.make(Tally()), []
        for moment in moments:
            now[0] = 100.0 + moment
            found.append(change(_get(), lambda _: Response(200, list(JSON), _VELOCITY % b"0.5")).status)
        assert [number for number, status in enumerate(found) if status == 500] == struck


def test_what_alters_no_message_of_a_run_is_known_beforehand(faults):
    """Try faults on the messages of a run, without their condition where time or other requests decide it."""
    first, late, together = (faults[f"status@{when}:getVelocity:200-500"] for when in ("first", "late", "together"))
    messages = [(_get(), Response(200, list(JSON), _VELOCITY % b"0.5"))] * 20
    assert unreached_names([first, late, together], messages) == {late.name}
    assert unreached_names([first, late, together], []) == {first.name, late.name, together.name}

"""Which format a robot sends for which Accept header (RFC 9110 12.4.2, 12.5.1)."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import pytest

from conformance.api.expectation import expect
from conformance.api.rest.applicable import working_reads
from conformance.api.rest.calls import Call
from conformance.api.rest.formats import are_data, quality
from conformance.api.rest.interface import RestInterface
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Judge

pytestmark = [pytest.mark.phase("settling"), pytest.mark.needs("rest")]
_Q = "rest-formats/q-values"
_SPECIFIC = "rest-formats/specific-range"
_DEFAULT = "rest-formats/json-default"
# Resources with formats that are not data, which are requested as well.
_OTHERS = 2
# Further values that a finding names.
_NAMED = 11
# {a} is the default format, {b} and {c} the others (or the default again), {A} to {C} in capitals.
_MATRIX = (
    (_Q, "{b}"),
    (_Q, "{c}"),
    (_Q, "{a};q=0.5, {b}"),
    (_Q, "{a};q=0.5, {c};q=0.6"),
    (_Q, "{b};q=0.2, {c};q=0.9, {a};q=0.5"),
    (_Q, "{b};q=0.9, {c};q=0.2, {a};q=0.5"),
    (_Q, "{c};q=0.2, {b};q=0.5, {a};q=0.9"),
    (_Q, "{a};q=0.001, {b};q=0.002"),
    (_Q, "{a};q=0.1, {b};q=0.01"),
    (_Q, "{a};q=0.1,{c};q=0.8"),
    (_Q, "{a} ; q=0.3 ,  {b} ;q=0.8"),
    (_Q, "{A};q=0.3, {B};q=0.8"),
    (_Q, "{a};Q=0.3, {c};Q=0.8"),
    (_Q, "{b};q=1.000, {a};q=0.999"),
    (_Q, "image/png, {b};q=0.5, {a};q=0.1"),
    (_Q, "{a};version=1;q=0.4, {b};q=0.8"),
    # RFC 9110 5.6.1.2: empty members count for nothing; 5.6.3: white space is a tab as well.
    (_Q, ", {a};q=0.3, ,{b};q=0.8,"),
    (_Q, "{a};q=0.3\t,\t{c};q=0.8"),
    (_SPECIFIC, "{b};q=0.9, */*;q=0.1"),
    (_SPECIFIC, "*/*, {a};q=0.1"),
    (_SPECIFIC, "*/*;q=0.9, {a};q=0.5, {b};q=0.2"),
    (_SPECIFIC, "*/*;q=0.1, {c}"),
    (_SPECIFIC, "application/*;q=0.4, text/*;q=0.5"),
    (_SPECIFIC, "text/*;q=0.5, application/*;q=0.9, application/json;q=0.1"),
    (_SPECIFIC, "text/*, {a};q=0.5"),
    (_SPECIFIC, "text/*;q=0.3, text/plain;q=0, application/xml;q=0.2"),
)
# The same in few rows, for formats that may exist for other values.
_FEW = (
    (_Q, "{a};q=0.5, {b}"),
    (_Q, "{b};q=0.2, {a};q=0.9"),
    (_Q, "{b};q=0.9, {a};q=0.2"),
    (_SPECIFIC, "{b};q=0.9, */*;q=0.1"),
    (_SPECIFIC, "*/*, {a};q=0.1"),
)


@pytest.mark.requirement(_DEFAULT)
def test_default_format(api: RestInterface, judge: Judge) -> None:
    """Send no Accept header, and */*: the response must be JSON."""
    for call in api.run.effort.subsample(working_reads(api, _DEFAULT), 3):
        if "application/json" not in call.operation.formats:
            continue
        for accept in ("", "*/*", "*/*;q=0.5"):
            exchange = call.send(api, ("Accept", accept))
            when = f"Accept is {accept}" if accept else "there is no Accept"
            expect(judge, _DEFAULT, exchange).media_type("application/json", when=when)


@pytest.mark.requirement(_Q, _SPECIFIC)
def test_preferred_format(api: RestInterface, judge: Judge) -> None:
    """Send Accept with preferences: the client gets the format that it prefers."""
    found = working_reads(api)
    calls = [call for call in api.run.effort.subsample(found, 3) if are_data(call.operation.formats)]
    others = [one for one in found if len(one.operation.formats) > 1 and not are_data(one.operation.formats)]
    alone = {id(one): _alone(api, one) for one in others}
    if not calls and not others:
        for id_ in (_Q, _SPECIFIC):
            judge.note_unclaimed(id_, "the contract has no responses in more than one format")
    cases = [(call, id_, text) for call in calls for id_, text in _MATRIX]
    offering = [one for one in others if all(each.holds for each in alone[id(one)])]
    few = [(call, id_, text) for call in offering[:_OTHERS] for id_, text in _FEW]
    # At little effort each line of the matrix is tried with one resource, another one for each line.
    once = [(calls[index % len(calls)], *_MATRIX[index]) for index in range(len(_MATRIX))] if calls else []
    chosen = few + once + api.run.effort.draw(cases, len(cases), f"{api.run.seed}/accept")
    # A resource with a single format has no choice.
    preferred = [each for one in others for each in alone[id(one)] if each.holds]
    try:
        for call, id_, text in chosen:
            preferred.append(Preferred(id_, call.operation.formats, *_send(api, call, text)))
    finally:
        judge_preferred(judge, preferred)


def _alone(api: RestInterface, call: Call) -> list[Preferred]:
    """Ask for the first two formats of a resource by name, each alone."""
    formats = call.operation.formats
    return [Preferred(_Q, formats, name, call.send(api, ("Accept", name))) for name in formats[:2]]


def judge_preferred(judge: Judge, preferred: list[Preferred]) -> None:
    """Judge requests with preferences: one finding for each format that was sent instead of the preferred one."""
    failed = defaultdict(list)
    for preference in preferred:
        if not preference.holds:
            failed[preference.got_type].append(preference.accept)
    for preference in preferred:
        others = [accept for accept in dict.fromkeys(failed[preference.got_type]) if accept != preference.accept]
        more = f" (and for {len(others)} more values of Accept: {' | '.join(others[:_NAMED])})" if others else ""
        expect(judge, preference.requirement, preference.exchange).that(
            preference.holds, f"{preference.expected_text}{more}", cause=preference.got_type
        )


def _send(api: RestInterface, call: Call, text: str) -> tuple[str, Exchange]:
    """Send a line of the matrix; return the value of Accept, and the exchange."""
    formats = call.operation.formats
    a, b, c = (*formats, *formats)[:3]
    accept = text.format(a=a, b=b, c=c, A=a.upper(), B=b.upper(), C=c.upper())
    return accept, call.send(api, ("Accept", accept))


@dataclass(frozen=True)
class Preferred:
    """A request with preferences, for an operation with these formats."""

    requirement: str
    formats: tuple[str, ...]
    accept: str
    exchange: Exchange

    @property
    def got_type(self) -> str:
        """The media type of a successful response, or the status of another one."""
        answer = self.exchange.response
        return answer.media_type if answer.ok else str(answer.status)

    @property
    def _best(self) -> float:
        return max(quality(name, self.accept) for name in self.formats)

    @property
    def holds(self) -> bool:
        """Whether the response has the preferred format, or none is acceptable and the status is 406."""
        # A robot may have further formats of its own, and send one that is as acceptable.
        sent = self.exchange.response.media_type if self.exchange.response.ok else ""
        return quality(sent, self.accept) >= self._best if sent else not self._best and self.got_type == "406"

    @property
    def expected_text(self) -> str:
        """Return the media type that the requirement demands, as a phrase."""
        names = [name for name in self.formats if quality(name, self.accept) == self._best]
        return f"{' or '.join(names) if self._best else 'status 406'} when Accept is {self.accept}"

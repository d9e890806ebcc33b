"""Read resources before and after a time without requests: connections, caches and sleeping parts show there.

Only what no clock changes is compared: whether a resource exists, how long its lists are, and which values are null.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

from conformance.api.call_rules import words_of
from conformance.api.rest.applicable import working_reads
from conformance.api.rest.calls import Call
from conformance.api.rest.interface import RestInterface
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import is_json
from conformance.scenarios.no_effects import RECORDS
from conformance.scenarios.scenario import NoOccasionError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.transport.exchange import Exchange, NoAnswerError
from conformance.verdict.effort import Effort

#: Pauses by effort, s. After each, another resource is read first.
PAUSES_S: Final = {"quick": (1.6,), "standard": (1.6, 1.6, 10.0), "deep": (1.6, 1.6, 1.6, 1.6, 10.0, 30.0)}
_READS: Final = 6  # resources that are read
_TIMES: Final = 3  # pauses after which a response must differ
# Statuses of a device that a client wakes, or whose session has ended.
_OTHERWISE: Final = frozenset({401, 403, 408, 423, 425, 429, 503})


@dataclass(frozen=True)
class AfterPause:
    """The first read of a resource after a pause.

    Attributes:
        operation: its label.
        pause_s: how long no request was sent, s.
        exchange: the read.
        fault: how it differs from the reads before and after it, which are alike; empty if it does not.
    """

    operation: str
    pause_s: float
    exchange: Exchange
    fault: str = ""


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.LATE)
def first_reads_after_pauses(api: RestInterface, effort: Effort) -> tuple[AfterPause, ...]:
    """Read resources, send nothing for a while, and read them twice, another one first each time."""
    calls = working_reads(api, most=_READS)
    if not calls:
        raise NoOccasionError("no operation that only reads got status 200")
    found: dict[str, AfterPause] = {}
    api.run.limit.check()
    with api.run.limit.lift(), suppress(NoAnswerError):  # the survey reports a broken connection
        for turn, pause_s in enumerate(PAUSES_S[effort.name]):
            for one in _read(api, _in_rotation(calls, turn), pause_s):
                if not (one.operation in found and found[one.operation].fault):
                    found[one.operation] = one
    return tuple(found.values())


def _in_rotation(calls: list[Call], turn: int) -> list[Call]:
    first = turn % len(calls)
    return calls[first:] + calls[:first]


def _read(api: RestInterface, calls: list[Call], pause_s: float) -> Iterator[AfterPause]:
    """Read resources around a pause; what differs only directly after it must do so again, read first."""
    for call, exchange, fault in _around(api, calls, pause_s):
        wrong = fault
        for _ in range(_TIMES - 1 if fault else 0):
            ((_, exchange, wrong),) = _around(api, [call], pause_s)  # noqa: PLW2901 - the newest one is shown
            if not wrong:
                break
        yield AfterPause(call.operation.label, pause_s, exchange, wrong)


def _around(api: RestInterface, calls: list[Call], pause_s: float) -> list[tuple[Call, Exchange, str]]:
    """Return the first read of each resource after a pause, and how it differs from those before and after it."""
    before = [_outline(call.send(api)) for call in calls]
    time.sleep(pause_s)
    first = [call.send(api) for call in calls]
    after = [_outline(call.send(api)) for call in calls]
    return [
        (call, exchange, _difference(was, _outline(exchange), now))
        for call, was, exchange, now in zip(calls, before, first, after, strict=True)
    ]


def _difference(was: dict[str, Any], first: dict[str, Any], now: dict[str, Any]) -> str:
    """Return what the first read has in another way than the reads before and after it, which are alike."""
    if not first or not was:
        return ""
    for place, value in was.items():
        if now.get(place) == value and first.get(place, value) != value:
            return f"{clip(first[place])} as {place}, and {clip(value)} before and after it"
    return ""


def _outline(exchange: Exchange) -> dict[str, Any]:
    """Return what a read shows that no clock changes, by a noun phrase; empty if that cannot be told."""
    answer = exchange.response
    if answer.status in _OTHERWISE or answer.cut:
        return {}
    found: dict[str, Any] = {"status": answer.status}
    if answer.ok and is_json(answer.media_type):
        found |= _parts("", read_json(answer.body).value)
    return found


def _parts(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, part in value.items():
            if not words_of(key) & RECORDS:
                yield from _parts(f"{name}/{key}", part)
    elif isinstance(value, list):
        yield f"number of items in {name or 'the body'}", len(value)
    else:
        yield f"type of {name}", "null" if value is None else "a value"

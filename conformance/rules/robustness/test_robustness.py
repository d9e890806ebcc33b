"""No request makes the device crash, hang, slow down, or reveal its insides (CWE-248, CWE-400, CWE-209)."""

from __future__ import annotations

import statistics
from collections.abc import Iterable
from http import HTTPStatus

from conformance.api.rest.statuses import CRASHES
from conformance.api.rest.variations import Kind
from conformance.documents.traceback import inside_shown, path_shown
from conformance.rules.told_once import Fault, told_once
from conformance.scenarios.other_exchanges import others
from conformance.scenarios.rule import Case, NotTested, Outcome, rule
from conformance.scenarios.survey import Probe, Survey, generated_requests, survey
from conformance.transport.exchange import NoAnswer

_ON = (survey, generated_requests)
# A response time has grown when its median is so many times, and so many ms, above that of the first requests.
_TIMES, _MS, _FEWEST = 3.0, 50.0, 15


@rule("robustness/no-server-error", on=_ON)
def no_server_error(trace: Survey) -> Iterable[Outcome]:
    """Judge whether any request makes the device fail with 500, 502 or 504."""

    def fault(probe: Probe) -> Fault | None:
        return Fault(str(probe.status), f"status {probe.status}") if probe.status in CRASHES else None

    yield from told_once(trace.probes, "a status below 500", fault, apart=True)


@rule("robustness/no-crash", on=(*_ON, others))
def no_crash(trace: Survey) -> Iterable[Outcome]:
    """Judge whether the device closes a connection without a response."""

    def fault(probe: Probe) -> Fault | None:
        none = probe.unanswered
        lost = none is not None and none.kind in {NoAnswer.CLOSED, NoAnswer.REFUSED, NoAnswer.MALFORMED}
        return Fault("closed", none.problem if none else "") if lost else None

    yield from told_once(trace.probes, "a response", fault, apart=True)


@rule("robustness/no-hang", on=_ON)
def no_hang(trace: Survey) -> Iterable[Outcome]:
    """Judge whether each request is answered within the deadline; one that waits for something may wait."""
    answering = {one.operation for one in trace.probes if one.exchange is not None}

    def fault(probe: Probe) -> Fault | None:
        none = probe.unanswered
        if none is None or none.kind is not NoAnswer.TIMEOUT:
            return None
        return Fault("hang", none.problem) if probe.operation in answering or not _waits(probe.operation) else None

    yield from told_once(trace.probes, "a response within the deadline", fault, apart=True)


def _waits(operation: str) -> bool:
    """Return whether an operation's path says that it waits for something, as a long poll does."""
    words = (
        "wait",
        "poll",
        "subscribe",
        "stream",
        "event",
        "watch",
        "next",
        "listen",
        "feed",
        "live",
        "follow",
        "tail",
    )
    return any(word in operation.lower() for word in words)


@rule("robustness/no-internals", on=_ON)
def no_internals(trace: Survey) -> Iterable[Outcome]:
    """Judge whether an error response shows a traceback, or a path of the device's file system."""
    errors = [one for one in trace.probes if one.status >= HTTPStatus.BAD_REQUEST]

    def fault(probe: Probe) -> Fault | None:
        exchange = probe.exchange
        if exchange is None:
            return None
        body = exchange.response.body
        shown = inside_shown(body) or path_shown(body, exchange.request)
        return Fault("insides", f"status {probe.status} with {shown!r}") if shown else None

    yield from told_once(errors, "an error that shows nothing of the program", fault, apart=True)


@rule("robustness/recovers", on=(survey,))
def recovers(trace: Survey) -> Iterable[Outcome]:
    """Judge whether the usual request is answered after bad ones as it was before them."""
    for label in {one.operation: None for one in trace.probes}:
        before = [one for one in trace.of(label, Kind.USUAL) if one.ok]
        after = trace.of(label, Kind.AGAIN)
        if not before or not after or not label.startswith(("GET ", "HEAD ")):
            continue

        def fault(probe: Probe, before: Probe = before[-1]) -> Fault | None:
            if probe.exchange is not None and probe.status < HTTPStatus.INTERNAL_SERVER_ERROR:
                return None
            came = f"status {probe.status}" if probe.exchange else probe.attempt.came
            return Fault("after", f"{came}, and status {before.status} before invalid requests")

        yield from told_once(after, "a response as before the invalid requests", fault, apart=True)


@rule("robustness/steady-latency", on=(survey,))
def steady_latency(trace: Survey) -> Iterable[Outcome]:
    """Judge whether one request, sent again and again, is answered as fast at the end as at the beginning."""
    if len(trace.repeats) < 3 * _FEWEST:
        yield NotTested("no operation that only reads was answered often enough")
        return
    third = len(trace.repeats) // 3
    parts = [statistics.median(trace.repeats[start : start + third]) for start in (0, third, 2 * third)]
    grown = parts[0] < parts[1] < parts[2] and parts[2] > _TIMES * parts[0] and parts[2] - parts[0] > _MS
    yield Case(
        not grown,
        trace.repeated,
        f"a response time that does not grow over {len(trace.repeats)} requests",
        f"{parts[0]:.1f} ms at the beginning, {parts[1]:.1f} ms in the middle, {parts[2]:.1f} ms at the end",
    )

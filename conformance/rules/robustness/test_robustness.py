"""No request makes the device crash, hang, slow down, or reveal its insides (CWE-248, CWE-400, CWE-209)."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence
from dataclasses import replace
from http import HTTPStatus

from conformance.api.rest.variations import Kind
from conformance.rules.told_once import Fault, told_once
from conformance.scenarios.estimate import GROWN_MS, GROWN_TIMES, TimedAgain, timed_again
from conformance.scenarios.generated import generated_requests
from conformance.scenarios.neighbours import neighbours
from conformance.scenarios.other_exchanges import others
from conformance.scenarios.own_things import own_things
from conformance.scenarios.pauses import AfterPause, first_reads_after_pauses
from conformance.scenarios.rule import NotTested, Outcome, rule
from conformance.scenarios.survey import TIMED, Probe, Survey, survey
from conformance.transport.exchange import Exchange, NoAnswer
from conformance.verdict.evidence import Case
from conformance.verdict.finding import Showing

_ON = (survey, generated_requests, neighbours, own_things)
# The response time grows if the median of the last _FEWEST requests exceeds that of the first _FEWEST.
_FEWEST = 15
# A body this many times as long may take longer.
_MORE = 1.5


@rule("robustness/no-server-error", on=(*_ON, others))
def no_server_error(_trace: Survey) -> tuple[Outcome, ...]:
    """Play the requests; `checkers.declared` judges each response."""
    return ()


@rule("robustness/no-internals", on=_ON)
def no_internals(_trace: Survey) -> tuple[Outcome, ...]:
    """Play the requests; `checkers.problem` judges each error."""
    return ()


@rule("robustness/no-crash", on=(*_ON, others))
def no_crash(trace: Survey) -> Iterable[Outcome]:
    """Judge whether the device closes a connection without a response."""

    def fault(probe: Probe) -> Fault | None:
        none = probe.unanswered
        lost = none is not None and none.kind in {NoAnswer.CLOSED, NoAnswer.REFUSED, NoAnswer.MALFORMED}
        return Fault(f"closed {none.problem}", none.problem) if none and lost else None

    yield from told_once(trace.probes, "a response", fault)


@rule("robustness/no-hang", on=_ON)
def no_hang(trace: Survey) -> Iterable[Outcome]:
    """Judge whether each request is answered within the deadline; one that waits for something may wait."""
    answering = {one.operation for one in trace.probes if one.exchange is not None}

    def fault(probe: Probe) -> Fault | None:
        none = probe.unanswered
        if none is None or none.kind is not NoAnswer.TIMEOUT:
            return None
        return Fault("hang", none.problem) if probe.operation in answering or not _waits(probe.operation) else None

    yield from told_once(trace.probes, "a response within the deadline", fault)


def _waits(operation: str) -> bool:
    """Return whether an operation's path suggests waiting, as a long poll does."""
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


@rule("robustness/recovers", on=(survey,))
def recovers(trace: Survey) -> Iterable[Outcome]:
    """Judge whether the usual request still gets its usual response after bad ones."""
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


@rule("robustness/recovers", on=(first_reads_after_pauses,))
def answers_after_pauses(trace: tuple[AfterPause, ...]) -> Iterable[Outcome]:
    """Judge whether the first read after a pause returns what the reads before and after it return."""
    for one in trace:
        expected = f"what was read before, though no request was sent for {one.pause_s:g} s"
        yield Case(not one.fault, one.exchange, expected, one.fault, cause=f"{one.operation} pause")


@rule("robustness/steady-latency", on=(survey, timed_again))
def steady_latency(trace: Survey | tuple[TimedAgain, ...]) -> Iterable[Outcome]:
    """Judge whether one request is answered as fast after many others as at the beginning."""
    if isinstance(trace, tuple):
        yield from map(_at_the_end, trace)
        return
    if len(trace.repeats) >= 3 * _FEWEST and trace.repeated is not None:
        yield _steady(trace.repeated, trace.repeats, len(trace.repeats) // 3)
    else:
        yield NotTested("no operation that only reads was answered often enough")
    for label in {probe.operation: None for probe in trace.probes}:
        timed = [probe.exchange for probe in trace.of(label, Kind.AGAIN) if probe.exchange is not None and probe.ok]
        if len(timed) >= 3 * TIMED:
            times = [exchange.response.elapsed_ms for exchange in timed]
            yield replace(
                _steady(timed[-1], times, TIMED),
                cause=label,
                subject=label,
                operations=(Showing(label, 1, timed[-1].request),),
            )


def _at_the_end(timed: TimedAgain) -> Case:
    """Judge the quickest response at the end of the run; a longer response may take longer."""
    before, after = timed.first.response.elapsed_ms, min(timed.times)
    more = len(timed.last.response.body) > _MORE * len(timed.first.response.body)
    return Case(
        more or not timed.has_grown,
        timed.last,
        "a response time that does not grow during the run",
        f"{before:.1f} ms at the beginning, at least {after:.1f} ms at the end",
        cause=timed.operation,
        subject=timed.operation,
        operations=(Showing(timed.operation, 1, timed.last.request),),
    )


def _steady(last: Exchange, times: Sequence[float], number: int) -> Case:
    """Judge the response times of one request, ms: medians of ``number`` responses must not keep growing."""
    parts = [statistics.median(times[start : start + number]) for start in range(0, len(times) - number + 1, number)]
    first, middle, end = parts[0], parts[len(parts) // 2], parts[-1]
    grown = parts == sorted(set(parts)) and end > GROWN_TIMES * first and end - first > GROWN_MS
    told = f"{first:.1f} ms at the beginning, {middle:.1f} ms in the middle, {end:.1f} ms at the end"
    return Case(not grown, last, f"a response time that does not grow over {len(times)} requests", told)

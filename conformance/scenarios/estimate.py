"""How many requests a run of a described device sends, and how long it takes: known before the first check.

What the survey sends is counted, as the same functions draw it. What the checks of HTTP send hardly depends on the
description; their counts are constants, measured with devices of 1, 20 and 188 operations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

from conformance.api.rest.inputs import usual_inputs
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.values import Values
from conformance.contract.described import MOTION, ROS, SOAP, STATES
from conformance.documents.openapi import Operation
from conformance.scenarios.drawing import draw_requests
from conformance.scenarios.pauses import PAUSES_S
from conformance.scenarios.scenario import NotPossibleError, scenario
from conformance.scenarios.soap_survey import requests_of
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.scenarios.survey import COVERAGE, FEWEST_REPEATS, FUZZED, REPEATS, TIMED
from conformance.transport.exchange import Exchange, NoAnswerError
from conformance.verdict.effort import Effort
from conformance.verdict.run import Run
from conformance.verdict.time_limit import TimeIsOverError

_MADE: Final = 0.7  # share of the requested cases that Schemathesis makes, because some are equal or cannot be sent
_COVERING: Final = 15  # cases for each parameter or body member
_READS: Final = 8  # operations that the checks of HTTP read
_EACH_READ: Final = 18  # requests that the checks of HTTP send for each of these operations
# Other requests, and those with a slow device. OPTIONS goes to every operation.
_HTTP: Final = 90
_HTTP_SLOW: Final = 40
_ON_ONE_CONNECTION: Final = 60  # reads on one connection for each operation at standard
_LEAST_ON_ONE: Final = 120  # fewest reads on one connection, of all operations together
_FEWEST: Final = 3  # fewest reads with a slow device, and by several clients
_AT_ONCE: Final = 325
# First requests, which measure the device's response time even if it has no reads.
_FIRST: Final = 12
_ON_THINGS = 350  # requests to the device's collections and objects, if it allows changes
_EACH_ON_THINGS = 25  # the same for each operation
_WAITS_S: Final = 6.0  # how long the run then waits for late changes, s
_OWN_MS: Final = 0.5  # the suite's own time for a request, ms
_DRAWN_MS: Final = 5.5  # the suite's own time for a request that Hypothesis generates, ms
_START_S: Final = 0.5  # time in which Hypothesis starts, s


@dataclass(frozen=True)
class Estimate:
    """The number of requests of a run, and its time.

    Attributes:
        requests: how many are sent.
        drawn: how many of them Hypothesis draws.
        at_once: how many of them are sent by several clients at once.
        slow: claimed classes whose time depends on how fast the device moves or its graph responds; not included.
        waits_s: how long it waits for late changes, s.
    """

    requests: int
    drawn: int = 0
    at_once: int = 0
    slow: tuple[str, ...] = ()
    waits_s: float = 0.0

    def seconds(self, usual_ms: float) -> float:
        """Return the duration of the run, s, for a device that needs the given milliseconds for a response."""
        in_turn = self.requests - self.at_once * (1 - 1 / _READS)
        return _START_S + self.waits_s + (in_turn * (usual_ms + _OWN_MS) + self.drawn * _DRAWN_MS) / 1000

    def text(self, usual_ms: float | None = None) -> str:
        """Return the estimate as a sentence; without a time if the time of an answer is not known."""
        requests = f"{_round(self.requests)} requests"
        if usual_ms is None:
            return f"This run sends about {requests}; how long that takes depends on the device's response time."
        seconds = self.seconds(usual_ms)
        long = f"{_round(seconds)} s" if seconds < 100 else f"{_round(seconds / 60)} minutes"  # noqa: PLR2004 - in one place
        more = f"; {' and '.join(self.slow)} as long as the device needs" if self.slow else ""
        return (
            f"This run sends about {requests} and takes about {long} (the device answers in {usual_ms:.1f} ms){more}."
        )


def estimate(run: Run, operations: Sequence[Operation]) -> Estimate:
    """Return the estimated requests and time of a run.

    Args:
        run: the data of the run; its effort knows how fast the device answers, or assumes that it is fast.
        operations: operations that may be called.
    """
    effort = run.effort
    if SOAP in run.contract.classes:
        return Estimate(_FIRST + len(operations) * requests_of(effort))
    surveyed, covering, fuzzed, waits_s = 0, 0, 0, 0.0
    if {"description", "robustness"} & set(run.claims):
        reads = [operation for operation in operations if operation.method == "GET"]
        surveyed = sum(_survey_count(operation, effort, run.seed) for operation in operations) + TIMED_AGAIN * len(
            reads
        )
        surveyed += max(FEWEST_REPEATS, effort.cases(REPEATS)) if reads else 0
        if len(reads) < len(operations):
            surveyed, waits_s = surveyed + _ON_THINGS + _EACH_ON_THINGS * len(operations), _WAITS_S
        waits_s += sum(PAUSES_S[effort.name]) if reads else 0
        generated = [_generated_counts(operation, effort) for operation in operations]
        covering, fuzzed = sum(pair[0] for pair in generated), sum(pair[1] for pair in generated)
    http, at_once = _http(operations, effort) if "http" in run.claims else (0, 0)
    slow = tuple(name for name in (MOTION, ROS, STATES) if name in run.claims)
    return Estimate(_FIRST + surveyed + covering + fuzzed + http, fuzzed, at_once, slow, waits_s)


def _survey_count(operation: Operation, effort: Effort, seed: int) -> int:
    """Return how many requests of an operation the survey sends."""
    values = Values()
    try:
        groups = list(draw_requests(operation, usual_inputs(operation, values)[0], values, effort, seed))
    except Exception:  # noqa: BLE001 - the survey tells what cannot be read
        return 1
    timed = 0 if effort.name == "quick" or operation.method == "DELETE" else TIMED * (1 + len(groups))
    return 2 + timed + sum(map(len, groups))


def _generated_counts(operation: Operation, effort: Effort) -> tuple[int, int]:
    """Return how many requests of an operation Schemathesis makes to cover it, and how many Hypothesis draws."""
    inputs = len(operation.parameters) + sum(_members(body.schema) for body in operation.bodies.values())
    if not inputs:
        return 0 if operation.safe else 1, 0
    fuzzed = 0 if effort.name == "quick" or effort.slow else 2 * effort.cases(FUZZED)
    return round(_MADE * min(effort.cases(COVERAGE), _COVERING * inputs)), round(_MADE * fuzzed)


def _members(schema: object) -> int:
    members = schema.get("properties") if isinstance(schema, dict) else None
    return max(1, len(members)) if isinstance(members, dict) else 1


def _http(operations: Iterable[Operation], effort: Effort) -> tuple[int, int]:
    """Return how many requests the checks of HTTP send, and how many of these come from several clients at once."""
    operations = list(operations)
    reads = min(_READS, sum(operation.method == "GET" for operation in operations))
    if not reads:
        return len(operations), 0
    on_one = _FEWEST * reads if effort.slow else max(_LEAST_ON_ONE, reads * effort.cases(_ON_ONE_CONNECTION))
    at_once = effort.cases(_AT_ONCE) + _FEWEST * reads
    own = _HTTP_SLOW if effort.slow else _HTTP
    return own + _EACH_READ * reads + len(operations) + on_one + at_once, at_once


def _round(value: float) -> str:
    """Return a number with two digits that count."""
    return f"{float(f'{value:.2g}'):,.0f}" if value >= 1 else f"{value:.1g}"


TIMED_AGAIN: Final = 5  # timed repeats; the quickest of them waited for no other request
_TIMED_OFTEN: Final = 25  # repeats if the device looks slower, because varying times prove nothing
#: A response time has grown if it is GROWN_TIMES as long and GROWN_MS longer.
GROWN_TIMES: Final = 3.0
GROWN_MS: Final = 50.0


@dataclass(frozen=True)
class TimedAgain:
    """One operation that reads.

    Attributes:
        operation: method and path template.
        first: the usual exchange at the beginning of the run.
        times: response times at its end, ms.
        last: the last of these exchanges.
    """

    operation: str
    first: Exchange
    times: tuple[float, ...]
    last: Exchange

    @property
    def has_grown(self) -> bool:
        """Return whether even the quickest response at the end was clearly slower than at the beginning."""
        before, after = self.first.response.elapsed_ms, min(self.times)
        return after > GROWN_TIMES * before and after - before > GROWN_MS


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.LAST)
def timed_again(api: RestInterface) -> tuple[TimedAgain, ...]:
    """Send the usual requests that read once more, a few times each."""
    found = []
    for label, call in api.working.items():
        if not label.startswith("GET ") or label in api.streams:
            continue
        try:
            timed = timed_often(label, api.first[label], partial(call.send, api))
        except (NoAnswerError, TimeIsOverError):
            continue  # other requirements report a missing response
        found.append(timed)
    if not found:
        raise NotPossibleError("no operation that only reads was answered 2xx")
    return tuple(found)


def timed_often(label: str, first: Exchange, send: Callable[[], Exchange]) -> TimedAgain:
    """Send a request a few times, and more often as long as its response time seems to have grown."""
    times: tuple[float, ...] = ()
    for count in range(1, _TIMED_OFTEN + 1):
        last = send()
        times = (*times, last.response.elapsed_ms)
        timed = TimedAgain(label, first, times, last)
        if count >= TIMED_AGAIN and not timed.has_grown:
            break
    return timed

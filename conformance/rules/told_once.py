"""Report a fault that several operations share as one finding, with the list of operations."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from conformance.api.rest.statuses import HELD, held_text
from conformance.api.rest.variations import Kind
from conformance.scenarios.rule import NotSeen
from conformance.scenarios.survey import Probe
from conformance.verdict.evidence import Case
from conformance.verdict.finding import Showing

_LESS_PLAIN = frozenset({Kind.GENERATED, Kind.OTHER})
_NUMBERS = re.compile(r"\d+(?:\.\d+)?")


@dataclass(frozen=True)
class Fault:
    """The fault of one response.

    Attributes:
        cause: faults of the same cause are told once.
        observed: what the response shows, as a noun phrase.
        expected: what it should be, as a noun phrase; empty means that of the rule.
        doubt: as in Case.
    """

    cause: str
    observed: str
    expected: str = ""
    doubt: str = ""


def told_once(
    probes: Iterable[Probe], expected: str, fault_of: Callable[[Probe], Fault | None], *, apart: bool = False
) -> Iterator[Case]:
    """Yield a case for each probe that holds, and one for each cause of faults, with its operations.

    Args:
        probes: probes that the rule judges.
        expected: what the rule demands, as a noun phrase.
        fault_of: returns what is wrong with a probe, or None.
        apart: whether each operation is a cause of its own.
    """
    faults: dict[tuple[str, str], list[tuple[Probe, Fault]]] = {}
    for probe in probes:
        fault = fault_of(probe)
        if fault is None:
            yield Case(holds=True, exchange=probe.attempt, expected=expected)
        else:
            cause = f"{probe.operation} {fault.cause}" if apart else fault.cause
            faults.setdefault((cause, fault.doubt), []).append((probe, fault))
    for (cause, doubt), found in faults.items():
        # The smallest request shows it best; a usual one better than an odd one.
        probe, fault = min(found, key=lambda pair: (_oddness(pair[0].kind), pair[0].attempt.request.size))
        showing = {
            probe.operation: Showing(probe.operation, 0),
            **{label: Showing(label, 0) for label in sorted({probe.operation for probe, _ in found})},
        }
        for one, _ in found:
            was = showing[one.operation]
            sent = min(filter(None, (was.request, one.attempt.request)), key=lambda request: request.size)
            showing[one.operation] = Showing(one.operation, was.seen + 1, sent)
        observed = f"{fault.observed}, for {probe.says}" if probe.says else fault.observed
        yield Case(
            holds=False,
            exchange=probe.attempt,
            expected=fault.expected or expected,
            observed=observed,
            cause=cause,
            subject=probe.operation,
            operations=tuple(showing.values()),
            doubt=doubt,
        )


def held_back(probes: Iterable[Probe]) -> Iterator[NotSeen]:
    """Yield operations whose state allowed none of these requests, so that nothing could be judged."""
    statuses: dict[str, set[int]] = {}
    for probe in probes:
        statuses.setdefault(probe.operation, set()).add(probe.status)
    held = {label: found for label, found in statuses.items() if found <= HELD}
    if held:
        yield NotSeen(held_text(held, set().union(*held.values())))


def _oddness(kind: Kind) -> int:
    """Return how odd a request is: a usual one shows a fault best."""
    return 0 if kind is Kind.USUAL else 2 if kind in _LESS_PLAIN else 1


def without_numbers(text: str) -> str:
    """Return a text with each number as #, to compare texts about values that differ."""
    return _NUMBERS.sub("#", text)

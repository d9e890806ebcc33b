"""The description against the device: what it requires, allows and forbids (OpenAPI 3.1, 4.8.12, 4.8.14)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from conformance.api.rest.validity import INVALID, validity
from conformance.api.rest.variations import Kind
from conformance.documents.openapi import operations_of
from conformance.rules.told_once import Fault, told_once, without_numbers
from conformance.scenarios.rule import Outcome, rule
from conformance.scenarios.survey import Probe, Survey, generated_requests, survey
from conformance.transport.exchange import Exchange
from conformance.verdict.run import Run

_REFUSED = frozenset({400, 415, 422})
_MISSING_OR_INVALID = frozenset({Kind.INVALID, Kind.MALFORMED})
_NOT_THERE = frozenset({405, 501})
_NOT_FOUND = 404
_INVALID_TAKEN, _VALID_REFUSED = frozenset({"ST201", "ST203"}), "ST202"


@rule("description/operations", on=(survey,))
def operations(trace: Survey, run: Run) -> Iterable[Outcome]:
    """Judge whether the device has each operation that was called."""
    for operation in operations_of(run.contract):
        probes = trace.of(operation.label, Kind.USUAL)
        absent = [
            one
            for one in probes
            if one.status in _NOT_THERE or (one.status == _NOT_FOUND and not operation.parameter("path"))
        ]
        if not probes:
            continue

        def fault(probe: Probe, absent: list[Probe] = absent, count: int = len(probes)) -> Fault | None:
            if len(absent) < count:
                return None
            return Fault(str(probe.status), f"status {probe.status}")

        yield from told_once(probes[:1], "the operation that the description declares", fault)


@rule("description/invalid-refused", on=(survey, generated_requests))
def invalid_refused(trace: Survey, run: Run) -> Iterable[Outcome]:
    """Judge whether requests with values that the description forbids are refused."""
    sure = [one for one in trace.probes if one.kind in _MISSING_OR_INVALID and one.exchange is not None]
    sure += [one for one in trace.probes if one.kind is Kind.GENERATED and _is_invalid(run, one)]

    def fault(probe: Probe) -> Fault | None:
        return Fault(f"{probe.operation} {probe.place}", f"status {probe.status}") if probe.ok else None

    yield from told_once(sure, "status 4xx for a request that the description forbids", fault)


def _is_invalid(run: Run, probe: Probe) -> bool:
    """Return whether a generated request is invalid as it was sent, or by what Schemathesis says."""
    if probe.exchange is None:
        return False
    request = probe.exchange.request
    media_type = next((value for name, value in request.headers if name.lower() == "content-type"), "")
    target = request.url.split("//", 1)[-1].partition("/")[2]
    said = validity(
        run.contract, request.method, f"/{target}", media_type.split(";", 1)[0].strip().lower(), request.body
    )
    return said.verdict == INVALID or any(code in _INVALID_TAKEN for code, _ in probe.opinions)


@rule("description/required", on=(survey,))
def required(trace: Survey) -> Iterable[Outcome]:
    """Judge whether what the description requires is required."""
    probes = [one for one in trace.probes if one.kind is Kind.MISSING and one.exchange is not None]

    def fault(probe: Probe) -> Fault | None:
        return Fault(f"{probe.operation} {probe.place}", f"status {probe.status}") if probe.ok else None

    yield from told_once(probes, "status 4xx for a request without something that is required", fault)


@rule("description/optional", on=(survey,))
def optional(trace: Survey) -> Iterable[Outcome]:
    """Judge whether a request without all that is optional is accepted, where one with it is."""
    for label in {one.operation: None for one in trace.probes}:
        least = trace.of(label, Kind.USUAL)
        more = [one for one in trace.of(label, Kind.OPTIONAL) if one.ok]
        refused = [one for one in least if one.status in _REFUSED]

        def fault(
            probe: Probe, refused: list[Probe] = refused, least: list[Probe] = least, more: list[Probe] = more
        ) -> Fault | None:
            if not more or len(refused) < len(least):
                return None
            with_it = more[0]
            found = f"status {probe.status} without {with_it.place}, and status {with_it.status} with it"
            return Fault(f"{probe.operation} {with_it.place}", found)

        yield from told_once(least[:1], "a request with nothing optional accepted", fault)


@rule("description/enums", on=(survey,))
def enums(trace: Survey) -> Iterable[Outcome]:
    """Judge whether each value of an enumeration is accepted, where another one of it is."""
    yield from _accepted(trace, (Kind.ENUM,), "each declared value of the enumeration accepted")


@rule("description/examples", on=(survey,))
def examples(trace: Survey) -> Iterable[Outcome]:
    """Judge whether the description's examples are accepted."""
    yield from _accepted(trace, (Kind.EXAMPLE,), "the description's example accepted", anyway=True)


@rule("description/defaults", on=(survey,))
def defaults(trace: Survey) -> Iterable[Outcome]:
    """Judge whether a default may be written out."""
    yield from _accepted(trace, (Kind.DEFAULT,), "the declared default accepted, as when it is left out")


@rule("description/valid-accepted", on=(survey, generated_requests))
def valid_accepted(trace: Survey) -> Iterable[Outcome]:
    """Judge whether requests that the description allows are accepted."""
    yield from _accepted(trace, (Kind.OPTIONAL, Kind.BOUND), "a request that the description allows accepted")
    generated = [one for one in trace.probes if one.kind is Kind.GENERATED and one.exchange is not None]

    def fault(probe: Probe) -> Fault | None:
        said = [text for code, text in probe.opinions if code == _VALID_REFUSED]
        return Fault(f"{probe.operation} {probe.status}", f"status {probe.status} (ST202)") if said else None

    yield from told_once(generated, "a request that the description allows accepted", fault)


def _accepted(trace: Survey, kinds: tuple[Kind, ...], expected: str, *, anyway: bool = False) -> Iterator[Outcome]:
    """Yield whether valid requests are accepted; unless ``anyway``, of operations whose usual request is."""
    works = {one.operation for one in trace.probes if one.kind is Kind.USUAL and one.ok}
    probes = [one for one in trace.probes if one.kind in kinds and one.exchange and (anyway or one.operation in works)]

    def fault(probe: Probe) -> Fault | None:
        if probe.status not in _REFUSED:
            return None
        return Fault(f"{probe.operation} {without_numbers(probe.place)}", _refusal(probe.exchange))

    yield from told_once(probes, expected, fault)


def _refusal(exchange: Exchange | None) -> str:
    """Return a refusal with the beginning of what the device says about it."""
    if exchange is None:
        return "no response"
    said = " ".join(exchange.response.body[:200].decode("utf-8", "replace").split())
    return f"status {exchange.response.status}: {said}" if said else f"status {exchange.response.status}"

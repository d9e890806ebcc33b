"""The description against the device: required, allowed and forbidden inputs (OpenAPI 3.1, 4.8.12, 4.8.14)."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import replace
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qsl, unquote, urlsplit

from conformance.api.rest.conversions import is_converted, unkept_members
from conformance.api.rest.invalid_variations import NO_OBJECT, NO_WHOLE_NUMBER
from conformance.api.rest.references import is_free_text
from conformance.api.rest.statuses import HELD
from conformance.api.rest.validity import INVALID, VALID
from conformance.api.rest.variations import ACCEPT, WIDE, Kind
from conformance.documents.json_text import read_json
from conformance.documents.openapi import is_json, operations_of
from conformance.documents.writing import json_text
from conformance.rules.told_once import Fault, held_back, told_once, without_numbers
from conformance.scenarios.generated import generated_requests
from conformance.scenarios.rule import Outcome, rule
from conformance.scenarios.survey import Probe, Survey, survey
from conformance.transport.exchange import Exchange
from conformance.verdict.run import Run

_REFUSED = frozenset({400, 415, 422})
_INVALID = frozenset({400, 422})
# Doubt about a refusal of what the description allows.
_FIT = "the values of a request may have to fit each other, or what the device does at the moment"
_PARSER = "a JSON parser may accept more than JSON (RFC 8259 9), as those of Node.js and Go do"
_TWICE = "programs in JavaScript, Java and C# count a character beyond U+FFFF twice"
_UNSAID = "many frameworks demand a body and leave out `required: true` in their descriptions"
# Methods whose requests' content has no meaning (RFC 9110 9.3.1, 9.3.2, 9.3.5).
_WITHOUT_CONTENT = frozenset({"GET", "HEAD", "DELETE"})
_WRONG = frozenset({Kind.INVALID, Kind.MALFORMED})
# From so many accepted bodies on, of all that were sent, an operation checks none.
_SEVERAL = 5
# Header fields whose wrong values a server may ignore (RFC 9110 12.5, 13.1, 14.2; RFC 7240 2), whatever is declared.
_OF_HTTP = frozenset(
    f"header {name}"
    for name in (
        *("if-match", "if-none-match", "if-modified-since", "if-unmodified-since", "if-range", "range"),
        *("accept", "accept-charset", "accept-encoding", "accept-language", "prefer"),
    )
)
# Phrases in a description which say that two values depend on each other, which no schema can express.
_TOGETHER = re.compile(
    r"[<>≤≥≠]|\b(than|before|after|below|above|between|exceeds?|equal|differ\w*|both|either|together|unless|requires?)\b",
    re.IGNORECASE,
)
_SENTENCE = re.compile(r"(?<=[.;])\s+")
_SAID_OF_IT = re.compile(r": | is | has | should ")
# Parts of a generated value that count as extreme: numbers beyond 32 bits, improbable years, empty texts, and control
# characters, which JSON writes as \u00XX.
_NUMBER, _LARGEST = re.compile(r"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?"), 1 << 31
_YEAR, _FIRST_YEAR, _LAST_YEAR = re.compile(r"\b(\d{4})-\d\d-\d\d"), 1970, 2100
_EMPTY = re.compile(r'""|=(?:&|$)', re.MULTILINE)
_CONTROL = re.compile(r"\\u00[01789][0-9a-f]|\\u[de]", re.IGNORECASE)
_CONVERTED = re.compile(r"(?: is (.+), not of type (.+)|: (True|False) is not valid under any .+)$", re.DOTALL)


@rule("description/operations", on=(survey,))
def operations(trace: Survey, run: Run) -> Iterable[Outcome]:
    """Judge whether the device has each operation that was called."""
    for operation in operations_of(run.contract):
        lacks = trace.lacks(operation)

        def fault(probe: Probe, lacks: bool = lacks) -> Fault | None:  # noqa: FBT001 - bound in its round
            return Fault(str(probe.status), f"status {probe.status}") if lacks else None

        probes = trace.of(operation.label, Kind.USUAL)
        yield from told_once(probes[:1], "the operation that the description declares", fault)


@rule("description/invalid-refused", on=(survey, generated_requests))
def invalid_refused(trace: Survey, run: Run) -> Iterable[Outcome]:
    """Judge whether requests with values that the description forbids are refused, unless they are converted."""
    sure = _forbidden(trace)
    converted = _convertible(trace, sure, run)
    acted = [one for one in sure if one.status not in HELD and id(one) not in converted]
    unchecked = _operations_without_checks(acted)

    def fault(probe: Probe) -> Fault | None:
        if not probe.ok:
            return None
        why, doubt = "" if probe.says else probe.why, _doubt_of_content(probe)
        is_whole = probe.operation in unchecked and _place_of(probe).startswith("body")
        all_of = f" (as to each of {unchecked[probe.operation]} wrong bodies)" if is_whole else ""
        cause = "octets that are no UTF-8" if doubt == _PARSER else "a body is not checked" if is_whole else ""
        saw = f"status {probe.status}{all_of}{_because(why)}"
        return Fault(cause or _cause_of_acceptance(probe, why), saw, doubt=doubt)

    yield from held_back(sure)
    yield from told_once(acted, "status 4xx for a request that the description forbids", fault)


def _operations_without_checks(acted: Iterable[Probe]) -> dict[str, int]:
    """Return the operations that accepted each of several wrong JSON bodies, and how many these were."""
    found = defaultdict[str, list[bool]](list)
    for probe in acted:
        if _place_of(probe).startswith("body") and probe.status < HTTPStatus.INTERNAL_SERVER_ERROR:
            # Deep nesting and what is no JSON are refused by parsers, not by checks.
            body = probe.attempt.request.body
            if not body.startswith(b"[[[[") and not read_json(body).malformed:
                found[probe.operation].append(probe.ok)
    return {operation: len(each) for operation, each in found.items() if len(each) >= _SEVERAL and all(each)}


def _cause_of_acceptance(probe: Probe, why: str) -> str:
    """Return what accepted requests have in common: if a framework converts a type, it does so in every operation."""
    converted = _CONVERTED.search(why)
    given = _json_type((converted[1] or converted[3]).lower()) if converted else ""
    if _place_of(probe) == "body" and (converted or probe.says in NO_OBJECT):
        return "a body of another type"
    if given == "boolean":
        return "a boolean converted"
    if probe.says.endswith(NO_WHOLE_NUMBER) and probe.place.startswith("body"):
        return "a fraction converted"
    if converted and converted[2] and not probe.says:
        return f"{given} {converted[2]}"
    return f"{probe.operation} {without_numbers(probe.place) if probe.says else _place_in(why)}"


@rule("description/types", on=(survey, generated_requests))
def types(trace: Survey, run: Run) -> Iterable[Outcome]:
    """Judge whether a value of another type is refused, also where the device converts it without loss."""
    sure = _forbidden(trace)
    converted = _convertible(trace, sure, run)

    def fault(probe: Probe) -> Fault | None:
        why = "" if probe.says else _because(probe.why)
        return Fault("a type converted", f"status {probe.status}{why}") if id(probe) in converted else None

    acted = [one for one in sure if id(one) in converted or one.status in _REFUSED]
    yield from told_once(acted, "status 4xx for a value of a type that the description does not declare", fault)


def _because(why: str) -> str:
    """Return what is wrong in a generated request, as the end of a sentence."""
    value, at, place = why.rpartition(" at ")
    is_parameter = at and place.startswith(("path ", "query ", "header ", "cookie "))
    return f", for {value} as {place}" if is_parameter else f", although {why}" if why else ""


def _forbidden(trace: Survey) -> list[Probe]:
    """Return the answered requests that the description forbids without doubt."""
    sure = [one for one in trace.probes if one.kind in _WRONG and one.validity != VALID and one.exchange is not None]
    sure += [one for one in trace.probes if one.kind is Kind.GENERATED and one.validity == INVALID and one.exchange]
    # A thing that a path cannot name does not exist either.
    absent = _deletes_the_absent(trace)
    sure = [one for one in sure if not (one.ok and one.operation in absent and _place_of(one).startswith("path "))]
    return [one for one in sure if _place_of(one).lower() not in _OF_HTTP]


def _convertible(trace: Survey, probes: Iterable[Probe], run: Run) -> set[int]:
    """Return the `id()` of each probe whose JSON body was accepted, as a value of the declared type means the same."""
    operations = {operation.label: operation for operation in operations_of(run.contract)}
    found, unkept = set(), defaultdict[str, set[str]](set)
    for probe in trace.probes:
        if probe.ok and probe.exchange and probe.validity == VALID and is_json(probe.attempt.request.media_type):
            unkept[probe.operation] |= unkept_members(probe.attempt.request.body, probe.exchange.response.body)
    for probe in probes:
        request = probe.attempt.request
        operation = operations.get(probe.operation)
        given = operation.bodies.get(request.media_type) if operation else None
        is_body = is_json(request.media_type) and _place_of(probe).startswith("body")
        if operation and given and probe.ok and probe.exchange and is_body:
            said, own = probe.exchange.response.body, unkept[probe.operation]
            # As with an optional member, null stands for an optional body that is absent.
            is_absent = not operation.body_required and request.body == b"null"
            found |= {id(probe)} if is_absent or is_converted(given.schema, request.body, said, own) else set()
    return found


def _deletes_the_absent(trace: Survey) -> set[str]:
    """Return the DELETE operations that succeed for absent things, as idempotent ones may (RFC 9110 9.2.2)."""
    deleted = [probe for probe in trace.probes if probe.ok and probe.exchange and probe.operation.startswith("DELETE ")]
    sent = Counter(probe.exchange.request.url for probe in deleted if probe.exchange and probe.validity == VALID)
    return {
        probe.operation
        for probe in deleted
        if probe.exchange and (probe.invents or sent[probe.exchange.request.url] > 1)
    }


def _doubt_of_content(probe: Probe) -> str:
    """Return the doubt about a wrong content: its method gives it no meaning, or its parser may accept other texts."""
    if not _place_of(probe).startswith("body"):
        return ""
    request = probe.attempt.request
    if request.method in _WITHOUT_CONTENT:
        return "HTTP gives the content of this method no meaning, so a server may ignore it"
    content = read_json(request.body)
    # As the Fetch standard, Node.js and Go do: each reads an octet that is no UTF-8 as U+FFFD.
    return _PARSER if is_json(request.media_type) and content.encoding and not content.malformed else ""


def _place_of(probe: Probe) -> str:
    """Return the place that is wrong in a request."""
    return probe.place if probe.says else _place_in(probe.why)


def _place_in(why: str) -> str:
    """Return the place that is wrong in a request, as the survey names places, with each number as #."""
    if why.startswith(("'", '"')) and " at " in why:
        return why.rpartition(" at ")[2]
    if why.startswith(("no parameter ", "no header ", "no cookie ")):
        return why.removeprefix("no ").replace("parameter ", "query ", 1)
    subject = _SAID_OF_IT.split(why, maxsplit=1)[0].removeprefix("no field ")
    if subject in {"the value", "not JSON"}:
        return "body"
    return "body /" + without_numbers(subject.replace("[", "/").replace("]", "").replace(".", "/"))


def _json_type(text: str) -> str:
    """Return the type of a JSON text by its first character."""
    return {'"': "string", "{": "object", "[": "array", "t": "boolean", "f": "boolean", "n": "null"}.get(
        text[:1], "number"
    )


@rule("description/required", on=(survey,))
def required(trace: Survey) -> Iterable[Outcome]:
    """Judge whether the device demands the inputs that the description requires."""
    missing = [
        one for one in trace.probes if one.kind is Kind.MISSING and (one.validity != VALID or one.place == ACCEPT)
    ]
    probes = [one for one in missing if one.exchange is not None]

    in_body = Counter(one.operation for one in probes if one.ok and one.place.startswith("body /"))
    demanded = {one.operation for one in probes if not one.ok and one.place.startswith("body /")}

    def fault(probe: Probe) -> Fault | None:
        is_whole = probe.place.startswith("body /") and in_body[probe.operation] > 1 and probe.operation not in demanded
        what = f"{probe.operation} body" if is_whole else f"{probe.operation} {probe.place}"
        return Fault(what, f"status {probe.status}", doubt=_doubt_of_content(probe)) if probe.ok else None

    yield from held_back(probes)
    acted = [one for one in probes if one.status not in HELD]
    yield from told_once(acted, "status 4xx for a request without something that is required", fault)


@rule("description/optional", on=(survey,))
def optional(trace: Survey) -> Iterable[Outcome]:
    """Judge whether a request without all that is optional is accepted, where one with it is."""
    for label in {one.operation: None for one in trace.probes}:
        least = trace.of(label, Kind.USUAL)
        more = [one for one in trace.of(label, Kind.OPTIONAL) if one.ok]
        # Parameters that are all optional may be required together (minProperties, anyOf).
        refused = [one for one in least if one.status in _REFUSED and not one.invents and one.validity != INVALID]

        def fault(
            probe: Probe, refused: list[Probe] = refused, least: list[Probe] = least, more: list[Probe] = more
        ) -> Fault | None:
            if not more or len(refused) < len(least):
                return None
            with_it = more[0]
            found = f"status {probe.status} without {with_it.place}, and status {with_it.status} with it"
            return Fault(f"{probe.operation} {with_it.place}", found)

        seen = [] if {one.status for one in least} <= HELD else least
        yield from told_once(seen[:1], "a request with nothing optional accepted", fault)
    yield from held_back(one for one in trace.probes if one.kind is Kind.USUAL)


@rule("description/enums", on=(survey,))
def enums(trace: Survey) -> Iterable[Outcome]:
    """Judge whether each value of an enumeration is accepted, if another one is."""
    kinds = (Kind.ENUM,)
    yield from _judge_accepted(trace, kinds, "each declared value of the enumeration accepted", sure=kinds)


@rule("description/examples", on=(survey,))
def examples(trace: Survey) -> Iterable[Outcome]:
    """Judge whether the description's examples are accepted."""
    yield from _judge_accepted(trace, (Kind.EXAMPLE,), "the description's example accepted", anyway=True)


@rule("description/defaults", on=(survey,))
def defaults(trace: Survey) -> Iterable[Outcome]:
    """Judge whether a default may be written out."""
    yield from _judge_accepted(trace, (Kind.DEFAULT,), "the declared default accepted, as when it is left out")


@rule("description/valid-accepted", on=(survey, generated_requests))
def valid_accepted(trace: Survey, run: Run) -> Iterable[Outcome]:
    """Judge whether requests that the description allows are accepted."""
    texts = {operation.label: operation.text for operation in operations_of(run.contract)}
    bodied = {operation.label for operation in operations_of(run.contract) if operation.bodies}
    alone = (one for one in _with_known_path(trace, run) if one.ok or not _is_of_two(one, texts.get(one.operation, "")))
    trace = replace(trace, probes=tuple(alone))
    yield from _judge_accepted(trace, (Kind.OPTIONAL, Kind.BOUND), "a request that the description allows accepted")
    # An operation that never accepts a request may need another state; another requirement judges its status.
    works = {one.operation for one in trace.probes if one.ok}
    generated = [one for one in trace.probes if one.kind is Kind.GENERATED and one.operation in works]
    told = _least_refused(trace)
    generated = [one for one in generated if one.status not in HELD and _request_of(one) not in told]

    def fault(probe: Probe) -> Fault | None:
        if probe.status not in _REFUSED or probe.exchange is None:
            return None
        if not probe.attempt.request.body and probe.operation in bodied:
            observed = f"{_refusal(probe.exchange)}, for no body, which the description does not require"
            return Fault("no body", observed, doubt=_UNSAID)
        return Fault(f"{probe.operation} {probe.status}", _refusal(probe.exchange), doubt=_FIT)

    valid = [one for one in generated if one.validity == VALID and not one.invents and not _is_extreme(one)]
    yield from held_back(one for one in trace.probes if one.kind is Kind.GENERATED and one.validity == VALID)
    yield from told_once(valid, "a request that the description allows accepted", fault)


def _least_refused(trace: Survey) -> set[tuple[str, str, bytes]]:
    """Return what was sent and refused with nothing optional, which another rule judges."""
    more = {one.operation for one in trace.probes if one.kind is Kind.OPTIONAL and one.ok}
    least = [one for one in trace.probes if one.kind is Kind.USUAL and one.operation in more]
    return {_request_of(one) for one in least if one.status in _REFUSED}


def _request_of(probe: Probe) -> tuple[str, str, bytes]:
    return probe.operation, probe.attempt.request.target, probe.attempt.request.body


def _is_extreme(probe: Probe) -> bool:
    """Return whether a request has a value that a schema without bounds allows and no program is made for."""
    request = probe.attempt.request
    text = "\n".join((unquote(request.target.replace("+", " ")), request.body.decode("utf-8", "replace")))
    return (
        _EMPTY.search(text) is not None
        or _CONTROL.search(text) is not None
        or any(not char.isprintable() and char not in "\r\n\t" for char in text)
        or any(abs(float(number)) > _LARGEST for number in _NUMBER.findall(text))
        or any(not _FIRST_YEAR <= int(year) <= _LAST_YEAR for year in _YEAR.findall(text))
    )


def _is_alone(probe: Probe) -> bool:
    """Return whether the value at a bound is the only parameter of a GET, so that it fits all others."""
    request = probe.attempt.request
    is_bound = probe.kind is Kind.BOUND and probe.place.startswith("query ") and probe.status in _INVALID
    return is_bound and request.method == "GET" and len(parse_qsl(urlsplit(request.target).query)) == 1


def _value_key(probe: Probe) -> tuple[str, str, str]:
    """Return the operation of a probe, and the value in the place of the body that it is about, as JSON text."""
    value: Any = read_json(probe.attempt.request.body).value
    for step in probe.place.removeprefix("body /").split("/"):
        value = value.get(step) if isinstance(value, dict) else None
    return probe.operation, probe.place, json_text(value)


def _with_known_path(trace: Survey, run: Run) -> Iterator[Probe]:
    """Yield the probes without those whose path has a free text that was never accepted, such as a wrong id."""
    free = {
        item.label
        for item in operations_of(run.contract)
        if any(is_free_text(parameter.schema) for parameter in item.parameter("path"))
    }
    # Schemathesis also sends other methods, such as OPTIONS.
    own = [probe for probe in trace.probes if probe.operation.startswith(f"{probe.attempt.request.method} ")]
    known = {_path_of(probe) for probe in own if probe.ok}
    yield from (probe for probe in own if probe.operation not in free or _path_of(probe) in known)


def _is_of_two(probe: Probe, text: str) -> bool:
    """Return whether the operation's text or the refusal says that two values must fit together."""
    request = probe.attempt.request
    sent = read_json(request.body).value
    names = {*(sent if isinstance(sent, dict) else ()), *dict(parse_qsl(urlsplit(request.target).query))}
    refusal = read_json(probe.exchange.response.body).value if probe.exchange else None
    said = [item for item in refusal.values() if isinstance(item, str)] if isinstance(refusal, dict) else []
    sentences = [sentence for one in (text, *said) for sentence in _SENTENCE.split(one)]
    return any(
        _TOGETHER.search(one) and sum(bool(re.search(rf"\b{re.escape(name)}\b", one)) for name in names) > 1
        for one in sentences
    )


def _path_of(probe: Probe) -> str:
    return probe.attempt.request.target.partition("?")[0]


def _judge_accepted(
    trace: Survey, kinds: tuple[Kind, ...], expected: str, *, anyway: bool = False, sure: tuple[Kind, ...] = ()
) -> Iterator[Outcome]:
    """Yield whether valid requests are accepted; unless ``anyway``, of operations whose usual request is.

    A refusal of the kinds ``sure`` is beyond doubt.
    """
    works = {one.operation for one in trace.probes if one.kind is Kind.USUAL and one.ok}
    sent = [one for one in trace.probes if one.kind in kinds and one.exchange and one.validity != INVALID]
    # Only the device knows which ids and cursors exist.
    probes = [one for one in sent if (anyway or one.operation in works) and not one.invents and one.status not in HELD]
    # An input accepted in one state may be refused in another.
    other = {
        _value_key(one) for one in trace.probes if (one.ok or one.status in HELD) and one.place.startswith("body /")
    }
    probes = [one for one in probes if one.ok or _value_key(one) not in other]

    def fault(probe: Probe) -> Fault | None:
        if probe.status not in _REFUSED:
            return None
        if probe.says.endswith(WIDE):
            return Fault("characters counted twice", _refusal(probe.exchange), doubt=_TWICE)
        doubt = "" if probe.kind in sure or _is_alone(probe) else _FIT
        return Fault(f"{probe.operation} {without_numbers(probe.place)}", _refusal(probe.exchange), doubt=doubt)

    yield from held_back(sent)
    yield from told_once(probes, expected, fault)


def _refusal(exchange: Exchange | None) -> str:
    """Return a refusal with the beginning of its text."""
    if exchange is None:
        return "no response"
    said = " ".join(exchange.response.body[:200].decode("utf-8", "replace").split())
    said += "…" if len(exchange.response.body) > 200 else ""
    return f"status {exchange.response.status}: {said}" if said else f"status {exchange.response.status}"

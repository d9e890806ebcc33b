"""Whether a SOAP service keeps SOAP, its WSDL and its composure, whatever it is sent."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from functools import wraps
from typing import Any

from lxml import etree

from conformance.api.soap.resources import resources_of
from conformance.documents.multipart import parts_of
from conformance.documents.traceback import inside_shown
from conformance.documents.wsdl import ENVELOPE_12
from conformance.documents.wsdl_pack import services_of
from conformance.documents.xml import ENVELOPE, clark, elements, local, text_of
from conformance.rules.description import test_lives, test_resources
from conformance.rules.soap.own_state import entries, probes_left
from conformance.scenarios.rule import Note, Outcome, Rule, rule
from conformance.scenarios.soap_changes import soap_changes
from conformance.scenarios.soap_survey import OTHER_ACTION, Kind, NotSoapError, SoapProbe, soap_survey, wsdl_faults
from conformance.scenarios.soap_things import Things, soap_things
from conformance.transport.exchange import NoAnswer
from conformance.verdict.evidence import Case
from conformance.verdict.finding import Showing
from conformance.verdict.run import Run

_ON = (soap_survey, soap_changes, soap_things)
_OK, _BAD, _FAILED = 200, 400, 500
# SOAP 1.2 Part 1, 5.4.6.
_CHILDREN_11 = frozenset({"faultcode", "faultstring", "faultactor", "detail"})
_CHILDREN_12 = ("Code", "Reason", "Node", "Role", "Detail")
_CODES_12 = frozenset({"VersionMismatch", "MustUnderstand", "DataEncodingUnknown", "Sender", "Receiver"})
_SUBCODE = clark(ENVELOPE_12, "Subcode")
_LANG = "{http://www.w3.org/XML/1998/namespace}lang"
# A message that shows no version of SOAP may be answered by a fault of any version, or by none.
_OF_NO_VERSION = frozenset({Kind.VERSION, Kind.UNREADABLE, Kind.EMPTY})
# Values in an error text, which differ within one cause; names of elements and prefixes do not.
_VALUES = re.compile(r"'(?!\{)[^']*'|(?<=fault: ).*|\d+(?=, column|\)|$)", re.DOTALL)
# How a device says that it lacks an operation (ONVIF Core, 5.11.2; WS-Addressing SOAP Binding, 6.4.2).
_OPTIONAL = re.compile(r"not\s?(?:supported|implemented)", re.IGNORECASE)
_VALID = frozenset({Kind.USUAL, Kind.TRIED})
_BY_ACTION = (
    "what SOAPAction names, though the Body decides which operation is called; a message in which the two differ may "
    "also be refused (WS-I BP 1.1 R1127)"
)
_ASKED = frozenset({Kind.USUAL, Kind.VARIED})
Trace = tuple[SoapProbe, ...]


def _rule(requirement: str) -> Callable[[Callable[..., Iterable[Outcome]]], Rule]:
    """Return a decorator that turns a function into a rule on the messages of all scenarios."""

    def make(judge: Callable[..., Iterable[Outcome]]) -> Rule:
        @wraps(judge)
        def judge_probes(trace: Trace | Things, **fixtures: Any) -> Iterable[Outcome]:
            return judge(trace.probes if isinstance(trace, Things) else trace, **fixtures)

        return rule(requirement, on=_ON)(judge_probes)

    return make


def _cases(
    trace: Iterable[SoapProbe], expected: str, wrong: Callable[[SoapProbe], str | None], *, by_kind: bool = False
) -> Iterator[Outcome]:
    """Yield a case for each probe: ``wrong`` returns its fault, an empty text, or None to skip it.

    One cause is one finding, whatever operations it has. It shows a valid message if one fails: a message that has
    another fault as well would show two things.
    """
    plain: dict[str, tuple[SoapProbe, str]] = {}
    for probe in sorted(trace, key=lambda one: one.kind not in _VALID):
        found = wrong(probe)
        if found is None:
            continue
        cause = f"{_VALUES.sub('#', found)} {probe.kind if by_kind else ''}"
        shown = probe, found
        if found and not by_kind:
            shown = plain.setdefault(cause, shown) if probe.kind in _VALID else plain.get(cause, shown)
        name, own = shown[0].operation.rpartition("/")[2], probe.exchange or probe.unanswered
        yield Case(
            not found,
            shown[0].exchange or shown[0].unanswered,
            f"{expected} for {shown[0].says} of {name}",
            observed=shown[1],
            cause=cause,
            subject=name,
            operations=(Showing(probe.operation, 1, own.request if own else None),),
        )


@rule("soap/wsdl", on=(wsdl_faults,))
def wsdl(trace: tuple[str, ...]) -> Iterator[Outcome]:
    """Judge whether the WSDL holds together: its documents are there, and each reference has a target."""
    expected = "a WSDL that holds together"
    for wrong in trace:
        yield Case(holds=False, exchange=None, expected=expected, observed=wrong, subject="the WSDL")
    if not trace:
        yield Case(holds=True, exchange=None, expected=expected)


@_rule("soap/answered")
def answered(trace: Trace) -> Iterator[Outcome]:
    """Judge whether each request gets an HTTP response."""

    def wrong(probe: SoapProbe) -> str | None:
        if probe.unanswered is None:
            return ""
        # HTTP lets a server close the connection of a client that sends it no XML: gSOAP does.
        kind = probe.unanswered.kind
        closed = kind is NoAnswer.CLOSED and probe.kind in {Kind.UNREADABLE, Kind.EMPTY}
        return None if closed or kind is NoAnswer.CIRCUIT_OPEN else probe.unanswered.problem

    return _cases(trace, "a response", wrong)


@_rule("soap/message")
def message(trace: Trace) -> Iterator[Outcome]:
    """Judge whether a success, and XML with status 500, is a well-formed message of the port's SOAP version."""

    def wrong(probe: SoapProbe) -> str | None:
        answer = probe.exchange.response if probe.exchange else None
        if answer is None or not (answer.status == _OK or (answer.status == _FAILED and "xml" in answer.media_type)):
            return None
        if probe.response is None and not answer.body:
            return None
        try:
            probe.inside()
        except NotSoapError as error:
            return None if probe.kind in _OF_NO_VERSION else str(error)
        return ""

    return _cases(trace, "a SOAP message", wrong)


@_rule("soap/media-type")
def media_type(trace: Trace) -> Iterator[Outcome]:
    """Judge whether a message has the media type of its SOAP version."""

    def wrong(probe: SoapProbe) -> str | None:
        answer = probe.exchange.response if probe.exchange else None
        if answer is None or not answer.body or probe.kind in _OF_NO_VERSION:
            return None
        try:
            probe.inside()
        except NotSoapError:
            return None
        wanted = "application/soap+xml" if probe.envelope == ENVELOPE_12 else "text/xml"
        given = answer.media_type
        if given == "multipart/related":
            given = parts_of(answer.header("content-type") or "", answer.body)[0].media_type
        return "" if given == wanted else f"Content-Type: {given or '(none)'}"

    return _cases(trace, "the media type of the SOAP version", wrong)


@_rule("soap/response-valid")
def response_valid(trace: Trace, run: Run) -> Iterator[Outcome]:
    """Judge whether the Body of a success has the element that the WSDL names, valid by its schema."""
    found = services_of(run.contract)

    def wrong(probe: SoapProbe) -> str | None:
        if found is None or not probe.is_success or probe.exchange is None:
            return None
        try:
            inside = probe.inside()
        except NotSoapError:
            return None
        if probe.response and found.types.shape(probe.response) is None:
            return None
        if not probe.response:  # WS-I BP 1.1, R2714, if the WSDL has no output
            what = "a Body that must be empty" if probe.response is not None else "response to a one-way operation"
            return "" if not inside else f"{inside[0].tag} in {what}"
        text = f"{inside[0].tag if inside else 'an empty Body'} in place of {probe.response}"
        if len(inside) == 1 and inside[0].tag == probe.response:
            text = found.types.invalid(inside[0])
        # One cause, whichever operations it takes for each other.
        return _BY_ACTION if text and probe.says.startswith(OTHER_ACTION) else text

    return _cases(trace, "a response that is valid by the WSDL", wrong)


@_rule("soap/fault")
def fault(trace: Trace, run: Run) -> Iterator[Outcome]:
    """Judge whether a fault meets its SOAP version, and its detail the WSDL."""
    types = None if (found := services_of(run.contract)) is None else found.types

    def wrong(probe: SoapProbe) -> str | None:
        found = probe.fault
        if found is None:
            return None
        wrong = _wrong_fault_12(found) if probe.envelope == ENVELOPE_12 else _wrong_fault_11(found)
        known = [element for element in entries(found) if types and types.shape(str(element.tag)) is not None]
        if known and _code_of(found) == (ENVELOPE, "MustUnderstand"):
            return f"{known[0].tag} in the detail, which is for errors of the Body"
        return wrong or next(filter(None, (types.invalid(element) for element in known if types)), "")

    return _cases(trace, "a well-made fault", wrong)


def _wrong_fault_11(found: etree._Element) -> str:
    """Return what is wrong with a fault of SOAP 1.1 (4.4; WS-I BP R1000, R1001)."""
    by_name = {str(element.tag): element for element in elements(found)}
    for name in ("faultcode", "faultstring"):
        if name not in by_name:
            return f"no {name} without a namespace"
    if strange := [name for name in by_name if not name.startswith("{") and name not in _CHILDREN_11]:
        return f"the child {strange[0]} without a namespace, which SOAP 1.1 does not have"
    if undeclared := _no_prefix(by_name["faultcode"]):
        return undeclared
    # Other names in SOAP's namespace are allowed: SOAP 1.1 4.4 recommends this for an application's own codes.
    space, name = _code_of(found)
    is_other = space == ENVELOPE and name in {"Sender", "Receiver"}
    return f"the code {name!r}, which is one of SOAP 1.2" if is_other else ""


def _no_prefix(code: etree._Element) -> str:
    """Return that a code's prefix is not declared, or an empty text."""
    prefix, colon, _ = text_of(code).strip().rpartition(":")
    return f"a code with the prefix {prefix!r}, which is not declared" if colon and not code.nsmap.get(prefix) else ""


def _code_of(found: etree._Element) -> tuple[str, str]:
    """Return namespace and name of a fault's code."""
    code = next(
        (element for element in found.iter(etree.Element) if local(element.tag) in {"faultcode", "Value"}), found
    )
    prefix, _, name = text_of(code).strip().rpartition(":")
    return code.nsmap.get(prefix or None) or "", name


def _wrong_fault_12(found: etree._Element) -> str:
    """Return what is wrong with a fault of SOAP 1.2 (Part 1, 5.4)."""
    by_name = {
        local(str(element.tag)): element
        for element in elements(found)
        if str(element.tag).startswith(f"{{{ENVELOPE_12}}}")
    }
    if "Code" not in by_name or "Reason" not in by_name:
        return "no Code and Reason of SOAP 1.2"
    value = next(iter(elements(by_name["Code"])), None)
    prefix, _, name = (text_of(value).strip() if value is not None else "").rpartition(":")
    if value is None or value.nsmap.get(prefix or None) != ENVELOPE_12 or name not in _CODES_12:
        return f"the code {text_of(value).strip() if value is not None else ''!r}, which SOAP 1.2 does not have"
    parts = (by_name["Code"], *found.iter(_SUBCODE))
    wrong = [*map(_no_prefix, found.iter(clark(ENVELOPE_12, "Value"))), *map(_wrong_code_12, parts), _disorder(found)]
    if any(wrong):
        return next(filter(None, wrong))
    texts = [element for element in elements(by_name["Reason"]) if local(str(element.tag)) == "Text"]
    if not texts or not text_of(texts[0]).strip():
        return "a Reason without Text"
    return "" if all(element.get(_LANG) for element in texts) else "a Text of Reason without xml:lang"


def _disorder(found: etree._Element) -> str:
    """Return that a fault of SOAP 1.2 has other children than its schema allows, or in another order."""
    names = [str(element.tag) for element in elements(found)]
    allowed = [tag for name in _CHILDREN_12 if (tag := clark(ENVELOPE_12, name)) in names]
    return "" if names == allowed else f"not {', '.join(map(local, allowed))} alone, once each and in this order"


def _wrong_code_12(code: etree._Element) -> str:
    """Return what is wrong with the children of a Code or Subcode (SOAP 1.2 Part 1, 5.4.1)."""
    names = [str(element.tag) for element in elements(code)]
    is_right = names[:1] == [clark(ENVELOPE_12, "Value")] and names[1:] in ([], [_SUBCODE])
    return "" if is_right else f"a {local(str(code.tag))} that is not a Value and at most one Subcode"


@_rule("soap/fault-status")
def fault_status(trace: Trace) -> Iterator[Outcome]:
    """Judge a fault's status: 500 in SOAP 1.1 (6.2), 400 or 500 in SOAP 1.2."""

    def wrong(probe: SoapProbe) -> str | None:
        if probe.fault is None or probe.exchange is None:
            return None
        status = probe.exchange.response.status
        allowed = {_BAD, _FAILED} if probe.envelope == ENVELOPE_12 else {_FAILED}
        return "" if status in allowed else f"status {status}"

    return _cases(trace, "a fault with its status", wrong)


@_rule("soap/valid-accepted")
def valid_accepted(trace: Trace, run: Run) -> Iterator[Outcome]:
    """Judge whether a message that the WSDL allows is accepted; a device need not have all that a standard's has."""
    found = services_of(run.contract)
    lacking = {probe for probe in trace if found is not None and found.foreign and _OPTIONAL.search(_came(probe))}
    asked = [
        probe for probe in probes_left(trace, found) if probe.kind in _ASKED and probe.exchange and probe not in lacking
    ]
    yield from _cases(asked, "success", lambda probe: "" if probe.is_success else _came(probe))
    accepted = {probe.operation for probe in trace if probe.kind is Kind.USUAL}
    for label in dict.fromkeys(probe.operation for probe in trace if probe.kind in _VALID):
        if label not in accepted:
            name = label.rpartition("/")[2]
            yield Note(f"{name} refused each message: the suite does not know its values. Name some in [values].")


def _came(probe: SoapProbe) -> str:
    found = probe.fault
    if found is None:
        return f"status {probe.exchange.response.status}" if probe.exchange else "no response"
    return f"a fault: {' '.join(' '.join(map(str, found.itertext())).split())[:200]}"


def _refusal_judge(expected: str, *kinds: Kind, code: str = "") -> Callable[[Trace], Iterator[Outcome]]:
    """Return a function that judges whether messages are refused.

    A fault of the port's SOAP version must have the ``code`` for that, if there is one.
    """

    def judge_refusals(trace: Trace) -> Iterator[Outcome]:
        usable = {one.operation for one in trace if one.kind is Kind.AGAIN and one.is_success}

        def wrong(probe: SoapProbe) -> str | None:
            if probe.exchange is None or probe.is_success:
                return None if probe.exchange is None else "success"
            own = _code_of(probe.fault) if probe.fault is not None else (probe.envelope, code)
            is_right = not code or probe.operation not in usable or own == (probe.envelope, code)
            return "" if is_right else f"the code {own[1]}"

        return _cases((one for one in trace if one.kind in kinds), expected, wrong, by_kind=True)

    return judge_refusals


malformed_refused, invalid_refused, version_mismatch, must_understand, doctype_refused = (
    _rule(f"soap/{name}")(judge)
    for name, judge in (
        ("malformed-refused", _refusal_judge("a fault or a status of 400 and above", Kind.UNREADABLE, Kind.EMPTY)),
        ("invalid-refused", _refusal_judge("a fault", Kind.INVALID)),
        ("version-mismatch", _refusal_judge("a VersionMismatch fault", Kind.VERSION, code="VersionMismatch")),
        ("must-understand", _refusal_judge("a MustUnderstand fault", Kind.UNDERSTAND, code="MustUnderstand")),
        ("doctype-refused", _refusal_judge("a fault", Kind.DOCTYPE)),
    )
)


@_rule("soap/no-bare-error")
def no_bare_error(trace: Trace) -> Iterator[Outcome]:
    """Judge whether server errors come as faults: a bare 500 means that the service itself failed."""

    def wrong(probe: SoapProbe) -> str | None:
        status = probe.exchange.response.status if probe.exchange else 0
        if status < _FAILED or probe.kind in _OF_NO_VERSION:
            return None if status == 0 else ""
        return "" if probe.fault is not None else f"status {status} without a fault"

    return _cases(trace, "a fault, if it fails", wrong)


@_rule("soap/recovers")
def recovers(trace: Trace, run: Run) -> Iterator[Outcome]:
    """Judge whether a valid message still gets its usual response after wrong ones."""
    before = {one.operation: one.is_success for one in trace if one.kind is Kind.USUAL}

    def wrong(probe: SoapProbe) -> str | None:
        if not before.get(probe.operation) or probe.exchange is None:
            return None
        return "" if probe.is_success else _came(probe)

    again = (one for one in probes_left(trace, services_of(run.contract)) if one.kind is Kind.AGAIN)
    return _cases(again, "success, as before", wrong)


@_rule("soap/no-internals")
def no_internals(trace: Trace) -> Iterator[Outcome]:
    """Judge whether a response shows a traceback."""

    def wrong(probe: SoapProbe) -> str | None:
        if probe.exchange is None or probe.exchange.response.ok:
            return None
        shown = inside_shown(probe.exchange)
        return f"{shown!r}" if shown else ""

    return _cases(trace, "an error that shows nothing of the program", wrong)


def _play(_trace: Trace | Things) -> tuple[Outcome, ...]:
    """Play a scenario; `checkers.soap_memory` judges what is read after its changes."""
    return ()


written_is_read, refused_keeps, created_is_there, deleted_is_gone = (
    rule(f"soap/{name}", on=(soap_changes,))(_play)
    for name in ("written-is-read", "refused-keeps", "created-is-there", "deleted-is-gone")
)
states = rule("soap/states", on=(soap_things,))(_play)


def _of_things(name: str, of: Rule, part: str = "lives") -> Rule:
    """Return a rule that judges what SOAP operations keep as another rule judges resources."""

    def judge_things(trace: Things, run: Run) -> Iterator[Outcome]:
        resources = resources_of(run.contract)
        for outcome in of.judge(getattr(trace, part)):
            yield resources.in_soap(outcome) if resources is not None and isinstance(outcome, Case) else outcome

    return rule(f"soap/{name}", on=(soap_things,))(judge_things)


things_created, things_written, things_deleted, things_kept, things_listed, things_chosen, things_paged, things_used = (
    _of_things("created-is-there", test_lives.created_is_there),
    _of_things("written-is-read", test_lives.written_is_read),
    _of_things("deleted-is-gone", test_lives.deleted_is_gone),
    _of_things("refused-keeps", test_lives.refused_keeps),
    _of_things("written-is-read", test_lives.same_values),
    _of_things("lists", test_lives.chosen_by_value),
    _of_things("lists", test_resources.list_pages, "pages"),
    _of_things("deleted-is-gone", test_lives.nothing_refers_to_what_is_gone, "deletions"),
)

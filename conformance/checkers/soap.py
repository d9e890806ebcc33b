"""The checkers of SOAP judge every response of a run, so that a rare failure is noticed."""

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from lxml import etree

from conformance.api.soap.envelope import Envelope, Fault, NotSoapError, read_root
from conformance.documents.traceback import inside_shown
from conformance.documents.wsdl import Wsdl, WsdlError
from conformance.documents.xml import (
    ENVELOPE,
    NotXmlError,
    clark,
    elements,
    has_doctype,
    has_instruction,
    local,
    namespace,
    parse,
)
from conformance.transport.exchange import Attempt, Exchange, Response
from conformance.verdict.evidence import Case

# Encodings that BP 1.1 R1012 allows; ASCII is a part of UTF-8.
_ENCODINGS: Final = frozenset({"", "utf-8", "utf8", "utf-16", "utf-16le", "utf-16be", "us-ascii", "ascii"})
_ENCODING_STYLE: Final = clark(ENVELOPE, "encodingStyle")
_MUST_UNDERSTAND: Final = clark(ENVELOPE, "mustUnderstand")
_FAULT_CHILDREN: Final = frozenset({"faultcode", "faultstring", "faultactor", "detail"})
_FAULT_CODES: Final = frozenset({"VersionMismatch", "MustUnderstand", "Client", "Server"})
#: The namespace of SOAP 1.2, as its envelopes have it.
SOAP_12: Final = b"http://www.w3.org/2003/05/soap-envelope"
_CHARSET: Final = re.compile(r"""charset\s*=\s*["']?([^\s;"']+)""", re.IGNORECASE)
_UTF: Final = "UTF-8 or UTF-16"
_DECLARED: Final = re.compile(rb"""\A(?:\xef\xbb\xbf)?<\?xml[^>]*?encoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")
_PASSIVE: Final = (
    "R1000 R1001 fault-complete R1004 fault-code faultcode-qualified R1005 R1006 R1008 R1009 R1011 R1012 R1013 "
    "R1014 R1018 R1111 R1124 R1126 R1141 content-type R2712 fault-no-traceback"
)
PASSIVE: Final = tuple(f"soap-basic-profile/{name}" for name in _PASSIVE.split())


class SoapCheckers:
    """Judges every response to a POST at one of the endpoints.

    Args:
        endpoints: URL of each service, with the tags of the elements that its responses may hold.
    """

    def __init__(self, endpoints: Mapping[str, Collection[str]]) -> None:
        self._endpoints = endpoints

    def __call__(self, attempt: Attempt) -> Iterator[Case]:
        """Yield the cases of one exchange; none if it is no call of these services."""
        request = attempt.request
        if not isinstance(attempt, Exchange) or request.method != "POST" or request.url not in self._endpoints:
            return
        if SOAP_12 in request.body:
            return  # a service that also supports SOAP 1.2 answers a request of that version in it
        rules, response = _Rules(attempt), attempt.response
        yield rules.case("R1141", response.http_version in {"HTTP/1.1", "HTTP/1.0"}, "HTTP/1.1 or HTTP/1.0")
        inside = inside_shown(attempt)
        expected = "a response that shows nothing of the program"
        yield rules.case("fault-no-traceback", not inside, expected, lambda: f"{inside!r} in the response")
        if response.body:
            yield from _document(rules, response, self._endpoints[request.url])


@dataclass(frozen=True)
class _Rules:
    """The rules for one SOAP response."""

    exchange: Exchange

    def case(
        self,
        name: str,
        holds: bool,  # noqa: FBT001 - as Occasion.case()
        expected: str,
        got: Callable[[], str] = str,
    ) -> Case:
        """Return the case of one rule; ``got`` is called only where it is broken."""
        found = "" if holds else got()
        return Case(holds, self.exchange, expected, found, requirement=f"soap-basic-profile/{name}")


def _document(rules: _Rules, response: Response, answers: Collection[str]) -> Iterator[Case]:
    is_text_xml = response.media_type == "text/xml"
    encoding = _encoding(response)
    try:
        root = parse(response.body, doctype=True)
    except NotXmlError as error:
        problem = str(error)
        if is_text_xml:
            yield rules.case("R1012", encoding in _ENCODINGS, _UTF, lambda: f"the encoding {encoding!r}")
        is_other = not (response.ok or is_text_xml)
        yield rules.case("content-type", is_other, "a SOAP message as text/xml", lambda: f"a body that is {problem}")
        return
    if local(str(root.tag)) != "Envelope":
        # An HTML page or a problem document with 4xx is no SOAP response, and none is required there.
        yield rules.case("content-type", not response.ok, "a SOAP message", lambda: f"the root element {root.tag}")
        return
    yield from _message(rules, response, root, answers, encoding)


def _message(
    rules: _Rules, response: Response, root: etree._Element, answers: Collection[str], encoding: str
) -> Iterator[Case]:
    case = rules.case
    once = not response.repeated_name("Content-Type")
    yield case(
        "content-type", response.media_type == "text/xml" and once, "Content-Type: text/xml", lambda: _type(response)
    )
    yield case("R1012", encoding in _ENCODINGS, _UTF, lambda: f"the encoding {encoding!r}")
    yield case("R1018", _fits(response), "the charset of the body in Content-Type", lambda: _type(response))
    yield case("R1008", not has_doctype(root), "a message without DOCTYPE", lambda: "a message with a DOCTYPE")
    is_plain = not has_instruction(root)
    yield case("R1009", is_plain, "a message without processing instructions", lambda: "a processing instruction")
    try:
        message = read_root(root)
    except NotSoapError as error:
        problem = str(error)
        yield case("R2712", holds=False, expected="a SOAP 1.1 message", got=lambda: problem)
        return
    after = elements(root)[elements(root).index(message.body) + 1 :]
    yield case("R1011", not after, "no element after Body", lambda: f"{after[0].tag} after Body")
    yield from _encoding_styles(rules, message)
    bare = [str(child.tag) for child in message.payload if not namespace(str(child.tag))]
    yield case("R1014", not bare, "children of Body with a namespace", lambda: f"{bare[0]!r} without a namespace")
    odd = [value for block in message.headers if (value := block.get(_MUST_UNDERSTAND)) not in {None, "0", "1"}]
    yield case("R1013", not odd, 'mustUnderstand="0" or "1"', lambda: f"mustUnderstand={odd[0]!r}")
    if message.fault is not None:
        yield from _fault(rules, response, message.fault)
        return
    yield case("R1124", response.ok, "status 2xx for a message without a fault")
    yield case("R1111", response.status == 200, "status 200 for a message without a fault")  # noqa: PLR2004 - R1111
    tag = str(message.first.tag) if message.first is not None else "none"
    yield case(
        "R2712",
        tag in answers and len(message.payload) == 1,
        "the response element of an operation, alone in the Body",
        lambda: f"{len(message.payload)} children of the Body, the first {tag}",
    )


def _encoding_styles(rules: _Rules, message: Envelope) -> Iterator[Case]:
    soap = [
        str(element.tag)
        for element in message.root.iter()
        if isinstance(element.tag, str) and namespace(element.tag) == ENVELOPE and element.get(_ENCODING_STYLE)
    ]
    yield rules.case("R1005", not soap, "no encodingStyle on SOAP's elements", lambda: f"encodingStyle on {soap[0]}")
    inside = [str(child.tag) for child in message.payload if child.get(_ENCODING_STYLE) is not None]
    yield rules.case("R1006", not inside, "no encodingStyle in Body", lambda: f"encodingStyle on {inside[0]}")


def _fault(rules: _Rules, response: Response, fault: Fault) -> Iterator[Case]:
    case = rules.case
    yield case("R1126", response.status == 500, "status 500 with a fault")  # noqa: PLR2004 - R1126
    odd = [tag for tag in fault.names if local(tag) not in _FAULT_CHILDREN]
    expected = "no other children of Fault than faultcode, faultstring, faultactor and detail"
    yield case("R1000", not odd, expected, lambda: f"the child {odd[0]}")
    spaced = [tag for tag in fault.names if namespace(tag)]
    yield case("R1001", not spaced, "children of Fault without a namespace", lambda: f"the child {spaced[0]}")
    there = {local(tag) for tag in fault.names}
    yield case(
        "fault-complete",
        {"faultcode", "faultstring"} <= there and bool(fault.code),
        "a faultcode and a faultstring",
        lambda: (
            f"only {', '.join(sorted(there)) or 'an empty Fault'}" if fault.code else "an empty or missing faultcode"
        ),
    )
    if "faultcode" not in there:
        return
    bound = "a faultcode whose prefix is bound"
    yield case("faultcode-qualified", bool(fault.code_namespace), bound, lambda: f"{fault.code!r} without a namespace")
    if fault.code_namespace:
        is_standard = fault.code_namespace != ENVELOPE or fault.code in _FAULT_CODES
        expected = "one of SOAP's fault codes, or a fault code in a namespace of its own"
        yield case("R1004", is_standard, expected, lambda: f"{fault.code!r} in SOAP's namespace")
        # A service with WS-Addressing has fault codes of its own for wrong addressing headers.
        addressed = b"addressing" in rules.exchange.request.body and "addressing" in fault.code_namespace
        yield case(
            "fault-code",
            fault.standard in _FAULT_CODES or addressed,
            f"one of the fault codes {', '.join(sorted(_FAULT_CODES))}",
            lambda: f"{fault.code!r} in the namespace {fault.code_namespace!r}",
        )


def _encoding(response: Response) -> str:
    """Return the character encoding that a response names: Content-Type outranks the document (RFC 7303 3.2)."""
    charset = _CHARSET.search(response.header("content-type") or "")
    if charset:
        return charset[1].lower()
    declared = _DECLARED.match(response.body)
    return declared[1].decode("ascii").lower() if declared else ""


def _fits(response: Response) -> bool:
    """Return whether the body is in the encoding that Content-Type names; R1012 judges others than UTF-8 and -16."""
    charset = _CHARSET.search(response.header("content-type") or "")
    if charset is None or charset[1].lower() not in _ENCODINGS:
        return True
    # XML begins with "<" or a byte order mark, so UTF-16 shows in the first two bytes: a mark or a zero.
    wide = response.body[:2] in {b"\xff\xfe", b"\xfe\xff"} or 0 in response.body[:2]
    return wide == charset[1].lower().startswith("utf-16")


def _type(response: Response) -> str:
    return f"Content-Type {response.header('content-type')!r}"


def answers_of(*described: Wsdl) -> frozenset[str]:
    """Return the tags of a service's response elements, by the contract's description and the service's own."""
    found: set[str] = set()
    for description in described:
        try:
            found |= {operation.response for operation in description.operations if operation.response}
        except WsdlError:
            continue
    return frozenset(found)

"""Watches every SOAP answer of a run for what must hold of all of them, so that rare failures are seen as well."""

import re
from collections.abc import Callable, Collection, Mapping
from typing import Final

from lxml import etree

from conformance.api.soap.envelope import Envelope, Fault, NotSoapError, read_root
from conformance.api.soap.service import SoapService
from conformance.documents.traceback import inside_shown
from conformance.documents.wsdl import DescriptionError
from conformance.documents.xml import NotXmlError, elements, has_doctype, parse
from conformance.documents.xml_names import ENVELOPE, clark, local, namespace
from conformance.transport.exchange import Exchange, Listener, Response
from conformance.verdict.evidence import Judge

# BP 1.1 R1012; ASCII is a part of UTF-8.
_ENCODINGS: Final = frozenset({"", "utf-8", "utf8", "utf-16", "utf-16le", "utf-16be", "us-ascii", "ascii"})
_ENCODING_STYLE: Final = clark(ENVELOPE, "encodingStyle")
_MUST_UNDERSTAND: Final = clark(ENVELOPE, "mustUnderstand")
_FAULT_CHILDREN: Final = frozenset({"faultcode", "faultstring", "faultactor", "detail"})
_FAULT_CODES: Final = frozenset({"VersionMismatch", "MustUnderstand", "Client", "Server"})
#: The namespace of SOAP 1.2, as its envelopes have it.
_SOAP_12: Final = b"http://www.w3.org/2003/05/soap-envelope"
_CHARSET: Final = re.compile(r"""charset\s*=\s*["']?([^\s;"']+)""", re.IGNORECASE)
_DECLARED: Final = re.compile(rb"""\A(?:\xef\xbb\xbf)?<\?xml[^>]*?encoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")
PASSIVE: Final = tuple(
    f"soap-basic-profile/{name}"
    for name in (
        "R1000",
        "R1001",
        "fault-complete",
        "R1004",
        "faultcode-qualified",
        "R1005",
        "R1006",
        "R1008",
        "R1009",
        "R1011",
        "R1012",
        "R1013",
        "R1014",
        "R1018",
        "R1111",
        "R1124",
        "R1126",
        "R1141",
        "content-type",
        "R2712",
        "fault-no-traceback",
    )
)


class SoapObserver(Listener):
    """Judges every answer to a POST at one of the endpoints.

    Args:
        judge: takes what is seen.
        endpoints: URL of each service, with the tags of the elements that its responses may hold.
    """

    def __init__(self, judge: Judge, endpoints: Mapping[str, Collection[str]]) -> None:
        self._judge = judge
        self._endpoints = endpoints

    def answered(self, exchange: Exchange) -> None:
        """Take an exchange, whatever it is."""
        request, response = exchange.request, exchange.response
        if request.method != "POST" or request.url not in self._endpoints or _SOAP_12 in request.body:
            # A node that has SOAP 1.2 as well answers a request of that version in it.
            return
        self._that("R1141", response.http_version in {"HTTP/1.1", "HTTP/1.0"}, exchange, "HTTP/1.1 or HTTP/1.0")
        inside = inside_shown(response.body)
        self._that(
            "fault-no-traceback",
            not inside,
            exchange,
            "an answer without a traceback",
            lambda: f"the answer shows {inside!r}",
        )
        if response.body:
            self._document(exchange, response, self._endpoints[request.url])

    def _document(self, exchange: Exchange, response: Response, answers: Collection[str]) -> None:
        claims_xml = response.media_type == "text/xml"
        encoding = _encoding(response)
        try:
            root = parse(response.body, doctype=True)
        except NotXmlError as error:
            problem = str(error)
            if claims_xml:
                self._that(
                    "R1012", encoding in _ENCODINGS, exchange, "UTF-8 or UTF-16", lambda: f"it says {encoding!r}"
                )
            self._that(
                "content-type",
                not (response.ok or claims_xml),
                exchange,
                "a SOAP message as text/xml",
                lambda: f"{exchange.came}, and the body is {problem}",
            )
            return
        if local(str(root.tag)) != "Envelope":
            # An HTML page or a problem document with 4xx is no SOAP answer, and none is asked for there.
            self._that(
                "content-type",
                not response.ok,
                exchange,
                "a SOAP message",
                lambda: f"{exchange.came}, and a document that begins with {root.tag}",
            )
            return
        self._message(exchange, response, root, answers, encoding)

    def _message(
        self, exchange: Exchange, response: Response, root: etree._Element, answers: Collection[str], encoding: str
    ) -> None:
        that = self._that
        once = not response.repeated("Content-Type")
        that("content-type", response.media_type == "text/xml" and once, exchange, "text/xml", lambda: _type(response))
        that("R1012", encoding in _ENCODINGS, exchange, "UTF-8 or UTF-16", lambda: f"the encoding {encoding!r}")
        that("R1018", _fits(response), exchange, "a charset that is the body's", lambda: _type(response))
        that("R1008", not has_doctype(root), exchange, "no DOCTYPE", lambda: "a DOCTYPE")
        that("R1009", not _has_instruction(root), exchange, "no processing instruction", lambda: "one")
        try:
            message = read_root(root)
        except NotSoapError as error:
            problem = str(error)
            that("R2712", holds=False, exchange=exchange, expected="a SOAP 1.1 message", found=lambda: problem)
            return
        after = elements(root)[elements(root).index(message.body) + 1 :]
        that("R1011", not after, exchange, "nothing after Body", lambda: f"{after[0].tag} after it")
        self._encoding_styles(exchange, message)
        bare = [str(child.tag) for child in message.payload if not namespace(str(child.tag))]
        that("R1014", not bare, exchange, "qualified children of Body", lambda: f"{bare[0]!r} in no namespace")
        odd = [value for block in message.headers if (value := block.get(_MUST_UNDERSTAND)) not in {None, "0", "1"}]
        that("R1013", not odd, exchange, "mustUnderstand 0 or 1", lambda: f"mustUnderstand={odd[0]!r}")
        if message.fault is not None:
            self._fault(exchange, response, message.fault)
            return
        that("R1124", response.ok, exchange, "2xx for a response without a fault")
        that("R1111", response.status == 200, exchange, "200 for a response without a fault")  # noqa: PLR2004 - R1111
        tag = str(message.first.tag) if message.first is not None else "nothing"
        that(
            "R2712",
            tag in answers and len(message.payload) == 1,
            exchange,
            "the response element of an operation, alone in the Body",
            lambda: f"{len(message.payload)} children, first {tag}",
        )

    def _encoding_styles(self, exchange: Exchange, message: Envelope) -> None:
        soap = [
            str(element.tag)
            for element in message.root.iter()
            if isinstance(element.tag, str) and namespace(element.tag) == ENVELOPE and element.get(_ENCODING_STYLE)
        ]
        self._that("R1005", not soap, exchange, "no encodingStyle", lambda: f"one on {soap[0]}")
        inside = [str(child.tag) for child in message.payload if child.get(_ENCODING_STYLE) is not None]
        self._that("R1006", not inside, exchange, "no encodingStyle in Body", lambda: f"one on {inside[0]}")

    def _fault(self, exchange: Exchange, response: Response, fault: Fault) -> None:
        that = self._that
        that("R1126", response.status == 500, exchange, "status 500 with a fault")  # noqa: PLR2004 - R1126
        odd = [tag for tag in fault.names if local(tag) not in _FAULT_CHILDREN]
        that("R1000", not odd, exchange, "only faultcode, faultstring, faultactor, detail", lambda: f"{odd[0]}")
        spaced = [tag for tag in fault.names if namespace(tag)]
        that("R1001", not spaced, exchange, "unqualified children of Fault", lambda: f"{spaced[0]}")
        there = {local(tag) for tag in fault.names}
        that(
            "fault-complete",
            {"faultcode", "faultstring"} <= there and bool(fault.code),
            exchange,
            "faultcode and faultstring",
            lambda: f"only {', '.join(sorted(there)) or 'nothing'}" if fault.code else "an empty or missing faultcode",
        )
        if "faultcode" not in there:
            return
        that(
            "faultcode-qualified",
            bool(fault.code_namespace),
            exchange,
            "a faultcode with a prefix that is bound",
            lambda: f"faultcode {fault.code!r} with no namespace",
        )
        if not fault.code_namespace:
            return
        that(
            "R1004",
            fault.code_namespace != ENVELOPE or fault.code in _FAULT_CODES,
            exchange,
            "one of SOAP's fault codes, or one of its own namespace",
            lambda: f"{fault.code!r} in SOAP's namespace",
        )

    def _that(
        self,
        name: str,
        holds: bool,  # noqa: FBT001 - as Judge.check()
        exchange: Exchange,
        expected: str,
        found: Callable[[], str] | None = None,
    ) -> None:
        text = found() if found is not None and not holds else ""
        self._judge.check(f"soap-basic-profile/{name}", holds, exchange, expected, found=text)


def _encoding(response: Response) -> str:
    """The character encoding that an answer says it has: Content-Type's word outranks the document's (RFC 7303 3.2)."""
    charset = _CHARSET.search(response.header("content-type") or "")
    if charset:
        return charset[1].lower()
    declared = _DECLARED.match(response.body)
    return declared[1].decode("ascii").lower() if declared else ""


def _fits(response: Response) -> bool:
    """Whether the body is in the character encoding that Content-Type names; R1012 judges others than UTF-8 and -16."""
    charset = _CHARSET.search(response.header("content-type") or "")
    if charset is None or charset[1].lower() not in _ENCODINGS:
        return True
    # XML begins with "<" or a byte order mark, so that UTF-16 has a zero or a mark of its own in its first two octets.
    wide = response.body[:2] in {b"\xff\xfe", b"\xfe\xff"} or 0 in response.body[:2]
    return wide == charset[1].lower().startswith("utf-16")


def _has_instruction(root: etree._Element) -> bool:
    if any(node is not None for node in root.iter(etree.PI)):
        return True
    around = [*root.itersiblings(preceding=True), *root.itersiblings()]
    return any(isinstance(node, etree._ProcessingInstruction) for node in around)  # noqa: SLF001 - no public name


def _type(response: Response) -> str:
    return f"Content-Type {response.header('content-type')!r}"


def answers_of(service: SoapService) -> frozenset[str]:
    """Tags of the elements with which the operations of a service answer, by the contract and by the robot's word."""
    described = [service.own] if service.own is not None else []
    if service.contract_wsdl_path is not None:
        described.append(service.contract)
    found: set[str] = set()
    for description in described:
        try:
            found |= {operation.response for operation in description.operations if operation.response}
        except DescriptionError:
            continue
    return frozenset(found)

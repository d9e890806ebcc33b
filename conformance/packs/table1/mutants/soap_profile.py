"""Mutants whose messages and faults break WS-I Basic Profile 1.1 or SOAP 1.1."""

from collections.abc import Callable

from lxml import etree

from conformance.mutation.changes import (
    Make,
    altered,
    anything,
    becomes,
    header,
    page,
    posted,
    problem,
    soap,
    status,
    text,
)
from conformance.mutation.messages import Forward, Request, Response, unchanged
from conformance.mutation.table import Table
from conformance.mutation.xml_trees import each, gone, says, tree
from conformance.packs.table1.mutants.soap_responses import (
    TRACE,
    coded,
    declared,
    fault_tree,
    hinted,
    in_body,
    instructed,
    is_fault,
    latin,
    qualified,
    styled,
    trailer,
    unbound,
    understood_true,
    unqualified,
    wrapper_as_asked,
)

_SESAME = "open-sesame"
MUTANTS = Table()
_mutant = MUTANTS.of_class("soap-basic-profile", "soap")

_PAGE = b"<html><body>Internal Server Error</body></html>"
_ANY = soap()
_ACT = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest")


def _answers(edit: Callable[[Response], object]) -> Make:
    """Return a change that applies ``edit`` to every response of an operation, faults too."""
    return altered(_ANY, edit, anything)


def _faults(edit: Callable[[Response], object]) -> Make:
    """Return a change that applies ``edit`` to faults."""
    return altered(posted, edit, is_fault)


def _plain_success(response: Response) -> bool:
    return response.status == 200 and not is_fault(response)


def _is_malformed(request: Request) -> bool:
    if not posted(request):
        return False
    try:
        etree.fromstring(request.body, etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=True))
    except (etree.XMLSyntaxError, ValueError):
        return not request.body.startswith((b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf"))
    return False


def _not_post(request: Request) -> bool:
    return (
        request.side == "soap"
        and request.method not in {"POST", "HEAD", "OPTIONS"}
        and "wsdl" not in request.query
        and "xsd" not in request.query
    )


@_mutant("bp-any-type", "R1115", "The robot accepts every media type as text/xml.")
def _any_type(request: Request, forward: Forward) -> Response:
    if posted(request) and request.media_type != "text/xml":
        request = request.copy()
        request.put("Content-Type", "text/xml; charset=utf-8")
    return forward(request)


def _in_chunks(request: Request) -> bool:
    return posted(request) and request.field("Transfer-Encoding") is not None


def _first_part(request: Request) -> None:
    """Cut the body of a chunked request to 8 KiB."""
    request.body = request.body[:8192]


_mutant("bp-fault-hint", "R1000", "A Fault has an undeclared child.").made(_faults(fault_tree(hinted)))
_mutant("bp-fault-qualified", "R1001", "The children of a Fault are in the SOAP namespace.").made(
    _faults(fault_tree(qualified))
)
_mutant("bp-fault-mute", "fault-complete", "A Fault has no faultstring.").made(
    _faults(fault_tree(each("faultstring", gone)))
)
_mutant("bp-fault-codeless", "fault-complete", "A Fault has no faultcode.").made(
    _faults(fault_tree(each("faultcode", gone)))
)
_mutant("bp-fault-own-namespace", "fault-code", "faultcode is a code in a namespace of the robot's own.").made(
    _faults(text(r"<faultcode([^>]*)>\s*[\w.-]+:", r'<faultcode xmlns:own="urn:example:own"\1>own:'))
)
_mutant("bp-fault-own-code", ("R1004", "fault-code"), "faultcode is a code that SOAP 1.1 does not define.").made(
    _faults(coded("Oops"))
)
_mutant("bp-fault-unbound", "faultcode-qualified", "The prefix of faultcode is not bound.").made(_faults(unbound))
_mutant("bp-fault-code-bare", "faultcode-qualified", "faultcode has no prefix.").made(
    _faults(text(r"(<faultcode[^>]*>\s*)[\w.-]+:", r"\1"))
)
_mutant("bp-encoding-style", "R1005", "Envelope has an encodingStyle attribute.").made(_answers(tree(styled)))
_mutant("bp-encoding-style-child", "R1006", "The child of Body has an encodingStyle attribute.").made(
    _answers(in_body(styled))
)
_mutant("bp-doctype", "R1008", "Responses have a document type declaration.").made(_answers(declared))
_mutant("bp-instruction", "R1009", "Responses have a processing instruction.").made(_answers(instructed))
_mutant("bp-trailer", "R1011", "An element follows Body.").made(_answers(tree(trailer)))
_mutant("bp-latin", "R1012", "Responses are encoded in ISO 8859-1.").made(_answers(latin))
_mutant("bp-charset-wrong", "R1018", "Content-Type declares UTF-16 for a message in UTF-8.").made(
    _answers(header("Content-Type", "text/xml; charset=utf-16"))
)
_mutant("bp-must-understand-true", "R1013", 'mustUnderstand is "true" instead of "1".').made(
    _answers(tree(understood_true))
)
_mutant("bp-body-unqualified", "R1014", "The child of Body is in no namespace.").altered(
    _ANY, in_body(unqualified), _plain_success
)
_mutant("bp-status-accepted", "R1111", "Responses have status 202.").altered(_ANY, becomes(202), _plain_success)
_mutant("bp-malformed-422", "R1113", "Malformed XML returns 422.").altered(_is_malformed, page(422), anything)
_mutant("bp-status-redirect", "R1124", "Responses have status 500.").altered(_ANY, becomes(500), _plain_success)
_mutant("bp-malformed-page", "R1125", "Malformed XML returns 500 with a page.").altered(
    _is_malformed, page(500, _PAGE, "text/html"), anything
)
_mutant("bp-malformed-fine", "R1125", "Malformed XML returns 200.").altered(_is_malformed, page(200), anything)
_mutant("bp-get-200", "R1114", "GET of the service returns 200 with a page.").altered(_not_post, page(200), anything)
_mutant("bp-type-case", "media-type-case", "A Content-Type with a capital letter returns 415.").instead(
    lambda request: posted(request) and not (request.field("Content-Type") or "").startswith("text/xml"),
    problem(415, "text/xml, please"),
)
_mutant("bp-quoted-charset", "charset-forms", "A charset in quotation marks returns 415.").instead(
    lambda request: posted(request) and '"' in (request.field("Content-Type") or ""), problem(415, "text/xml, please")
)
_mutant("bp-token-ignored", "authentication", "SOAP messages need no token.", token=_SESAME)(unchanged)


@_mutant(
    "bp-token-refused-and-made",
    "authentication",
    "A SOAP delivery without the token returns 401 and is published.",
    token=_SESAME,
    observer=True,
)
def _unauthorized_and_made(request: Request, forward: Forward) -> Response:
    if posted(request) and request.field("Authorization") != f"Bearer {_SESAME}":
        forward(request)
        return problem(401, "no token", ("WWW-Authenticate", "Bearer"))(request)
    return forward(request)


_mutant("bp-no-chunks", "chunked", "A chunked message returns 400.").instead(
    _in_chunks, problem(400, "a length, please")
)
_mutant("bp-few-chunks", "chunked", "The robot reads only 8 KiB of a chunked message.").rewritten(
    _in_chunks, _first_part
)
_mutant("bp-fault-200", "R1126", "Faults have status 200.").made(_faults(becomes(200)))
_mutant("bp-fault-400", "R1126", "Faults have status 400.").made(_faults(becomes(400)))
_mutant("bp-http-1-2", "R1141", "Responses have the version HTTP/1.2.").altered(
    posted, lambda response: setattr(response, "version", "HTTP/1.2"), anything
)
_mutant("bp-soap12-type", "content-type", "Responses have the media type application/soap+xml.").altered(
    posted, header("Content-Type", "application/soap+xml; charset=utf-8"), anything
)
_mutant("bp-wrapper-as-asked", "R2712", "The response wrapper has the name of the request wrapper.").altered(
    _ANY, in_body(wrapper_as_asked), _plain_success
)
_mutant("bp-server-to-blame", "R2724", "Errors of the client return a Server fault.").altered(
    _ACT, coded("Server"), is_fault
)
_mutant("bp-traceback", "fault-no-traceback", "Faults contain a stack trace.").made(
    _faults(fault_tree(each("faultstring", says(TRACE))))
)
_mutant("bp-fault-sometimes-200", "R1126", "One fault in 50 has status 200.").altered(
    posted, becomes(200), status(500), nth=50
)

"""Robots that break WS-I Basic Profile 1.1 and SOAP 1.1 in their messages and faults."""

from collections.abc import Callable

from lxml import etree

from conformance.mutation.changes import (
    Make,
    altered,
    anything,
    becomes,
    header,
    instead,
    page,
    posted,
    problem,
    rewritten,
    soap,
    status,
    text,
)
from conformance.mutation.messages import Forward, Request, Response
from conformance.mutation.mutant import of_class
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
from conformance.packs.table1.mutants.xml_trees import each, gone, says, tree

_PAGE = b"<html><body>Internal Server Error</body></html>"
_ANY = soap()
_ACT = soap("ExecuteCoffeeRequest", "ExecuteDeliveryRequest")


def _answers(edit: Callable[[Response], object]) -> Make:
    """Every answer to an operation is altered, faults too."""
    return altered(_ANY, edit, anything)


def _faults(edit: Callable[[Response], object]) -> Make:
    """Faults are altered."""
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


_mutant = of_class("soap-basic-profile", "soap")


def _any_type(request: Request, forward: Forward) -> Response:
    if posted(request) and request.media_type != "text/xml":
        request = request.copy()
        request.put("Content-Type", "text/xml; charset=utf-8")
    return forward(request)


def _in_chunks(request: Request) -> bool:
    return posted(request) and request.field("Transfer-Encoding") is not None


def _first_part(request: Request) -> None:
    """Of what comes in chunks, as much as a buffer holds."""
    request.body = request.body[:8192]


MUTANTS = (
    _mutant("bp-fault-hint", "A Fault has a child of the robot's own.", "R1000", _faults(fault_tree(hinted))),
    _mutant("bp-fault-qualified", "The children of a Fault are qualified.", "R1001", _faults(fault_tree(qualified))),
    _mutant(
        "bp-fault-mute", "A Fault has no faultstring.", "fault-complete", _faults(fault_tree(each("faultstring", gone)))
    ),
    _mutant(
        "bp-fault-codeless", "A Fault has no faultcode.", "fault-complete", _faults(fault_tree(each("faultcode", gone)))
    ),
    _mutant(
        "bp-fault-own-code", "faultcode is a code that SOAP's namespace does not have.", "R1004", _faults(coded("Oops"))
    ),
    _mutant("bp-fault-unbound", "The prefix of faultcode is not bound.", "faultcode-qualified", _faults(unbound)),
    _mutant(
        "bp-fault-code-bare",
        "faultcode has no prefix.",
        "faultcode-qualified",
        _faults(text(r"(<faultcode[^>]*>\s*)[\w.-]+:", r"\1")),
    ),
    _mutant("bp-encoding-style", "Envelope carries encodingStyle.", "R1005", _answers(tree(styled))),
    _mutant("bp-encoding-style-child", "The child of Body carries encodingStyle.", "R1006", _answers(in_body(styled))),
    _mutant("bp-doctype", "Answers have a Document Type Declaration.", "R1008", _answers(declared)),
    _mutant("bp-instruction", "Answers have a processing instruction.", "R1009", _answers(instructed)),
    _mutant("bp-trailer", "Something follows Body.", "R1011", _answers(tree(trailer))),
    _mutant("bp-latin", "Answers are ISO 8859-1.", "R1012", _answers(latin)),
    _mutant(
        "bp-charset-wrong",
        "Content-Type says UTF-16 of messages in UTF-8.",
        "R1018",
        _answers(header("Content-Type", "text/xml; charset=utf-16")),
    ),
    _mutant("bp-must-understand-true", "mustUnderstand is written true.", "R1013", _answers(tree(understood_true))),
    _mutant(
        "bp-body-unqualified",
        "The child of Body is in no namespace.",
        "R1014",
        altered(_ANY, in_body(unqualified), _plain_success),
    ),
    _mutant("bp-status-accepted", "Responses are 202.", "R1111", altered(_ANY, becomes(202), _plain_success)),
    _mutant("bp-malformed-422", "Malformed XML is 422.", "R1113", altered(_is_malformed, page(422), anything)),
    _mutant("bp-status-redirect", "Responses are 500.", "R1124", altered(_ANY, becomes(500), _plain_success)),
    _mutant(
        "bp-malformed-page",
        "Malformed XML is 500 with a page.",
        "R1125",
        altered(_is_malformed, page(500, _PAGE, "text/html"), anything),
    ),
    _mutant("bp-malformed-fine", "Malformed XML is 200.", "R1125", altered(_is_malformed, page(200), anything)),
    _mutant("bp-get-200", "GET of the service is 200 with a page.", "R1114", altered(_not_post, page(200), anything)),
    _mutant("bp-any-type", "Any media type is taken for text/xml.", "R1115", lambda: _any_type),
    _mutant(
        "bp-type-case",
        "A media type with a capital letter is 415.",
        "media-type-case",
        instead(
            lambda request: posted(request) and not (request.field("Content-Type") or "").startswith("text/xml"),
            problem(415, "text/xml, please"),
        ),
    ),
    _mutant(
        "bp-quoted-charset",
        "A charset in quotation marks is 415.",
        "charset-forms",
        instead(
            lambda request: posted(request) and '"' in (request.field("Content-Type") or ""),
            problem(415, "text/xml, please"),
        ),
    ),
    _mutant(
        "bp-no-chunks", "A message in chunks is 411.", "chunked", instead(_in_chunks, problem(411, "a length, please"))
    ),
    _mutant("bp-few-chunks", "Of a message in chunks, 8 KiB are read.", "chunked", rewritten(_in_chunks, _first_part)),
    _mutant("bp-fault-200", "Faults are 200.", "R1126", _faults(becomes(200))),
    _mutant("bp-fault-400", "Faults are 400.", "R1126", _faults(becomes(400))),
    _mutant(
        "bp-http-1-2",
        "Answers say HTTP/1.2.",
        "R1141",
        altered(posted, lambda response: setattr(response, "version", "HTTP/1.2"), anything),
    ),
    _mutant(
        "bp-soap12-type",
        "Answers are application/soap+xml.",
        "content-type",
        altered(posted, header("Content-Type", "application/soap+xml; charset=utf-8"), anything),
    ),
    _mutant(
        "bp-wrapper-as-asked",
        "The response's wrapper has the request's name.",
        "R2712",
        altered(_ANY, in_body(wrapper_as_asked), _plain_success),
    ),
    _mutant(
        "bp-server-to-blame",
        "What the client did wrong is a Server fault.",
        "R2724",
        altered(_ACT, coded("Server"), is_fault),
    ),
    _mutant(
        "bp-traceback",
        "Faults show a stack trace.",
        "fault-no-traceback",
        _faults(fault_tree(each("faultstring", says(TRACE)))),
    ),
    _mutant(
        "bp-fault-sometimes-200", "One fault in 50 is 200.", "R1126", altered(posted, becomes(200), status(500), nth=50)
    ),
)

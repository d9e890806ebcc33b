"""Mutants whose messages and faults break WS-I Basic Profile 1.1 or SOAP 1.1."""

from collections.abc import Callable

from lxml import etree

from conformance.mutation.changes import Make, altered, anything, posted, problem, soap
from conformance.mutation.messages import Forward, Request, Response
from conformance.mutation.table import Table
from conformance.packs.table1.mutants.soap_responses import is_fault

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


_mutant("bp-http-1-2", "R1141", "Responses have the version HTTP/1.2.").altered(
    posted, lambda response: setattr(response, "version", "HTTP/1.2"), anything
)

"""Mutants without one of their interfaces."""

from conformance.mutation.changes import Make, hanging_up, instead, plain, rest
from conformance.mutation.messages import Forward, HangUpError, Request, Response
from conformance.mutation.table import Table

MUTANTS = Table()
_mutant = MUTANTS.of_class("", "soap")
_OTHER_SERVER = plain(404, b"<html><body>It works!</body></html>", "text/html")


def _elsewhere(service: str) -> Make:
    """Return a change that makes a SOAP service (empty: all of them) respond like another web server."""
    return instead(lambda request: request.side == "soap" and service in request.path, _OTHER_SERVER)


for _class in ("rest-resources", "rest-delivery", "http", "safety", "equivalence", "strict-input"):
    _says = f"REST closes every connection without responding (seen by class {_class})."
    _mutant(f"rest-silent-{_class}", f"{_class}/reachable", _says, interface="rest").made(hanging_up(rest()))


@_mutant(
    "nothing-elsewhere",
    "xml-security/reachable",
    "REST closes every connection, and another web server is at both SOAP addresses.",
    interface="both",
)
def _nothing_there(request: Request, _forward: Forward) -> Response:
    if request.side == "rest":
        raise HangUpError
    return _OTHER_SERVER(request)

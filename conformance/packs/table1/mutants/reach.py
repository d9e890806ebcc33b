"""Robots of which an interface is not there."""

from conformance.mutation.changes import Make, hanging_up, instead, plain, rest
from conformance.mutation.messages import HangUpError, Request, Response
from conformance.mutation.mutant import Mutant

_REST_CLASSES = ("rest-resources", "rest-delivery", "http", "safety", "equivalence", "strict-input")
_LOST = plain(404, b"<html><body>It works!</body></html>", "text/html")


def _lost(service: str) -> Make:
    """Somebody else's web server answers for a service, or for all."""
    return instead(lambda request: request.side == "soap" and service in request.path, _LOST)


def _nothing_there(request: Request) -> Response:
    if request.side == "rest":
        raise HangUpError
    return _LOST(request)


MUTANTS = (
    *(
        Mutant(
            f"rest-silent-{name}",
            f"REST closes every connection without an answer (seen by class {name}).",
            (f"{name}/reachable",),
            "rest",
            hanging_up(rest()),
        )
        for name in _REST_CLASSES
    ),
    Mutant(
        "publishers-elsewhere",
        "Nothing is at the address of the publishers service but somebody else's web server.",
        ("soap-delivery/reachable", "equivalence/reachable"),
        "soap",
        _lost("publisher"),
    ),
    Mutant(
        "subscribers-elsewhere",
        "Nothing is at the address of the subscribers service but somebody else's web server.",
        ("soap-subscribers/reachable", "strict-input/reachable"),
        "soap",
        _lost("subscriber"),
    ),
    Mutant(
        "soap-elsewhere", "No SOAP service is where it should be.", ("soap-basic-profile/reachable",), "soap", _lost("")
    ),
    Mutant(
        "nothing-elsewhere",
        "REST hangs up, and SOAP is somebody else's web server.",
        ("xml-security/reachable",),
        "both",
        instead(lambda _request: True, _nothing_there),
    ),
)

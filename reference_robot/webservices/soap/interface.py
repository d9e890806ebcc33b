"""The SOAP interface: finds the service for a request by its path."""

from collections.abc import Awaitable, Callable, Iterable
from typing import Final

from reference_robot.webservices.http.admission import Admission
from reference_robot.webservices.http.authorization import Scope
from reference_robot.webservices.http.interface import Interface
from reference_robot.webservices.http.messages import Request, Response, content
from reference_robot.webservices.representation.problems import Problem
from reference_robot.webservices.soap.service import SoapService

_ALLOW: Final = (b"allow", b"POST, OPTIONS")
_ALLOW_DESCRIPTION: Final = (b"allow", b"GET, HEAD, POST, OPTIONS")
_READ: Final = frozenset({"GET", "HEAD"})


class SoapInterface(Interface):
    """The SOAP interface: services, each at its own path, and their descriptions."""

    def __init__(
        self, services: Iterable[SoapService], address: Callable[[Request], str], admission: Admission
    ) -> None:
        super().__init__(admission)
        self._services = {service.path.encode(): service for service in services}
        self._address = address

    def scope(self, request: Request) -> Scope:
        """Return the token scope of the service that the request addresses."""
        service = self._services.get(request.path)
        return Scope.READ if service is None else service.scope

    def answer(self, request: Request) -> Response | Awaitable[Response]:
        """Return the response of a service, or its description for ``?wsdl`` and ``?xsd=1``.

        Raises:
            Problem: 404 for an unknown path, 405 for other methods (WS-I BP R1114), and every problem of the service.
        """
        service = self._services.get(request.path)
        if service is None:
            raise Problem(404, f"there is no service at {request.path.decode('ascii')[:200]!a}")
        if request.method == "POST":
            return service.post(request)
        description = self._description(service, request)
        allow = _ALLOW if description is None else _ALLOW_DESCRIPTION
        if request.method == "OPTIONS":
            return Response(204, (allow,))
        if description is not None and request.method in _READ:
            return content(200, "text/xml", description)
        raise Problem(405, f"the method is not one of {allow[1].decode()}; send messages by POST", (allow,))

    def _description(self, service: SoapService, request: Request) -> bytes | None:
        query = request.query.lower()
        if query in {b"wsdl", b"wsdl=1"}:
            return service.description.wsdl(self._address(request))
        return service.description.xsd if query == b"xsd=1" else None

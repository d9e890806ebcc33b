"""The REST interface: finds the resource for a request (paper, ``ros-rs``)."""

from collections.abc import Awaitable, Callable, Iterable
from typing import Final

from reference_robot.webservices.http.admission import Admission
from reference_robot.webservices.http.authorization import Scope
from reference_robot.webservices.http.interface import Interface
from reference_robot.webservices.http.messages import Request, Response
from reference_robot.webservices.representation.problems import Problem
from reference_robot.webservices.resources.delivery import Delivery
from reference_robot.webservices.resources.resource import Resource

Handlers = dict[str, Callable[[Request], Response | Awaitable[Response]]]

_DELIVERY_PATHS: Final = b"/robot/app/delivery/"


class RestInterface(Interface):
    """The REST interface: resources with fixed paths, and the delivery resource, whose path contains values."""

    def __init__(self, resources: Iterable[Resource], delivery: Delivery, admission: Admission) -> None:
        super().__init__(admission)
        self._fixed: dict[bytes, Handlers] = {resource.path.encode(): resource.handlers() for resource in resources}
        self._delivery = delivery

    def scope(self, request: Request) -> Scope:
        """Return the scope for a request that changes something: ``deliver`` for deliveries, otherwise ``move``."""
        return Scope.DELIVER if request.path.startswith(_DELIVERY_PATHS) else Scope.MOVE

    def answer(self, request: Request) -> Response | Awaitable[Response]:
        """Return the response of the resource that the request addresses.

        Raises:
            Problem: 404 for an unknown path whatever the method, 405 with Allow for a method that the resource does not
                offer (RFC 9110 15.5.5, 15.5.6), and every problem that the resource raises.
        """
        handlers = self._fixed.get(request.path)
        if handlers is None:
            if request.method == "PUT" and request.path.startswith(_DELIVERY_PATHS):
                return self._delivery.put(request)  # must be fast; refuses an invalid path
            handlers = self._with_values(request.path)
        handler = handlers.get(request.method)
        if handler is not None:
            return handler(request)
        allow = (b"allow", ", ".join([*handlers, "OPTIONS"]).encode())
        if request.method == "OPTIONS":
            return Response(204, (allow,))
        raise Problem(405, f"the method is not one of {allow[1].decode()}", (allow,))

    def _with_values(self, path: bytes) -> Handlers:
        if self._delivery.owns(path):
            return self._delivery.handlers()
        hint = "; its path ends with a slash" if path + b"/" in self._fixed else ""
        raise Problem(404, f"there is no resource at {path.decode('ascii')[:200]!a}{hint}")

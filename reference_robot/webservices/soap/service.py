"""SOAP services: each dispatches a message to its operation and returns the response; their WSDL, XSD and paths."""

import logging
from collections.abc import Awaitable, Callable, Iterable
from functools import partial
from typing import Any, Final

from lxml import etree

from conformance.papers_robot.statement import CONTRACT_DIR
from reference_robot.webservices.http.access import Admission, Scope
from reference_robot.webservices.http.interface import Interface, await_response
from reference_robot.webservices.http.messages import Request, Response, content
from reference_robot.webservices.representation.problems import Problem, clip
from reference_robot.webservices.representation.reading import parsed, parsed_content_type
from reference_robot.webservices.representation.writing import element_of
from reference_robot.webservices.soap.envelope import SOAP, Fault, FaultCode, client_fault, operation_element

Operation = Callable[[etree._Element], Response | Awaitable[Response]]  # noqa: SLF001 - lxml's only name for the class

_LOGGER: Final = logging.getLogger(__name__)
_MEDIA_TYPE: Final = "text/xml"
_SERVERS_FAULT: Final = 500
_WSDL_SOAP: Final = "{http://schemas.xmlsoap.org/wsdl/soap/}"
_XSD: Final = "{http://www.w3.org/2001/XMLSchema}"
_ERRORS_SHOWN: Final = 3
_ALLOW: Final = (b"allow", b"POST, OPTIONS")
_ALLOW_DESCRIPTION: Final = (b"allow", b"GET, HEAD, POST, OPTIONS")
_READ: Final = frozenset({"GET", "HEAD"})


class SoapService:
    """A SOAP service; subclasses pass their operations by the local name of the request element.

    An operation gets the schema-valid request element and returns the response, which ``response``
    creates.

    Attributes:
        scope: The token scope that clients need to send messages.
    """

    scope: Scope

    def __init__(self, name: str, path: str, operations: dict[str, Operation]) -> None:
        self.path = path
        self.description = ServiceDescription(name, path)
        namespace = self.description.namespace
        self._operations = {f"{{{namespace}}}{name}": operation for name, operation in operations.items()}

    def post(self, request: Request) -> Response | Awaitable[Response]:
        """Return the response to a message: 200, or 500 with a fault (WS-I BP R1126).

        Raises:
            Problem: 415 for another media type; 400 for invalid XML, a DOCTYPE or a processing instruction. These
                responses have no fault, because there was no SOAP message.
        """
        media_type, charset = parsed_content_type(request.headers.get(b"content-type"))
        if media_type != _MEDIA_TYPE:
            raise Problem(
                415,
                f"a SOAP 1.1 message must be text/xml, not {media_type[:200]!a} (WS-I BP R1115)",
                ((b"accept", _MEDIA_TYPE.encode()),),
            )
        root = parsed(request.content(), charset)
        try:
            outcome = self._answer(root)
        except Exception as error:  # noqa: BLE001 - after any error the client gets a fault
            return _fault_response(root, error)
        return outcome if isinstance(outcome, Response) else await_response(outcome, partial(_fault_response, root))

    def response(self, operation: str, returned: Iterable[Any] = ()) -> Response:
        """Return the response of an operation: an envelope with one unqualified ``return`` element for each value."""
        namespace = self.description.namespace
        root = etree.Element(f"{{{SOAP}}}Envelope", nsmap={"soap": SOAP})
        wrapper = etree.SubElement(
            etree.SubElement(root, f"{{{SOAP}}}Body"), f"{{{namespace}}}{operation}Response", nsmap={"tns": namespace}
        )
        wrapper.extend([element_of(value, "return") for value in returned])
        return content(200, _MEDIA_TYPE, etree.tostring(root, encoding="utf-8", xml_declaration=True))

    def _answer(self, root: etree._Element) -> Response | Awaitable[Response]:
        element = operation_element(root)
        operation = self._operations.get(str(element.tag))
        if operation is None:
            raise client_fault(f"no operation has the request element {clip(element.tag)}")
        self.description.require_valid(element)
        return operation(element)


def _fault_response(root: etree._Element, error: Exception) -> Response:
    if isinstance(error, Problem):
        code = FaultCode.SERVER if error.status >= _SERVERS_FAULT else FaultCode.CLIENT
        error = Fault(code, error.detail, error.extensions)
    elif not isinstance(error, Fault):
        _LOGGER.error("cannot respond to %s", root.tag, exc_info=error)
        error = Fault(FaultCode.SERVER, "an internal error of the robot; the robot's log has the details")
    return content(500, _MEDIA_TYPE, error.envelope())


class ServiceDescription:
    """The WSDL and XSD of one service of the contract, ``publishers`` or ``subscribers``, at a path."""

    def __init__(self, name: str, path: str) -> None:
        self._path = path
        self._wsdl = etree.parse(CONTRACT_DIR / f"{name}.wsdl")
        self.xsd = (CONTRACT_DIR / f"{name}.xsd").read_bytes()
        document = etree.fromstring(self.xsd)
        self.namespace = str(document.get("targetNamespace"))
        self._schema = etree.XMLSchema(document)

    def wsdl(self, base: str) -> bytes:
        """Return the WSDL with the robot's address (WS-I BP R2001) and the location ``?xsd=1`` of its schema."""
        for address in self._wsdl.iter(f"{_WSDL_SOAP}address"):
            address.set("location", base + self._path)
        for schema in self._wsdl.iter(f"{_XSD}import"):
            schema.set("schemaLocation", f"{base}{self._path}?xsd=1")
        return etree.tostring(self._wsdl, encoding="utf-8", xml_declaration=True)

    def require_valid(self, element: etree._Element) -> None:
        """Raise a Client fault for an element that is invalid by the XSD (R2724)."""
        if not self._schema.validate(element):
            # libxml2's texts quote only names and values of the message, nothing internal to the robot.
            log: Any = self._schema.error_log
            errors = "; ".join(entry.message for entry in log[:_ERRORS_SHOWN])
            raise client_fault(f"{clip(element.tag)} is not valid by the XSD: {errors}")


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

"""The requests of a load test: the same calls as bytes for REST and for SOAP, built before the measurement.

Delivery is the paper's example (section on the delivery application) with random coordinates. There are 64 variants, so
that no cache between client and robot can respond in the robot's place.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from conformance.papers_robot.delivery import COFFEE, COORDINATES, COURIER, EXAMPLE, PATH_NAMES, XSD_FIELDS
from loadtests.clients.endpoint import Endpoint
from loadtests.clients.wire import Request

#: Interfaces that are compared: the two web services, and rosbridge.
INTERFACES = REST, SOAP, ROSBRIDGE = "rest", "soap", "rosbridge"
#: WIRE sends bytes made beforehand. LIBRARY sends by the library that people use: zeep for SOAP, requests for REST.
CLIENTS = WIRE, LIBRARY = "wire", "zeep"
VARIANTS = 64
NAMESPACE = "http://soap.turtlebot.mybot.org/"
ENVELOPE = "http://schemas.xmlsoap.org/soap/envelope/"

Values = dict[str, float]


@dataclass(frozen=True)
class Operation:
    """One operation, as each interface knows it.

    Attributes:
        element: the SOAP request's wrapper element.
        code: message code of a delivery; None for a read.
        service: which SOAP service has it, `publishers` or `subscribers`.
        method: the REST method.
        rest_expects, soap_expects: bytes that a good response contains.
    """

    element: str
    code: int | None
    service: str
    method: str
    rest_expects: bytes
    soap_expects: bytes


CATALOGUE = {
    "delivery": Operation(
        "ExecuteDeliveryRequest", COURIER, "publishers", "PUT", b"", b"ExecuteDeliveryRequestResponse"
    ),
    "coffee": Operation("ExecuteCoffeeRequest", COFFEE, "publishers", "PUT", b"", b"ExecuteCoffeeRequestResponse"),
    "pose": Operation("GetPose", None, "subscribers", "GET", b'"pose"', b"GetPoseResponse"),
}

#: The operations that make the robot drive.
MOVES = frozenset(name for name, each in CATALOGUE.items() if each.code is not None)


def variants(operation: str, seed: int) -> list[Values]:
    """Return the values of each variant; a read has none."""
    code = CATALOGUE[operation].code
    if code is None:
        return [{} for _ in range(VARIANTS)]
    rng = np.random.default_rng([seed, 5])
    return [
        {name: value + float(rng.uniform(-5, 5)) for name, value in EXAMPLE.items()} | {"message_code": code}
        for _ in range(VARIANTS)
    ]


def rest_path(values: Values) -> str:
    """Return the path of a resource below the base URL (Table 1 and the delivery application)."""
    if not values:
        return "/robot/pose/"
    places = "".join(f"/{name}/{values[field]!r}" for name, field in zip(PATH_NAMES, COORDINATES, strict=True))
    return f"/robot/app/delivery/{int(values['message_code'])}{places}"


def soap_envelope(operation: str, values: Values) -> bytes:
    """Return a SOAP 1.1 request, document/literal wrapped, whose wrapper contains the unqualified `arg0`."""
    texts = {field: repr(int(value) if field == "message_code" else value) for field, value in values.items()}
    inner = "".join(f"<{field}>{texts[field]}</{field}>" for field in XSD_FIELDS if field in texts)
    argument = f"<arg0>{inner}</arg0>" if values else ""
    element = CATALOGUE[operation].element
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><soap:Envelope xmlns:soap="{ENVELOPE}"><soap:Body>'
        f'<tns:{element} xmlns:tns="{NAMESPACE}">{argument}</tns:{element}></soap:Body></soap:Envelope>'
    ).encode()


def _authorization(token: str | None) -> str:
    return f"Authorization: Bearer {token}\r\n" if token else ""  # RFC 6750 section 2.1


def rest_request(endpoint: Endpoint, operation: str, values: Values, token: str | None) -> Request:
    """Return a REST request as bytes."""
    kind = CATALOGUE[operation]
    length = "Content-Length: 0\r\n" if kind.method == "PUT" else ""
    head = (
        f"{kind.method} {endpoint.path}{rest_path(values)} HTTP/1.1\r\nHost: {endpoint.authority}\r\n"
        f"Accept: application/json\r\n{_authorization(token)}{length}\r\n"
    )
    return Request(head.encode("ascii"), kind.rest_expects)


def soap_request(endpoint: Endpoint, operation: str, values: Values, token: str | None) -> Request:
    """Return a SOAP request as bytes."""
    body = soap_envelope(operation, values)
    head = (
        f"POST {endpoint.path} HTTP/1.1\r\nHost: {endpoint.authority}\r\nAccept: text/xml\r\n"
        f'Content-Type: text/xml; charset=utf-8\r\nSOAPAction: ""\r\n{_authorization(token)}'
        f"Content-Length: {len(body)}\r\n\r\n"
    )
    return Request(head.encode("ascii") + body, CATALOGUE[operation].soap_expects)


BUILDERS: dict[str, Callable[[Endpoint, str, Values, str | None], Request]] = {
    "rest": rest_request,
    "soap": soap_request,
}

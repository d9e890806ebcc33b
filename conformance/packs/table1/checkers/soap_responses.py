"""Judge every successful SOAP response of a run by the XSD, and whether its content is complete.

A response that is invalid now and then is found only if all are looked at.
"""

import itertools
from collections.abc import Iterable, Iterator, Mapping
from http import HTTPStatus
from typing import Any, Final

from lxml import etree

from conformance.api.soap.service import SoapService
from conformance.checkers.soap import SOAP_12
from conformance.documents.json_shape import Shape
from conformance.documents.representation import from_element
from conformance.documents.xml import ENVELOPE, NotXmlError, clark, elements, local, parse
from conformance.packs.table1.robot.agreement import entries_of
from conformance.packs.table1.robot.geometry import length_of
from conformance.packs.table1.robot.message_shapes import (
    GET_PLAN,
    GOAL_AND_STATUS,
    MESSAGE_TYPE,
    ODOMETRY,
    SENSORS,
    SERVICE_TYPE,
    SERVICES,
    TWIST,
)
from conformance.transport.exchange import Attempt, Exchange
from conformance.verdict.evidence import Case, case

_IDS: Final = {"publishers": "soap-delivery/response-valid", "subscribers": "soap-subscribers/response-valid"}
# _LARGE: longer plans are judged only by the check that requests them, bytes.
_LARGE: Final = 100_000
_SUFFIX: Final = "Response"
#: By operation: the requirement and the shape of its content.
_CONTENT: Final[Mapping[str, tuple[str, Shape]]] = {
    "GetPose": ("pose", ODOMETRY),
    "GetVelocity": ("velocity", TWIST),
    "GetGoal": ("goal", GOAL_AND_STATUS),
    "GetPlan": ("plan", GET_PLAN),
    "GetSensors": ("sensors", SENSORS),
    "GetNavigationServices": ("services", SERVICES),
}
_FULL_NAMES: Final = {"sensors": MESSAGE_TYPE, "services": SERVICE_TYPE}
_UNIT: Final = 1e-3


class SoapResponses:
    """Judges the SOAP responses of one run.

    Args:
        services: the robot's SOAP services.
    """

    def __init__(self, services: Iterable[SoapService]) -> None:
        self._services = {service.endpoint: service for service in services}

    def __call__(self, attempt: Attempt) -> Iterator[Case]:
        """Judge one exchange, if it is a successful call of these services."""
        service = self._services.get(attempt.request.url)
        if service is None or attempt.request.method != "POST" or not isinstance(attempt, Exchange):
            return
        exchange, response = attempt, attempt.response
        # Status 202 says that the response is sent elsewhere, as WS-Addressing allows.
        if response.ok and response.status != HTTPStatus.ACCEPTED and not response.body:
            yield case(_IDS[service.name], False, exchange, "a SOAP response", found="nothing")  # noqa: FBT003
        if not response.ok or response.media_type != "text/xml" or len(response.body) > _LARGE:
            return
        try:
            root = parse(response.body)
        except NotXmlError:
            return  # judged as what it is
        parts = [part for part in elements(root) if part.tag == clark(ENVELOPE, "Body")]
        inside = [child for part in parts for child in elements(part)]
        if SOAP_12 in exchange.request.body or (inside and local(str(inside[0].tag)) == "Fault"):
            return
        # Use the description that the checks have fetched; fetch nothing while an exchange is judged.
        described = [vars(service).get("described", service.contract), service.contract]
        tag = str(inside[0].tag) if inside else ""
        known = next((item for item in described if tag.endswith(_SUFFIX) and item.shape(tag) is not None), None)
        reason = f"{len(inside)} elements in the Body of {root.tag}" if len(inside) != 1 else f"the element {tag}"
        if len(inside) == 1 and known is not None:
            reason = known.types.invalid(inside[0])
        expected = f"{local(tag) or 'a response'} as the description says it is, alone in the Body of SOAP 1.1"
        yield case(_IDS[service.name], not reason, exchange, expected, found=reason, cause=reason)
        if len(inside) == 1 and known is not None:
            yield from _content(exchange, inside[0])


def _content(exchange: Exchange, wrapper: etree._Element) -> Iterator[Case]:
    """Judge that a reading operation returns everything in the contract; GetGoal may return nothing."""
    operation = local(str(wrapper.tag)).removesuffix(_SUFFIX)
    found = [child for child in elements(wrapper) if local(str(child.tag)) == "return"]
    if operation not in _CONTENT or (operation == "GetGoal" and not any(len(child) for child in found)):
        return
    name, shape = _CONTENT[operation]
    if name in _FULL_NAMES:
        problem = _list_problem([from_element(child, shape.schema["items"]) for child in found], shape, name)
    elif len(found) != 1:
        problem = f"{len(found)} return elements"
    else:
        value = from_element(found[0], shape.schema)
        problem = shape.problem(value)
        length = length_of(value["pose"]["pose"]["orientation"]) if name == "pose" and not problem else 1.0
        problem = problem or ("" if abs(length - 1) <= _UNIT else f"an orientation of length {length:g}")
    expected = f"complete content of {operation}Response"
    yield case(
        f"soap-subscribers/{name}", not problem, exchange, expected, found=problem, cause=problem.split(" is ")[0]
    )


def _list_problem(entries: list[Any], shape: Shape, name: str) -> str:
    """Return what is wrong with a list: an entry that is incomplete, double, or not named in full."""
    if problem := shape.problem(entries):
        return problem
    listed = entries_of(entries, tuple(shape.schema["items"]["properties"]))
    twice = next((one for one, two in itertools.pairwise(listed) if one == two), "")
    short = next((entry["type"] for entry in entries if _FULL_NAMES[name].problem(entry["type"])), "")
    return f"{twice} stands twice" if twice else f"type {short!r} is not named in full" if short else ""

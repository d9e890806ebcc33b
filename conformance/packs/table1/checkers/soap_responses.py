"""Judge every successful SOAP response of a run by the XSD, whether its content is complete, and every pose in them.

A response that is invalid now and then is found only if all are looked at.
"""

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping
from http import HTTPStatus
from typing import Any, Final

from lxml import etree

from conformance.api.soap.service import SoapService
from conformance.checkers.soap import SOAP_12
from conformance.documents.json_shape import Shape
from conformance.documents.representation import from_element, projected
from conformance.documents.xml import ENVELOPE, NotXmlError, clark, elements, local, parse
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
    read_as,
)
from conformance.packs.table1.robot.robot import POSE
from conformance.packs.table1.robot.state_read import contradiction, entries_of, stamp_of, value_in
from conformance.transport.exchange import Attempt, Exchange
from conformance.verdict.evidence import Case, case

_IDS: Final = {"publishers": "soap-delivery/response-valid", "subscribers": "soap-subscribers/response-valid"}
_LARGE: Final = 100_000  # longer plans are judged only by the check that requests them, bytes
_SUFFIX: Final = "Response"
#: The requirement and the shape of the content, for each operation.
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
    """Judges the SOAP responses of one run."""

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


# How far one of the robot's processes may lag behind another, s.
_BACK_S: Final = 1.0
# How often a clock must go back: a single time, somebody may have set it.
_SEVERAL: Final = 2


class SoapPoses:
    """Judges the poses over SOAP in all exchanges of one run.

    Their stamps do not run backwards, and a message between two equal ones over REST with its stamp is the same
    message.
    """

    def __init__(self, url: Callable[[str], str]) -> None:
        self._url = url(POSE)
        self._last: tuple[float, float] = (0.0, 0.0)
        self._last_received_s = 0.0
        self._backwards = 0
        self._before: Any = None
        self._between: list[tuple[Any, Exchange]] = []

    def __call__(self, attempt: Attempt) -> Iterator[Case]:
        """Take one exchange of the run; only poses count."""
        if not isinstance(attempt, Exchange):
            return
        request, response = attempt.request, attempt.response
        if request.method == "GET" and request.url == self._url and response.media_type == "application/json":
            yield from self._over_rest(attempt)
        elif request.method == "POST" and response.ok and b"GetPoseResponse" in response.body:
            value, problem = value_in(attempt, ODOMETRY)
            if not problem and not ODOMETRY.problem(value):
                yield from self._in_order(value, attempt)
                self._between.append((value, attempt))

    def _over_rest(self, exchange: Exchange) -> Iterator[Case]:
        value, problem = read_as(exchange.response, ODOMETRY)
        if problem:
            return
        after, between, self._between = projected(value, ODOMETRY.schema), self._between, []
        for message, one in between if self._before is not None else ():
            found = contradiction(message, self._before, after)
            yield case(
                "equivalence/pose",
                not found,
                one,
                f"the message with this stamp, as GET {POSE} returned it just before and after",
                found=found,
                cause="another message",
            )
        self._before = after

    def _in_order(self, message: Any, exchange: Exchange) -> Iterator[Case]:
        response, stamp = exchange.response, stamp_of(message)
        if response.received_s - response.elapsed_ms / 1000 >= self._last_received_s:
            back_s = self._last[0] - stamp[0] + (self._last[1] - stamp[1]) / 1e9
            self._backwards += back_s > _BACK_S
            yield case(
                "equivalence/pose",
                back_s <= _BACK_S or self._backwards < _SEVERAL,
                exchange,
                "stamps that do not run backwards, as in REST's responses",
                found=f"a stamp {back_s:.3f} s earlier than in the previous response; {self._backwards} times so far",
                cause="stamp",
            )
        self._last = stamp
        self._last_received_s = max(self._last_received_s, response.received_s)

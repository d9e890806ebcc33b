"""The delivery application's resources: the paper's PUT request, and the list of accepted deliveries."""

import re
from typing import Final
from urllib.parse import unquote_to_bytes

from conformance.papers_robot.delivery import PATH_NAMES
from reference_robot.deliveries import DeliveryRequest
from reference_robot.webservices.http.messages import Request, Response
from reference_robot.webservices.representation.problems import Problem, shown
from reference_robot.webservices.representation.reading import NUMBER
from reference_robot.webservices.resources.resource import NO_CONTENT, Resource, represented, wanted_format
from reference_robot.webservices.robot.deliveries import Deliveries, UnusableFieldError

# The path template's names of the values, in the order of the message's fields.
_NAMES: Final = ("code", *PATH_NAMES)
_PREFIX: Final = "/robot/app/delivery/"
_ANY: Final = re.compile((f"{_PREFIX}([^/]*)" + "".join(f"/{name}/([^/]*)" for name in PATH_NAMES)).encode())
_WELL_FORMED: Final = re.compile(
    (f"{_PREFIX}([+-]?[0-9]{{1,40}})" + "".join(f"/{name}/({NUMBER})" for name in PATH_NAMES)).encode()
)
_CODE: Final = re.compile(rb"[+-]?[0-9]{1,40}")
_NUMBER: Final = re.compile(NUMBER.encode())


class Delivery(Resource):
    """The resource whose PUT publishes one DeliveryRequestMsg; its path contains the message's values."""

    path = _PREFIX + "{code}" + "".join(f"/{name}/{{{name}}}" for name in PATH_NAMES)

    def __init__(self, deliveries: Deliveries) -> None:
        self._deliveries = deliveries

    @staticmethod
    def owns(path: bytes) -> bool:
        """Return whether a raw URL path has the form of a delivery path, whatever its values."""
        return _ANY.fullmatch(path) is not None

    def put(self, request: Request) -> Response:
        """Publish a delivery and return 204; raise the Problem 422 for an unknown code or an invalid number."""
        match = _WELL_FORMED.fullmatch(request.path)
        sent = _spelled_out(request.path) if match is None else match.groups()
        try:
            self._deliveries.accept(DeliveryRequest(int(sent[0]), *map(float, sent[1:])), "rest")
        except UnusableFieldError as error:
            place = DeliveryRequest._fields.index(error.field)
            raise error.refusal(_NAMES[place], _text(sent[place])) from error
        return NO_CONTENT


class DeliveryList(Resource):
    """The resource that lists the latest accepted deliveries with their states: an extension of the contract."""

    path = _PREFIX

    def __init__(self, deliveries: Deliveries) -> None:
        self._deliveries = deliveries

    def get(self, request: Request) -> Response:
        """Return the list of deliveries, newest first."""
        return represented(self._deliveries.listed(), "Deliveries", wanted_format(request))


def _spelled_out(path: bytes) -> tuple[bytes, ...]:
    """Return the percent-decoded values of a delivery path; raise the Problem 422 that names an invalid value."""
    match = _ANY.fullmatch(path)
    if match is None:
        raise Problem(404, "there is no resource at this delivery path")
    code, *coordinates = values = tuple(unquote_to_bytes(group) for group in match.groups())
    if not _CODE.fullmatch(code):
        raise Problem(422, f"code must be an integer, not {shown(_text(code))}")
    for name, value in zip(PATH_NAMES, coordinates, strict=True):
        if not _NUMBER.fullmatch(value):
            raise Problem(422, f"{name} must be a number, not {shown(_text(value))}")
    return values


def _text(value: bytes) -> str:
    return value.decode("utf-8", "replace")

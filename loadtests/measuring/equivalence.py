"""Compare the bytes sent and received over both interfaces: both must carry the same values. Sends no request."""

import json
import struct
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

from lxml import etree

from conformance.documents.xml import parse
from conformance.papers_robot.delivery import COORDINATES, XSD_FIELDS
from loadtests.clients.payloads import CATALOGUE, NAMESPACE, Values
from loadtests.clients.wire import Request

#: Leaves of nav_msgs/Odometry that both interfaces' responses must contain, equally often.
_ODOMETRY = ("frame_id", "child_frame_id", "x", "y", "z", "w", "covariance", "sec")


def request_difference(operation: str, rest: Request, soap: Request) -> str | None:
    """Return how two requests, read back from their bytes, differ; None if they are equivalent.

    Doubles are compared bit for bit, each read back from its own text.
    """
    if CATALOGUE[operation].code is None:
        return None
    parts = rest.octets.split(b" ", 2)[1].decode().rsplit("/robot/app/delivery/", 1)[1].split("/")
    over_rest = {field: float(parts[2 * index + 2]) for index, field in enumerate(COORDINATES)}
    over_rest["message_code"] = int(parts[0])
    argument = parse(soap.octets.split(b"\r\n\r\n", 1)[1]).find(".//arg0")
    if argument is None:
        return "the SOAP request carries no arg0"
    over_soap = {child.tag: float(child.text or "nan") for child in argument}
    for name in XSD_FIELDS:
        if not _same_double(over_rest[name], over_soap.get(name, float("nan"))):
            return f"{name} is {over_rest[name]!r} over REST and {over_soap.get(name)!r} over SOAP"
    return None


def requests_difference(operation: str, rest: Sequence[Request], soap: Sequence[Request]) -> str | None:
    """Return the first variant in which the two interfaces' requests differ; None if none does."""
    if not rest or not soap:
        return None
    for number, (over_rest, over_soap) in enumerate(zip(rest, soap, strict=True)):
        difference = request_difference(operation, over_rest, over_soap)
        if difference:
            return f"{operation}, variant {number}: {difference}"
    return None


def pose_difference(rest: bytes, soap: bytes) -> str | None:
    """Return how two poses differ, or None if both are complete Odometry messages.

    A shorter message would have an advantage in the comparison.
    """
    try:
        over_rest = Counter(_json_leaves(json.loads(rest)))
        found = parse(soap).find(f".//{{{NAMESPACE}}}GetPoseResponse")
    except ValueError as error:
        return f"pose: a response cannot be read: {error}"
    over_soap = Counter(_xml_leaves(found)) if found is not None else Counter()
    for leaf in _ODOMETRY:
        if over_rest[leaf] != over_soap[leaf]:
            return f"pose: {over_rest[leaf]} values of {leaf!r} over REST and {over_soap[leaf]} over SOAP"
    return None


def values_difference(rest: bytes, soap: bytes) -> str | None:
    """Return how many values two responses have if not equally many; None if they have, or if one cannot be counted."""
    try:
        over_rest = sum(1 for _ in _json_leaves(json.loads(rest)))
        body = parse(soap).find("{*}Body")
    except ValueError:
        return None
    leaves = () if body is None else (each for each in body.iter() if isinstance(each.tag, str))
    over_soap = sum(len(each.attrib) + (0 if len(each) else _values_in(each.text or "")) for each in leaves)
    return None if over_rest == over_soap else f"{over_rest} values over REST and {over_soap} over SOAP"


def _values_in(text: str) -> int:
    """Return how many values a text is: numbers in a row are a list (xs:list), anything else is one."""
    words = text.split()
    try:
        return len([float(word) for word in words])
    except ValueError:
        return 1


def deliveries_missing(listed: list[Any], operation: str, sent: Values) -> list[str]:
    """Return the deliveries that were sent and are missing from the robot's list of accepted requests."""
    return [
        f"{operation}: the robot does not list the request that was sent over {interface}"
        for interface in ("rest", "soap")
        if not any(
            isinstance(entry, dict) and entry.get("interface") == interface and _is_request(entry.get("request"), sent)
            for entry in listed
        )
    ]


def _json_leaves(value: Any, name: str = "") -> Iterator[str]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _json_leaves(inner, key)
    elif isinstance(value, list):
        for inner in value:
            yield from _json_leaves(inner, name)
    else:
        yield name


def _xml_leaves(element: Any) -> Iterator[str]:
    name = etree.QName(element).localname
    children = [child for child in element if isinstance(child.tag, str)]
    if not children:
        words = (element.text or "").split() if name == "covariance" else [""]
        yield from [name] * max(1, len(words))
    for child in children:
        # An array may be a repeated element, or items inside one: either way its items bear its name.
        inner = list(_xml_leaves(child))
        yield from [name if name == "covariance" else leaf for leaf in inner]


def _is_request(listed: Any, sent: Values) -> bool:
    try:
        return all(_same_double(float(listed[field]), sent[field]) for field in XSD_FIELDS)
    except (KeyError, TypeError, ValueError):
        return False


def _same_double(one: float, other: float) -> bool:
    return struct.pack("<d", one) == struct.pack("<d", other)

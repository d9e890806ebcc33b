"""Commands as XML, in the form in which the robot sends its own state (contract.md#formats)."""

from collections.abc import Callable, Mapping
from typing import Any

from conformance.api.rest.calls import JSON, XML
from conformance.documents.representation import UnreadableError, local_name, parse_xml
from conformance.documents.writing import xml_bytes
from conformance.packs.table1.robot.robot import Robot
from conformance.transport.exchange import Exchange


def put_as_xml(
    robot: Robot,
    path: str,
    value: Mapping[str, Any],
    *,
    accept: str = JSON,
    before: Callable[[], object] = lambda: None,
) -> Exchange | None:
    """PUT a value as XML; return None if the robot sends no XML for that resource.

    Args:
        robot: the robot.
        path: path of the resource.
        value: the value, as JSON would have it.
        accept: media type of the response.
        before: called just before the PUT.

    Raises:
        NoAnswerError: there is no response.
    """
    answer = robot.rest.send("GET", path, headers=(("Accept", XML),)).response
    if not answer.ok or answer.media_type != XML:
        return None
    try:
        form = parse_xml(answer.body)
    except UnreadableError:
        return None
    body = xml_bytes(value, local_name(form), form)
    before()
    return robot.rest.send("PUT", path, headers=(("Content-Type", XML), ("Accept", accept)), body=body)

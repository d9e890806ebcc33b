"""Velocities as XML, in the form in which the robot sends its own (contract.md#formats)."""

from conformance.api.rest.calls import XML
from conformance.documents.representation import UnreadableError, local_name, parse_xml
from conformance.documents.writing import xml_bytes
from conformance.packs.table1.robot.robot import ACCEPT_JSON, VELOCITY, Robot, Velocity
from conformance.transport.exchange import Exchange


def put_velocity_as_xml(robot: Robot, velocity: Velocity) -> Exchange | None:
    """PUT a velocity as XML; return None where the robot sends its own velocity in no XML.

    Raises:
        NoAnswerError: there is no response.
    """
    answer = robot.rest.send("GET", VELOCITY, headers=(("Accept", XML),)).response
    if not answer.ok or answer.media_type != XML:
        return None
    try:
        form = parse_xml(answer.body)
    except UnreadableError:
        return None
    body = xml_bytes(velocity.twist, local_name(form), form)
    return robot.rest.send("PUT", VELOCITY, headers=(("Content-Type", XML), *ACCEPT_JSON), body=body)

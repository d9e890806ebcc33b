"""The motion map of the paper's robot, from its statement: how the generic suite drives it.

The map has velocities and no positions. Where the robot has room, and which velocities it can drive at once, the pack
knows by plans and by abilities.drivable().
"""

from collections.abc import Mapping
from typing import Any, Final, Literal

import msgspec

from conformance.api.rest.calls import XML
from conformance.documents.representation import local_name, parse_xml
from conformance.packs.table1.limits import Limits
from conformance.packs.table1.robot.robot import LINEAR, POSE, STILL, VELOCITY, Robot, Velocity, can_move, put_as_xml
from conformance.packs.table1.statement import Statement
from conformance.statement.motion_map import MotionMap, Way

#: How the last velocity is commanded: both parts, the linear part alone, as XML, or on a connection that is then
#: closed.
By = Literal["velocity", "linear", "xml", "closing"]
#: A noun phrase in messages for each way to command the robot.
COMMANDS: Final[dict[By, str]] = {
    "velocity": "a PUT of the velocity",
    "linear": "a PUT of its linear part",
    "xml": "a PUT of the velocity as XML",
    "closing": "a PUT of the velocity whose connection was closed",
}
#: The components of a Velocity by their names in the map.
NAMES: Final = ("ahead", "aside", "up", "roll", "pitch", "turn")
# A robot that only drives back has a greatest velocity of 0, which no map has.
_LEAST_LIMIT: Final = 1e-9


def motion_map_of(statement: Statement, xml_root: str = "") -> MotionMap:
    """Return the motion map of a robot.

    Args:
        statement: what its vendor says of it.
        xml_root: the root element of its velocity as XML; empty if it takes no XML.
    """
    limits = statement.limits
    there = [component for component in range(len(NAMES)) if can_move(statement.motion, component)]
    twist: dict[str, Any] = {part: dict.fromkeys("xyz", 0.0) for part in ("linear", "angular")}
    for component in there:
        twist[_part(component)]["xyz"[component % 3]] = f"{{{NAMES[component]}}}"
    ways = [{"send": f"PUT {LINEAR}", "body": twist["linear"]}] if there and there[0] < len("xyz") else []
    if xml_root:
        ways.append({"send": f"PUT {VELOCITY}", "body": twist, "media_type": XML, "root": xml_root})
    velocity = {
        "send": f"PUT {VELOCITY}",
        "body": twist,
        "tolerance": _tolerance(limits, 0),
        "settle_s": limits.settle_s,
        "hold_s": limits.hold_s,
        "beyond_limits": "refused" if limits.linear_declared and limits.angular_declared else "undefined",
        "axes": {NAMES[component]: _axis(limits, component) for component in there},
        "ways": ways,
    }
    state = {"read": f"GET {POSE}", "stamp": "/header/stamp", "axes": {}}
    return msgspec.convert({"state": state, "velocity": velocity}, MotionMap)


def way_of(motion: MotionMap, by: By) -> tuple[Way | None, ...]:
    """Return in which ways of the map a velocity is commanded in turn, the last one by ``by``; empty means as usual."""
    ways = motion.velocity.ways if motion.velocity else ()
    found = next((way for way in ways if bool(way.root) == (by == "xml")), None)
    if by not in {"linear", "xml"} or found is None:
        return ()
    return (found,) if found.root else (None, found)


def speeds_of(velocity: Velocity) -> dict[str, float]:
    """Return the components of a velocity that are not 0, by their names in the map."""
    return {name: speed for name, speed in zip(NAMES, velocity, strict=True) if speed}


def velocity_of(speeds: Mapping[str, float]) -> Velocity:
    """Return the velocity whose components have these names in the map."""
    return Velocity(*(speeds.get(name, 0.0) for name in NAMES))


def xml_root_of(robot: Robot) -> str:
    """Return the root element of a velocity as XML; empty if the robot at rest does not take velocity 0 as XML."""
    exchange = put_as_xml(robot, VELOCITY, STILL.twist)
    return local_name(parse_xml(exchange.request.body)) if exchange is not None and exchange.response.ok else ""


def _axis(limits: Limits, component: int) -> dict[str, Any]:
    least, greatest = limits.range_of(component)
    return {
        "at": f"/twist/twist/{_part(component)}/{'xyz'[component % 3]}",
        "limits": (least, max(greatest, _LEAST_LIMIT)),
        "tolerance": _tolerance(limits, component),
        "noise": limits.noise.linear_m_s if component < len("xyz") else limits.noise.angular_rad_s,
        "rest": limits.rest(component) or None,
    }


def _part(component: int) -> str:
    return "linear" if component < len("xyz") else "angular"


def _tolerance(limits: Limits, component: int) -> float:
    """Return how far a component may be off at its limit, m/s or rad/s."""
    far = limits.rest(component, sigmas=2) + limits.tolerance * max(map(abs, limits.range_of(component)))
    return max(far, _LEAST_LIMIT)

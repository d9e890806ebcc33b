"""The paper's robot as any device that moves: its motion map, by what its statement declares."""

from typing import Any, Final

import msgspec

from conformance.packs.table1.limits import Limits
from conformance.packs.table1.statement import Statement
from conformance.statement.motion_map import MotionMap

_POSE, _VELOCITY, _GOAL = "/robot/pose/", "/robot/velocity/", "/robot/navigation/action/goal/"
_LINEAR = "/robot/velocity/linear/"
# How far from straight ahead a heading is, as a target: half a turn would be reached either way, rad.
_TURNED = 3.0
# Components by their names in the map: the part and the axis of a Twist, and the index into a Velocity.
_COMPONENTS: Final = {"ahead": ("linear", "x", 0), "aside": ("linear", "y", 1), "turn": ("angular", "z", 5)}
# Beside the way to a goal a robot turns towards it, and turns again at its end, s.
_TURNS_S: Final = 5.0
# So many times its navigation takes for a way what its greatest speed would.
_SLOWER: Final = 3.0


def motion_map_of(statement: Statement, area: tuple[float, float, float, float]) -> MotionMap:
    """Return the motion map of a robot.

    Args:
        statement: what its vendor says of it.
        area: (x_min, y_min, x_max, y_max) where it may drive, in the frame of the odometry, m.
    """
    limits, motion = statement.limits, statement.motion
    # One that turns in circles takes no turn alone, and a map has no axes that depend on each other.
    names = [
        name
        for name, (part, axis, _) in _COMPONENTS.items()
        if f"{part}.{axis}" in motion.actuated and (name != "turn" or motion.turns_on_the_spot)
    ]
    twist = {name: "/{}/{}".format(*_COMPONENTS[name]) for name in names}
    zeros: dict[str, Any] = {part: dict.fromkeys("xyz", 0.0) for part in ("linear", "angular")}
    for name in names:
        part, axis, _ = _COMPONENTS[name]
        zeros[part][axis] = f"{{{name}}}"
    heading = {"at": "/pose/pose/orientation", "angle": "yaw", "unit": "rad", "limits": (-_TURNED, _TURNED)}
    turns = {"heading": heading | {"tolerance": round(limits.arrival[1], 4)}}
    orientation = {"x": 0.0, "y": 0.0, "z": "{heading:/z}", "w": "{heading:/w}"}
    if not motion.turns_on_the_spot:
        turns, orientation = {}, {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    pose = {"position": {"x": "{x}", "y": "{y}", "z": 0.0}, "orientation": orientation}
    ways = [{"send": f"PUT {_VELOCITY}", "body": zeros, "media_type": "application/xml", "root": "Twist"}]
    if set(names) & {"ahead", "aside"}:
        ways.insert(0, {"send": f"PUT {_LINEAR}", "body": zeros["linear"]})
    way = area[2] - area[0] + area[3] - area[1]
    declared = limits.linear_declared and limits.angular_declared
    arrives_m = round(limits.arrival[0], 4)
    goto = {
        "send": f"PUT {_GOAL}",
        "body": {"goal": {"target_pose": {"header": {"frame_id": motion.frame}, "pose": pose}}},
        "tolerance": arrives_m,
        "while_moving": "displaces",
        "within_s": round(_TURNS_S + _SLOWER * way / limits.navigation_m_s, 1),
        "settle_s": limits.settle_s,
    }
    # A map has one frame: goals in another one than the odometry's are not described.
    same_frame = not any(motion.odom_to_map)
    written = {
        "state": {
            "read": f"GET {_POSE}",
            "stamp": "/header/stamp",
            "agrees": {f"GET {_VELOCITY}": twist},
            "axes": {
                axis: {"at": f"/pose/pose/position/{axis}", "unit": "m", "limits": side, "tolerance": arrives_m}
                for axis, side in (("x", area[::2]), ("y", area[1::2]))
            }
            | turns,
        },
        "goto": goto if same_frame else None,
        "stop": {"send": f"DELETE {_GOAL}", "rests_within_s": limits.settle_s} if same_frame else None,
        "velocity": {
            "send": f"PUT {_VELOCITY}",
            "body": zeros,
            "tolerance": _tolerance(limits, 0),
            "settle_s": limits.settle_s,
            "hold_s": limits.hold_s,
            "beyond_limits": "refused" if declared else "undefined",
            "axes": {
                name: {
                    "at": f"/twist/twist{pointer}",
                    "limits": limits.range_of(_COMPONENTS[name][2]),
                    "tolerance": _tolerance(limits, _COMPONENTS[name][2]),
                }
                for name, pointer in twist.items()
            },
            "ways": ways,
        },
    }
    return msgspec.convert(written, MotionMap)


def _tolerance(limits: Limits, component: int) -> float:
    """Return how far a component may be off at its limit, m/s or rad/s."""
    linear = component < len("xyz")
    absolute = limits.tolerance_linear_m_s if linear else limits.tolerance_angular_rad_s
    noise = limits.noise.linear_m_s if linear else limits.noise.angular_rad_s
    return round(absolute + limits.tolerance * max(map(abs, limits.range_of(component))) + 2 * noise, 4)

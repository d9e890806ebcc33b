"""Names of the robot's topics, services, actions and frames, read from one TOML file.

Both the simulation and the web services bind to a ``RosNames``, so that a robot with other names is
served by another file and no code.
"""

import tomllib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final, TypeVar

DEFAULT_NAMES_FILE: Final = Path(__file__).with_name("names.toml")
VELOCITY_MESSAGES: Final = ("auto", "Twist", "TwistStamped")
_READ_ELSEWHERE: Final = frozenset({"web"})  # the web services' own table, which they read and check


class NamesError(ValueError):
    """A names file cannot be used; the message names the file, the key and the offending value."""


@dataclass(frozen=True)
class Topics:
    """Topic names, relative to the robot's namespace unless they begin with a slash."""

    odom: str = "odom"
    scan: str = "scan"
    imu: str = "imu"
    battery: str = "battery_state"
    cmd_vel: str = "cmd_vel"
    delivery: str = "/DeliveryRequestMsg/from_json"
    missions: str = "delivery/missions"
    current_goal: str = "navigation/current_goal"
    last_rejection: str = "navigation/last_rejection"


@dataclass(frozen=True)
class Services:
    """Service names."""

    get_plan: str = "get_plan"


@dataclass(frozen=True)
class Actions:
    """Action names."""

    navigate_to_pose: str = "navigate_to_pose"
    compute_path_to_pose: str = "compute_path_to_pose"


@dataclass(frozen=True)
class Frames:
    """Frame ids as they stand in message headers."""

    map: str = "map"
    odom: str = "odom"
    base: str = "base_link"


@dataclass(frozen=True)
class Velocity:
    """Which message type carries velocity commands: one of ``VELOCITY_MESSAGES``."""

    message: str = "auto"


@dataclass(frozen=True)
class RosNames:
    """Everything by which the rooms of the robot find each other on the ROS graph."""

    topics: Topics = Topics()
    services: Services = Services()
    actions: Actions = Actions()
    frames: Frames = Frames()
    velocity: Velocity = Velocity()


_Table = TypeVar("_Table", Topics, Services, Actions, Frames, Velocity)


def load_names(path: Path | None = None) -> RosNames:
    """Read names from a TOML file; keys that it leaves out keep their defaults.

    Args:
        path: The file, or None for the names that come with the robot.

    Raises:
        NamesError: The file cannot be read, is no TOML, or has an unknown or unusable key.
    """
    source = path or DEFAULT_NAMES_FILE
    try:
        document = tomllib.loads(source.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise NamesError(f"cannot read the names file {source}: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise NamesError(f"{source} is no TOML: {error}") from error
    known = [field.name for field in fields(RosNames)]
    unknown = sorted(set(document) - set(known) - _READ_ELSEWHERE)
    if unknown:
        raise NamesError(f"{source}: unknown table or key {unknown[0]}; known are {', '.join(known)}")
    return RosNames(
        topics=_table(source, "topics", document, Topics),
        services=_table(source, "services", document, Services),
        actions=_table(source, "actions", document, Actions),
        frames=_table(source, "frames", document, Frames),
        velocity=_table(source, "velocity", document, Velocity),
    )


def _table(source: Path, name: str, document: dict[str, Any], kind: type[_Table]) -> _Table:
    entries = document.get(name, {})
    if not isinstance(entries, dict):
        raise NamesError(f"{source}: {name} must be a table, not {entries!r}")
    known = [field.name for field in fields(kind)]
    for key, value in entries.items():
        if key not in known:
            raise NamesError(f"{source}: unknown key {name}.{key}; known are {', '.join(known)}")
        if not isinstance(value, str) or not value.strip():
            raise NamesError(f"{source}: {name}.{key} must be a non-empty string, not {value!r}")
        if kind is Velocity and value not in VELOCITY_MESSAGES:
            allowed = ", ".join(VELOCITY_MESSAGES)
            raise NamesError(f"{source}: {name}.{key} must be one of {allowed}, not {value!r}")
    return kind(**entries)

"""Names of the robot's topics, services, actions and frames, read from one TOML file.

Both the simulation and the web services bind to a ``RosNames``, so that a robot with other names is
served by another file and no code.
"""

from pathlib import Path
from typing import Final, Literal

import msgspec

from conformance.contract.toml_file import Text, fit, read_tables

DEFAULT_NAMES_FILE: Final = Path(__file__).with_name("names.toml")


class Topics(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Topic names, relative to the robot's namespace unless they begin with a slash."""

    odom: Text = "odom"
    scan: Text = "scan"
    imu: Text = "imu"
    battery: Text = "battery_state"
    cmd_vel: Text = "cmd_vel"
    map: Text = "map"
    tf: Text = "/tf"
    tf_static: Text = "/tf_static"
    delivery: Text = "/DeliveryRequestMsg/from_json"
    missions: Text = "delivery/missions"
    current_goal: Text = "navigation/current_goal"
    last_rejection: Text = "navigation/last_rejection"


class Services(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Service names."""

    get_plan: Text = "get_plan"


class Actions(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Action names."""

    navigate_to_pose: Text = "navigate_to_pose"
    compute_path_to_pose: Text = "compute_path_to_pose"


class Nodes(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Names of nodes that have a lifecycle."""

    navigator: Text = "bt_navigator"
    planner: Text = "planner_server"


class Frames(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Frame ids as they stand in message headers."""

    map: Text = "map"
    odom: Text = "odom"
    base: Text = "base_link"


class Velocity(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Which message type carries velocity commands."""

    message: Literal["auto", "Twist", "TwistStamped"] = "auto"


class RosNames(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Everything by which the rooms of the robot find each other on the ROS graph."""

    topics: Topics = Topics()
    services: Services = Services()
    actions: Actions = Actions()
    nodes: Nodes = Nodes()
    frames: Frames = Frames()
    velocity: Velocity = Velocity()


def load_names(path: Path | None = None) -> RosNames:
    """Read names from a TOML file; keys that it leaves out keep their defaults.

    Raises:
        TomlFileError: The file cannot be read, is no TOML, or has an unknown or unusable key.
    """
    source = path or DEFAULT_NAMES_FILE
    tables = read_tables(source)
    tables.pop("web", None)  # the web services' own, which they read and check
    return fit(tables, RosNames, str(source))

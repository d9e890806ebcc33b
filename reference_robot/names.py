"""The names of the robot's topics, services, actions and frames, read from a TOML file.

The simulation and the web services both use these names. A robot with other names needs another file, not other code.
"""

from pathlib import Path
from typing import Final, Literal

import msgspec

from conformance.contract.toml_file import Text, fit, read_tables

DEFAULT_NAMES_FILE: Final = Path(__file__).with_name("names.toml")


class Topics(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Names of the robot's topics, relative to the robot's namespace unless they begin with a slash."""

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
    """Names of the robot's ROS services."""

    get_plan: Text = "get_plan"


class Actions(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Names of the robot's ROS actions."""

    navigate_to_pose: Text = "navigate_to_pose"
    compute_path_to_pose: Text = "compute_path_to_pose"


class Nodes(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Names of the navigation's lifecycle nodes."""

    navigator: Text = "bt_navigator"
    planner: Text = "planner_server"


class Frames(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Ids of the robot's coordinate frames, as they occur in message headers."""

    map: Text = "map"
    odom: Text = "odom"
    base: Text = "base_link"


class Velocity(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The message type of velocity commands; ``auto`` uses the type that the robot subscribes to."""

    message: Literal["auto", "Twist", "TwistStamped"] = "auto"


class RosNames(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All names by which the simulation and the web services find each other on the ROS graph."""

    topics: Topics = Topics()
    services: Services = Services()
    actions: Actions = Actions()
    nodes: Nodes = Nodes()
    frames: Frames = Frames()
    velocity: Velocity = Velocity()


def load_names(path: Path | None = None) -> RosNames:
    """Return the ROS names from a TOML file; keys that are missing in the file keep their defaults.

    Raises:
        TomlFileError: The file cannot be read, is not TOML, or has an unknown key or an invalid value.
    """
    source = path or DEFAULT_NAMES_FILE
    tables = read_tables(source)
    tables.pop("web", None)  # read and checked by the web services
    return fit(tables, RosNames, str(source))

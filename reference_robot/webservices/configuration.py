"""The one TOML file of the robot: names on the ROS graph, and what the web services need to know besides."""

from pathlib import Path

import msgspec

from conformance.contract.toml_file import Positive, read_toml
from reference_robot.names import DEFAULT_NAMES_FILE, RosNames


class WebSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table ``[web]``: the robot's declared figures and the deadlines of the web services.

    Attributes:
        max_linear: Largest magnitude of linear.x that a PUT may ask for, m/s.
        max_angular: Largest magnitude of angular.z, rad/s.
        hold: How long the robot keeps a velocity that is not renewed, s (its own watchdog enforces it).
        settle: Within what time a new velocity is reached, s; declared, not enforced.
        deadline: How long to wait for an answer from ROS, s.
        read_deadline: How long a client may take to send one request, s.
    """

    max_linear: Positive = 0.7
    max_angular: Positive = 2.5
    hold: Positive = 1.0
    settle: Positive = 0.6
    deadline: Positive = 5.0
    read_deadline: Positive = 10.0


class Configuration(RosNames, frozen=True, forbid_unknown_fields=True):
    """Everything that a file may say."""

    web: WebSettings = WebSettings()


def load_configuration(path: Path | None) -> Configuration:
    """Read a configuration: the tables of ``names.toml`` and ``[web]``; what it leaves out keeps its default.

    Raises:
        TomlFileError: The file cannot be read, is no TOML, or has an unknown or unusable key.
    """
    return read_toml(path or DEFAULT_NAMES_FILE, Configuration)

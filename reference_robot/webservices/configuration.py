"""The configuration file of the robot (TOML): names on the ROS graph, and settings of the web services."""

from pathlib import Path
from typing import Annotated

import msgspec

from conformance.contract.toml_file import NotNegative, Positive, read_toml
from reference_robot.names import DEFAULT_NAMES_FILE, RosNames


class WebSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table ``[web]``: the robot's limits and the deadlines of the web services.

    Attributes:
        max_linear: Largest magnitude of linear.x in a PUT request, m/s.
        max_angular: Largest magnitude of angular.z in a PUT request, rad/s.
        max_reverse: Largest magnitude of a negative linear.x, m/s; None for ``max_linear``.
        max_lateral: Largest magnitude of linear.y, m/s; 0 for a robot that cannot move aside.
        min_radius: Narrowest circle that the robot can drive, m; 0 for a robot that turns on the spot.
        hold: How long the robot keeps a velocity that is not renewed, s (its own watchdog enforces it).
        settle: Within what time a new velocity is reached, s; declared, not enforced.
        deadline: How long to wait for a response from ROS, s.
        read_deadline: How long a client may take to send one request, s.
        token_deadline: Where tokens are required: how long a client without a valid token may take for each of these:
            the TLS handshake, to send one request, to begin the next one, s.
        connections_per_address: How many connections each interface accepts from one address; None for seven eighths of
            all. Connections from a trusted proxy do not count.
        lag: How much later each request is answered, s, as by a robot that has other things to do.
    """

    max_linear: Positive = 0.7
    max_angular: Positive = 2.5
    max_reverse: NotNegative | None = None
    max_lateral: NotNegative = 0.0
    min_radius: NotNegative = 0.0
    hold: Positive = 1.0
    settle: Positive = 0.6
    deadline: Positive = 5.0
    read_deadline: Positive = 10.0
    token_deadline: Positive = 5.0
    connections_per_address: Annotated[int, msgspec.Meta(ge=1)] | None = None
    lag: NotNegative = 0.0


class Configuration(RosNames, frozen=True, forbid_unknown_fields=True):
    """All tables of the configuration file."""

    web: WebSettings = WebSettings()


def load_configuration(path: Path | None) -> Configuration:
    """Return the configuration from a file; keys that are missing in the file keep their defaults.

    The file has the tables of ``names.toml`` and ``[web]``.

    Raises:
        TomlFileError: The file cannot be read, is not TOML, or has an unknown key or an invalid value.
    """
    return read_toml(path or DEFAULT_NAMES_FILE, Configuration)

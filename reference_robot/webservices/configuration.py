"""The one TOML file of the robot: names on the ROS graph, and what the web services need to know besides."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from reference_robot.names import RosNames, load_names

if TYPE_CHECKING:
    from pathlib import Path


class ConfigurationError(ValueError):
    """The file cannot be used; the message names the file, the key and the offending value."""


@dataclass(frozen=True)
class WebSettings:
    """The table ``[web]``: the robot's declared figures and the deadlines of the web services.

    Attributes:
        max_linear: Largest magnitude of linear.x that a PUT may ask for, m/s.
        max_angular: Largest magnitude of angular.z, rad/s.
        hold: How long the robot keeps a velocity that is not renewed, s (its own watchdog enforces it).
        settle: Within what time a new velocity is reached, s; declared, not enforced.
        deadline: How long to wait for an answer from ROS, s.
        read_deadline: How long a client may take to send one request, s.
    """

    max_linear: float = 0.7
    max_angular: float = 2.5
    hold: float = 1.0
    settle: float = 0.6
    deadline: float = 5.0
    read_deadline: float = 10.0


@dataclass(frozen=True)
class Configuration:
    """Everything that a file may say."""

    names: RosNames
    web: WebSettings


def load_configuration(path: Path | None) -> Configuration:
    """Read a configuration; what it leaves out keeps its default.

    Args:
        path: A TOML file with the tables of ``names.toml`` and the table ``[web]``; None for all defaults.

    Raises:
        ConfigurationError: ``[web]`` has an unknown or unusable key.
        reference_robot.names.NamesError: The file cannot be read, is no TOML, or another table is wrong.
    """
    names = load_names(path)
    web: Any = {} if path is None else tomllib.loads(path.read_text(encoding="utf-8")).get("web", {})
    if not isinstance(web, dict):
        raise ConfigurationError(f"{path}: web must be a table, not {web!r}")
    known = [field.name for field in fields(WebSettings)]
    for key, value in web.items():
        if key not in known:
            raise ConfigurationError(f"{path}: unknown key web.{key}; known are {', '.join(known)}")
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not (number and math.isfinite(value) and value > 0):
            raise ConfigurationError(f"{path}: web.{key} must be a positive number, not {value!r}")
    return Configuration(names, WebSettings(**{key: float(value) for key, value in web.items()}))

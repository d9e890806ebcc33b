"""The implementation conformance statement: what a vendor says of a robot, and what it is then judged by."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import msgspec

from conformance.contract.classes import CLASSES, PROFILES, ConformanceClass, Profile
from conformance.contract.interfaces import EVERY, NEEDS, Interface
from conformance.contract.limits import DeclaredLimits, Limits
from conformance.contract.thresholds import Threshold
from conformance.contract.toml_file import Finite, NotNegative, Positive, Text, TomlFileError, read_toml

if TYPE_CHECKING:
    from collections.abc import Collection
    from pathlib import Path

Component = Literal["linear.x", "linear.y", "linear.z", "angular.x", "angular.y", "angular.z"]


class StatementError(TomlFileError):
    """A statement that cannot be used; the message names the file, the key and the offending value."""


class Endpoints(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where a robot's interfaces are.

    Attributes:
        rest: base URL.
        publishers_wsdl: URL or file; likewise subscribers_wsdl.
        publishers_endpoint: where the service is, when its WSDL does not say so; likewise subscribers_endpoint.
        ca_file: certificate authorities to trust.
        token_file: holds the bearer token.
        request_rate: ceiling in requests per second.
        timeout_s: deadline of one request, s.
    """

    rest: Text | None = None
    publishers_wsdl: Text | None = None
    subscribers_wsdl: Text | None = None
    publishers_endpoint: Text | None = None
    subscribers_endpoint: Text | None = None
    ca_file: Text | None = None
    token_file: Text | None = None
    request_rate: Positive | None = None
    timeout_s: Positive = 10.0

    @property
    def publishers(self) -> bool:
        """Whether there is a word on where the publishers service is."""
        return bool(self.publishers_wsdl or self.publishers_endpoint)

    @property
    def subscribers(self) -> bool:
        """Whether there is a word on where the subscribers service is."""
        return bool(self.subscribers_wsdl or self.subscribers_endpoint)

    @property
    def interfaces(self) -> tuple[Interface, ...]:
        """The interfaces that have an address."""
        there = {
            Interface.REST: bool(self.rest),
            Interface.PUBLISHERS: self.publishers,
            Interface.SUBSCRIBERS: self.subscribers,
        }
        return tuple(name for name, known in there.items() if known)


class Motion(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where a robot may be driven.

    Attributes:
        arena: (x_min, y_min, x_max, y_max) in the frame of goals, m; None: stay near where the robot is.
        frame: frame of goals and plans.
        radius_m: how far from where it is a goal may be, when there is no arena.
        goals: poses (x, y, yaw) that can be reached; empty: found by asking for plans.
        odom_to_map: (x, y, yaw) of the odometry frame in the frame of goals.
        actuated: the velocity components that the robot can actuate.
    """

    arena: tuple[Finite, Finite, Finite, Finite] | None = None
    frame: Text = "map"
    radius_m: NotNegative = 1.0
    goals: tuple[tuple[Finite, Finite, Finite], ...] = ()
    odom_to_map: tuple[Finite, Finite, Finite] = (0.0, 0.0, 0.0)
    actuated: tuple[Component, ...] = ("linear.x", "angular.z")


class Ros(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The robot's ROS side, for the probe."""

    domain_id: Annotated[int, msgspec.Meta(ge=0, le=232)] | None = None  # DDS's range
    delivery_topic: Text = "/DeliveryRequestMsg/from_json"
    cmd_vel_topic: Text = "/cmd_vel"


class Load(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a load test may ask of the robot, and what it is to keep to.

    Attributes:
        max_rate: most requests per second.
        max_duration_s: longest measurement, s.
    """

    max_rate: Positive | None = None
    max_duration_s: Positive | None = None
    thresholds: tuple[Threshold, ...] = ()


class Statement(msgspec.Struct, frozen=True):
    """What a vendor says of a robot.

    Attributes:
        robot: name, vendor, version.
        claims: the conformance classes that the vendor claims; None: none were named.
        declared: the limits that it names.
    """

    robot: dict[str, str] = {}
    endpoints: Endpoints = Endpoints()
    claims: tuple[ConformanceClass, ...] | None = None
    declared: DeclaredLimits = DeclaredLimits()
    motion: Motion = Motion()
    ros: Ros = Ros()
    load: Load = Load()

    @property
    def limits(self) -> Limits:
        """What the robot is judged by, declared or not."""
        return self.declared.resolved()

    def claimed(self, described: Collection[Interface] = EVERY) -> tuple[ConformanceClass, ...]:
        """The classes to judge: those that are claimed, else those whose interfaces all have an address.

        So who names no classes is never judged more mildly than who names them.

        Args:
            described: the interfaces that the contract describes.
        """
        if self.claims is not None:
            return tuple(name for name in CLASSES if name in self.claims)
        lacking = self.lacking(described)
        judged = (name for name in CLASSES if name not in lacking)
        return tuple(name for name in judged if any(one in described for one in NEEDS[name].interfaces))

    def lacking(self, described: Collection[Interface] = EVERY) -> dict[ConformanceClass, tuple[Interface, ...]]:
        """The classes that are not judged where none are named, with the interfaces that have no address."""
        if self.claims is not None:
            return {}
        there = self.endpoints.interfaces
        found = {name: NEEDS[name].missing(there, described) for name in CLASSES}
        return {name: missing for name, missing in found.items() if missing}


class _Robot(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    name: str | int | float | None = None
    vendor: str | int | float | None = None
    version: str | int | float | None = None


class _Claims(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    profile: Profile | None = None
    classes: tuple[ConformanceClass, ...] | None = None

    def named(self) -> tuple[ConformanceClass, ...] | None:
        """The classes claimed in either way; None: nothing was said."""
        if self.profile is None and self.classes is None:
            return None
        return (*(PROFILES[self.profile] if self.profile else ()), *(self.classes or ()))


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The tables of a statement, as they are written."""

    robot: _Robot = _Robot()
    endpoints: Endpoints = Endpoints()
    claims: _Claims = _Claims()
    limits: DeclaredLimits = DeclaredLimits()
    motion: Motion = Motion()
    ros: Ros = Ros()
    load: Load = Load()


def load_statement(path: Path) -> Statement:
    """Read a statement.

    Files that it names (CA, token, WSDL) are looked for beside it.

    Raises:
        StatementError: it cannot be read, or has an unknown key or a value of the wrong kind.
    """
    file = read_toml(path, _File, StatementError)
    robot = msgspec.structs.asdict(file.robot)
    return Statement(
        robot={key: str(value) for key, value in robot.items() if value is not None},
        endpoints=beside(path.parent, file.endpoints),
        claims=file.claims.named(),
        declared=file.limits,
        motion=file.motion,
        ros=file.ros,
        load=file.load,
    )


def beside(folder: Path, where: Endpoints) -> Endpoints:
    """Endpoints whose files are looked for in a folder; URLs stay as they are."""
    named = {key: getattr(where, key) for key in ("ca_file", "token_file", "publishers_wsdl", "subscribers_wsdl")}
    files = {key: str(folder / name) for key, name in named.items() if name is not None and "://" not in name}
    return msgspec.structs.replace(where, **files)

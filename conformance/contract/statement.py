"""The implementation conformance statement: what a vendor says of a robot, and what it is then judged by."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from conformance.contract.ledger import CLASSES, PROFILES

if TYPE_CHECKING:
    from pathlib import Path

# A robot that declares nothing is judged with the reference robot's limits halved (contract, fine print).
_UNDECLARED_LINEAR = 0.35
_UNDECLARED_ANGULAR = 1.25
_UNDECLARED_SETTLE = 2.0


class StatementError(Exception):
    """A statement that cannot be used; the message names the file, the key and the offending value."""


@dataclass(frozen=True)
class Endpoints:
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

    rest: str | None = None
    publishers_wsdl: str | None = None
    subscribers_wsdl: str | None = None
    publishers_endpoint: str | None = None
    subscribers_endpoint: str | None = None
    ca_file: str | None = None
    token_file: str | None = None
    request_rate: float | None = None
    timeout_s: float = 10.0

    @property
    def publishers(self) -> bool:
        """Whether there is a word on where the publishers service is."""
        return bool(self.publishers_wsdl or self.publishers_endpoint)

    @property
    def subscribers(self) -> bool:
        """Whether there is a word on where the subscribers service is."""
        return bool(self.subscribers_wsdl or self.subscribers_endpoint)


@dataclass(frozen=True)
class Limits:
    """What the robot can do, and how exactly.

    Attributes:
        linear_m_s: greatest speed, m/s.
        angular_rad_s: greatest turning rate, rad/s.
        settle_s: time within which a commanded velocity is reached, s.
        hold_s: time for which a velocity holds unless renewed, s; None: not declared, not checked.
        tolerance: relative tolerance of a reached velocity; tolerance_abs: the absolute one, m/s or rad/s.
    """

    linear_m_s: float = _UNDECLARED_LINEAR
    angular_rad_s: float = _UNDECLARED_ANGULAR
    settle_s: float = _UNDECLARED_SETTLE
    hold_s: float | None = None
    tolerance: float = 0.05
    tolerance_abs: float = 0.02


@dataclass(frozen=True)
class Motion:
    """Where a robot may be driven.

    Attributes:
        arena: (x_min, y_min, x_max, y_max) in the frame of goals, m; None: stay near where the robot is.
        frame: frame of goals and plans.
        radius_m: how far from where it is a goal may be, when there is no arena.
        goals: poses (x, y, yaw) that can be reached; empty: found by asking for plans.
        odom_to_map: (x, y, yaw) of the odometry frame in the frame of goals.
        actuated: the velocity components that the robot can actuate.
    """

    arena: tuple[float, float, float, float] | None = None
    frame: str = "map"
    radius_m: float = 1.0
    goals: tuple[tuple[float, float, float], ...] = ()
    odom_to_map: tuple[float, float, float] = (0.0, 0.0, 0.0)
    actuated: tuple[str, ...] = ("linear.x", "angular.z")


@dataclass(frozen=True)
class Ros:
    """The robot's ROS side, for the probe."""

    domain_id: int | None = None
    delivery_topic: str = "/DeliveryRequestMsg/from_json"
    cmd_vel_topic: str = "/cmd_vel"


@dataclass(frozen=True)
class Statement:
    """What a vendor says of a robot.

    Attributes:
        robot: name, vendor, version.
        claims: the conformance classes that the vendor claims; None: none were named.
    """

    robot: dict[str, str] = field(default_factory=dict)
    endpoints: Endpoints = Endpoints()
    claims: tuple[str, ...] | None = None
    limits: Limits = Limits()
    motion: Motion = Motion()
    ros: Ros = Ros()

    def claimed(self) -> tuple[str, ...]:
        """The classes to judge: those that are claimed, else those whose interfaces have an address."""
        if self.claims is not None:
            return tuple(name for name in CLASSES if name in self.claims)
        where = self.endpoints
        soap = where.publishers or where.subscribers
        there = {
            "rest-resources": where.rest,
            "rest-delivery": where.rest,
            "rest-formats": where.rest,
            "http": where.rest,
            "safety": where.rest,
            "soap-delivery": where.publishers,
            "soap-subscribers": where.subscribers,
            "soap-basic-profile": soap,
            "strict-input": where.rest or soap,
            "xml-security": where.rest or soap,
            "equivalence": where.rest and where.publishers,
            "describe": where.rest or soap,
        }
        return tuple(name for name in CLASSES if there[name])


def load_statement(path: Path) -> Statement:
    """Read a statement.

    Files that it names (CA, token, WSDL) are looked for beside it.

    Raises:
        StatementError: it cannot be read, or has an unknown key or a value of the wrong kind.
    """
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise StatementError(f"{path} cannot be read: {error}") from error
    known = {"robot", "endpoints", "claims", "limits", "motion", "ros", "load"}
    _refuse_unknown(path, "", tables, known)
    for name, table in tables.items():
        if not isinstance(table, dict):
            raise StatementError(f"{path}: {name} = {table!r} must be a table: [{name}]")
    robot = tables.get("robot", {})
    _refuse_unknown(path, "robot", robot, {"name", "vendor", "version"})
    return Statement(
        robot={key: str(value) for key, value in robot.items()},
        endpoints=_endpoints(path, tables.get("endpoints", {})),
        claims=_claims(path, tables.get("claims", {})),
        limits=Limits(**_numbers(path, "limits", tables.get("limits", {}), Limits)),
        motion=_motion(path, tables.get("motion", {})),
        ros=_ros(path, tables.get("ros", {})),
    )


def _refuse_unknown(path: Path, table: str, given: dict[str, Any], known: set[str]) -> None:
    unknown = sorted(set(given) - known)
    if unknown:
        where = f"[{table}] " if table else ""
        raise StatementError(f"{path}: unknown {where}{unknown[0]!r}; known are {', '.join(sorted(known))}")


def _numbers(path: Path, table: str, given: dict[str, Any], kind: type) -> dict[str, float]:
    _refuse_unknown(path, table, given, set(kind.__dataclass_fields__))  # type: ignore[attr-defined] # a dataclass
    for key, value in given.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < float("inf"):
            raise StatementError(f"{path}: [{table}] {key} = {value!r} must be a number, and not negative")
    return {key: float(value) for key, value in given.items()}


def _endpoints(path: Path, given: dict[str, Any]) -> Endpoints:
    _refuse_unknown(path, "endpoints", given, set(Endpoints.__dataclass_fields__))
    numbers = {"request_rate", "timeout_s"}
    for key, value in given.items():
        fits = (
            isinstance(value, int | float) and not isinstance(value, bool) and value > 0
            if key in numbers
            else isinstance(value, str)
        )
        if not fits:
            kind = "a positive number" if key in numbers else "a string"
            raise StatementError(f"{path}: [endpoints] {key} = {value!r} must be {kind}")
    files = {"ca_file", "token_file", "publishers_wsdl", "subscribers_wsdl"}
    fields: dict[str, Any] = {
        key: str(path.parent / value) if key in files and "://" not in str(value) else value
        for key, value in given.items()
    }
    return Endpoints(**fields)


def _claims(path: Path, given: dict[str, Any]) -> tuple[str, ...] | None:
    _refuse_unknown(path, "claims", given, {"profile", "classes"})
    if not given:
        return None
    claims: list[str] = []
    if "profile" in given:
        if given["profile"] not in PROFILES:
            raise StatementError(f"{path}: [claims] profile = {given['profile']!r}; there are {', '.join(PROFILES)}")
        claims += PROFILES[given["profile"]]
    for name in given.get("classes", ()):
        if name not in CLASSES:
            raise StatementError(f"{path}: [claims] {name!r} is no conformance class; there are {', '.join(CLASSES)}")
        claims.append(name)
    return tuple(claims)


def _motion(path: Path, given: dict[str, Any]) -> Motion:
    _refuse_unknown(path, "motion", given, set(Motion.__dataclass_fields__))
    lengths = {"arena": 4, "odom_to_map": 3}
    fields: dict[str, Any] = dict(given)
    for key, length in lengths.items():
        if key in given:
            fields[key] = _tuple(path, key, given[key], length)
    if "goals" in given:
        fields["goals"] = tuple(_tuple(path, "goals", goal, 3) for goal in given["goals"])
    if "actuated" in given:
        fields["actuated"] = tuple(given["actuated"])
        components = [f"{part}.{axis}" for part in ("linear", "angular") for axis in "xyz"]
        for name in fields["actuated"]:
            if name not in components:
                raise StatementError(f"{path}: [motion] actuated: {name!r} is none of {', '.join(components)}")
    return Motion(**fields)


def _tuple(path: Path, key: str, value: Any, length: int) -> tuple[float, ...]:
    if (
        not isinstance(value, list)
        or len(value) != length
        or not all(isinstance(item, int | float) and not isinstance(item, bool) for item in value)
    ):
        raise StatementError(f"{path}: [motion] {key} = {value!r} must be {length} numbers")
    return tuple(float(item) for item in value)


def _ros(path: Path, given: dict[str, Any]) -> Ros:
    _refuse_unknown(path, "ros", given, set(Ros.__dataclass_fields__))
    domain = given.get("domain_id")
    if domain is not None and (not isinstance(domain, int) or not 0 <= domain <= 232):  # noqa: PLR2004 - DDS's range
        raise StatementError(f"{path}: [ros] domain_id = {domain!r} must be a whole number from 0 to 232")
    return Ros(**given)

"""The implementation conformance statement: the vendor's declarations on a device, by which it is judged."""

import tomllib
from pathlib import Path
from typing import Any, Self

import msgspec

from conformance.contract.classes import Interface
from conformance.contract.pack import Contract
from conformance.contract.toml_file import Text, TomlFileError, fit, read_toml
from conformance.statement.endpoints import Auth, Endpoints, beside
from conformance.statement.load import Load, ServiceLevel
from conformance.statement.motion_calls import written_out
from conformance.statement.motion_map import MotionMap
from conformance.statement.ros_map import RosMap, read_ros_map
from conformance.statement.state_map import StateMap


class StatementError(TomlFileError):
    """Raised for an invalid statement; the message names the file, the key and the offending value."""


class Calls(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The calls that are allowed to an API of which only its description is known.

    Attributes:
        allow: patterns of operations that may be called although they are not safe.
        never: patterns of operations that must not be called.
    """

    allow: tuple[Text, ...] = ()
    never: tuple[Text, ...] = ()


class Api(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The device's own description, by which it is judged in place of a contract.

    Attributes:
        openapi: URL or file of its OpenAPI or Swagger description.
        wsdl: URL or file of its WSDL, in place of `openapi`. With both, `certify` uses `openapi`; `load` compares them.
        overlays: files of OpenAPI Overlays to apply to it.
        base_url: where its operations are, in place of what the description says.
        schemas: folder with the schemas that the WSDL imports, where their addresses do not have them.
        allow_files: whether a description in a file may refer to files outside its folder.
    """

    openapi: Text | None = None
    overlays: tuple[Text, ...] = ()
    base_url: Text | None = None
    wsdl: Text | None = None
    schemas: Text | None = None
    allow_files: bool = False


class Statement(msgspec.Struct, frozen=True):
    """A vendor's declarations on a device. A pack whose device needs more tables extends it.

    Attributes:
        robot: name, vendor, version.
        claims: the claimed conformance classes; None if none were named.
        values: values to use in requests, by the name of a parameter or member.
        calls: what may be called.
        motion_map: how a device moves of which only its description is known, or None.
        ros_map: what the device, a ROS 2 web gateway, makes of a ROS graph, or None.
        state_map: which operation the device takes in which of its states, or None.
        slo: service levels by operation, which a load test judges.
    """

    robot: dict[str, str] = {}
    endpoints: Endpoints = Endpoints()
    claims: tuple[str, ...] | None = None
    load: Load = Load()
    values: dict[str, tuple[Any, ...]] = {}
    calls: Calls = Calls()
    motion_map: MotionMap | None = None
    ros_map: RosMap | None = None
    state_map: StateMap | None = None
    slo: dict[str, ServiceLevel] = {}

    @property
    def figures(self) -> dict[str, dict[str, float]]:
        """Return the declared figures for result.json: ``declared``, ``limits`` and ``tolerances``, by name."""
        return {"declared": {}, "limits": {}, "tolerances": {}}

    @property
    def why_not_tested(self) -> dict[str, str]:
        """Return why requirements are not tested whose prerequisite is not declared, by prerequisite."""
        return {}

    @property
    def domain_id(self) -> int | None:
        """The ROS domain that a probe may join, or None."""
        return self.ros_map.domain if self.ros_map else None

    def on_domain(self, domain_id: int) -> Self:
        """Return the statement with another ROS domain.

        Raises:
            StatementError: this statement has no ROS domain.
        """
        if self.ros_map is None:
            raise StatementError(f"ROS domain {domain_id}: this contract has no ROS probe, and the statement no [ros]")
        return msgspec.structs.replace(self, ros_map=msgspec.structs.replace(self.ros_map, domain_id=domain_id))

    def claims_of(self, contract: Contract) -> tuple[str, ...]:
        """Return the classes to judge: those claimed, or, without claims, those whose interfaces all have an address.

        So a vendor who claims nothing is not judged more leniently than one who claims everything.
        """
        if self.claims is not None:
            return tuple(name for name in contract.classes if name in self.claims)
        lacking, described = self.lacking(contract), contract.interfaces
        judged = (item for name, item in contract.classes.items() if name not in lacking)
        return tuple(item.name for item in judged if any(interface in described for interface in item.interfaces))

    def lacking(self, contract: Contract) -> dict[str, tuple[Interface, ...]]:
        """Return the classes that are not judged although none were claimed, with the interfaces without an address."""
        if self.claims is not None:
            return {}
        there, described = self.endpoints.interfaces, contract.interfaces
        found = {name: item.missing(there, described) for name, item in contract.classes.items()}
        return {name: missing for name, missing in found.items() if missing}


class _Robot(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Which device it is.

    Attributes:
        name: the device's name, on certificates and in registries.
        vendor: who makes it.
        version: its firmware or software.
    """

    name: str | int | float | None = None
    vendor: str | int | float | None = None
    version: str | int | float | None = None


class _Claims(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The vendor's claims; without any, each class is judged whose interfaces have an address.

    Attributes:
        profile: a profile of the contract, such as ``full``: all of its classes.
        classes: conformance classes, beside those of the profile.
    """

    profile: str | None = None
    classes: tuple[str, ...] | None = None

    def claimed_names(self, contract: Contract, path: Path) -> tuple[str, ...] | None:
        """Return the classes that are claimed by profile or name, or None.

        Raises:
            StatementError: the contract has no such profile or class.
        """
        if self.profile is None and self.classes is None:
            return None
        profiles = contract.profiles
        if self.profile is not None and self.profile not in profiles:
            raise StatementError(f"{path}: [claims] profile = {self.profile!r} must be one of {', '.join(profiles)}")
        for index, name in enumerate(self.classes or ()):
            if name not in contract.classes:
                known = ", ".join(contract.classes)
                raise StatementError(f"{path}: [claims] classes[{index}] = {name!r} must be one of {known}")
        return (*(profiles[self.profile] if self.profile else ()), *(self.classes or ()))


class _Map(msgspec.Struct, frozen=True):
    motion: MotionMap


def motion_map_of(text: str, where: str) -> MotionMap:
    """Return a motion map from its TOML; ``where`` is the beginning of messages.

    Raises:
        StatementError: it is none.
    """
    try:
        found = {"motion": written_out(tomllib.loads(text).get("motion"), {})}
        return fit(found, _Map, where, StatementError).motion
    except tomllib.TOMLDecodeError as error:
        raise StatementError(f"{where} is no TOML: {error}") from error


class StatementFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The tables of a statement file. A pack extends it with its own tables."""

    robot: _Robot = _Robot()
    endpoints: Endpoints = Endpoints()
    claims: _Claims = _Claims()
    load: Load = Load()
    values: dict[str, tuple[Any, ...]] = {}
    calls: Calls = Calls()
    api: Api = Api()
    auth: Auth | None = None
    motion: Any = None
    ros: Any = None
    states: StateMap | None = None
    slo: dict[str, Any] = {}

    def read(self, contract: Contract, path: Path) -> Statement:
        """Return the statement.

        Raises:
            StatementError: it claims an unknown class or profile, or has a map that is invalid or has no use.
        """
        for name, table in (("motion", self.motion), ("ros", self.ros), ("states", self.states)):
            if table is not None and contract.is_claimed:
                raise StatementError(
                    f"{path}: [{name}] is for a device that is judged by its own description: see [api]"
                )
        try:
            motion = written_out(self.motion, self.values)
        except ValueError as error:
            raise StatementError(f"{path}: [motion] {error}") from error
        moves = None if motion is None else fit({"motion": motion}, _Map, str(path), StatementError).motion
        ros = None if self.ros is None else read_ros_map(self.ros, str(path), StatementError)
        return Statement(**self.common(contract, path), motion_map=moves, ros_map=ros, state_map=self.states)

    def common(self, contract: Contract, path: Path) -> dict[str, Any]:
        """Return the attributes that every statement has, by name.

        Raises:
            StatementError: it claims an unknown class or profile.
        """
        robot = msgspec.structs.asdict(self.robot)
        return {
            "robot": {key: str(value) for key, value in robot.items() if value is not None},
            "endpoints": beside(path.parent, self.endpoints, self.auth),
            "claims": self.claims.claimed_names(contract, path),
            "load": self.load,
            "values": self.values,
            "calls": self.calls,
            "slo": {name: self._level(name, path) for name in self.slo},
        }

    def _level(self, name: str, path: Path) -> ServiceLevel:
        where = f"{path}: [slo] {name!r}"
        if not isinstance(self.slo[name], dict):
            raise StatementError(f"{where} = {self.slo[name]!r} must be a table such as {{ p99_ms = 50 }}")
        return fit(self.slo[name], ServiceLevel, where, StatementError)


def load_statement(path: Path, contract: Contract) -> Statement:
    """Read a statement. Files that it names (CA, token, WSDL) are relative to its folder.

    Raises:
        StatementError: it cannot be read, or has an unknown key or an invalid value.
        ContractError: the contract's plugin cannot be imported.
    """
    shape: type[StatementFile] = getattr(contract.plugin, "StatementFile", StatementFile)
    return read_toml(path, shape, StatementError).read(contract, path)


class _Addresses(msgspec.Struct, frozen=True):
    """The tables of a statement that decide by which contract the rest is read."""

    api: Api = Api()
    endpoints: Endpoints = Endpoints()
    auth: Auth | None = None
    motion: Any = None
    ros: Any = None
    states: Any = None


def maps_in(path: Path) -> tuple[str, ...]:
    """Return which maps a statement on a device with a description has: motion, ros, states.

    Raises:
        StatementError: the statement cannot be read.
    """
    found = read_toml(path, _Addresses, StatementError)
    return tuple(name for name in ("motion", "ros", "states") if getattr(found, name) is not None)


def bridge_in(path: Path) -> RosMap | None:
    """Return the ROS map of a statement on a rosbridge; None if it is on another device.

    Raises:
        StatementError: the statement cannot be read, or the map is invalid.
    """
    ros = read_toml(path, _Addresses, StatementError).ros
    is_bridge = isinstance(ros, dict) and "rosbridge" in ros
    return read_ros_map(ros, str(path), StatementError) if is_bridge else None


def api_of(path: Path) -> Api:
    """Return the description that a statement names, files relative to the statement's folder.

    Raises:
        StatementError: the statement cannot be read, or this table is invalid.
    """
    api = read_toml(path, _Addresses, StatementError).api

    def beside_it(name: str) -> str:
        return name if "://" in name else str(path.parent / name)

    return Api(
        openapi=beside_it(api.openapi) if api.openapi else None,
        overlays=tuple(map(beside_it, api.overlays)),
        base_url=api.base_url,
        wsdl=beside_it(api.wsdl) if api.wsdl else None,
        schemas=beside_it(api.schemas) if api.schemas else None,
    )


def endpoints_of(path: Path) -> Endpoints:
    """Return the endpoints of a statement, files relative to the statement's folder.

    Raises:
        StatementError: the statement cannot be read, or this table is invalid.
    """
    found = read_toml(path, _Addresses, StatementError)
    return beside(path.parent, found.endpoints, found.auth)


def empty_statement(contract: Contract) -> Statement:
    """Return the statement of a vendor who declares nothing.

    Raises:
        ContractError: the contract's plugin cannot be imported.
    """
    found: Statement = getattr(contract.plugin, "Statement", Statement)()
    return found

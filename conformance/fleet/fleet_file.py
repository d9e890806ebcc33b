"""The fleet file FLEET.toml: the robots, and how each is certified."""

import re
from collections import defaultdict
from pathlib import Path

import msgspec

from conformance.contract.pack import Contract
from conformance.contract.toml_file import Positive, Text, TomlFileError, read_toml
from conformance.statement.endpoints import Endpoints, beside
from conformance.statement.statement import StatementError, api_of, endpoints_of, load_statement

TIME_LIMIT_S = 3600.0
"""How long one robot may take where the file does not say, s."""
# A fleet name must be a valid folder name on every file system, and mean nothing else in a path.
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")


class FleetError(TomlFileError):
    """Raised for an invalid fleet file; the message names the file, the robot and the offending value."""


class Member(msgspec.Struct, frozen=True):
    """One robot of a fleet.

    Attributes:
        name: unique name, also of its folder.
        statement: file of its implementation conformance statement, or None if the fleet file has the addresses.
        endpoints: addresses of its interfaces.
        identity: name and vendor, as on its certificate.
        baseline: file of its expected failures, or None.
        movable: whether it may be moved, if the command allows motion.
        time_limit_s: time after which its run is aborted, s; None means the default.
    """

    name: str
    statement: Path | None
    endpoints: Endpoints
    identity: tuple[str, str]
    baseline: Path | None
    movable: bool
    time_limit_s: float | None


class _Robot(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    name: Text | None = None
    statement: Text | None = None
    endpoints: Endpoints | None = None
    baseline: Text | None = None
    allow_motion: bool = True
    time_limit_s: Positive | None = None


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The tables of the fleet file."""

    time_limit_s: Positive | None = None
    robot: tuple[_Robot, ...] = ()


def load_fleet(path: Path, contract: Contract) -> tuple[Member, ...]:
    """Read a fleet file and the statements that it names.

    Args:
        path: the file; file names in it are relative to its folder.
        contract: the contract that judges the robots.

    Raises:
        FleetError: the file or a statement is invalid, or two robots have the same name or address.
    """
    file = read_toml(path, _File, FleetError)
    if not file.robot:
        raise FleetError(f"{path} names no robot: write [[robot]] with statement = FILE, or with endpoints, for each")
    members = tuple(_member(path, number, robot, file, contract) for number, robot in enumerate(file.robot, 1))
    _refuse_common(path, members)
    return members


def _member(path: Path, number: int, robot: _Robot, file: _File, contract: Contract) -> Member:
    where = f"{path}: [[robot]] number {number}"
    if (robot.statement is None) == (robot.endpoints is None):
        raise FleetError(f"{where} must have one of the two: statement, or endpoints")
    statement = path.parent / robot.statement if robot.statement is not None else None
    name = robot.name or (statement.stem if statement else "")
    if not _NAME.fullmatch(name):
        raise FleetError(
            f"{where}: name = {name!r} must be 1 to 64 letters, digits, hyphens and underscores: a folder is named so"
        )
    identity = (name, "")
    if statement is not None:
        try:
            described = api_of(statement).openapi
            if described:
                # With a description, do not apply the contract's rules to the statement.
                endpoints = msgspec.structs.replace(endpoints_of(statement), rest=described)
            else:
                declared = load_statement(statement, contract)
                endpoints = declared.endpoints
                identity = (declared.robot.get("name", ""), declared.robot.get("vendor", ""))
        except StatementError as error:
            raise FleetError(f"{where}: {error}") from error
    else:
        endpoints = beside(path.parent.absolute(), robot.endpoints or Endpoints())
    if not endpoints.interfaces:
        raise FleetError(
            f"{where} ({name}) has no address: neither rest nor a WSDL is among its endpoints, and its statement names "
            "no description ([api] openapi)"
        )
    return Member(
        name=name,
        statement=statement,
        endpoints=endpoints,
        identity=identity,
        baseline=path.parent / robot.baseline if robot.baseline is not None else None,
        movable=robot.allow_motion,
        time_limit_s=robot.time_limit_s if robot.time_limit_s is not None else file.time_limit_s,
    )


def _refuse_common(path: Path, members: tuple[Member, ...]) -> None:
    """Refuse robots with the same folder, whose results would overwrite each other, or the same address."""
    named, found_at = defaultdict(list), defaultdict(list)
    for number, member in enumerate(members, 1):
        named[member.name.lower()].append(number)  # some file systems ignore case
        for address in _addresses(member.endpoints):
            found_at[address].append(number)
    for what, found in (("are both called", named), ("have the same address,", found_at)):
        for value, numbers in found.items():
            if len(numbers) > 1:
                raise FleetError(f"{path}: [[robot]] number {numbers[0]} and number {numbers[1]} {what} {value!r}")


def refuse_same_identity(path: Path, members: tuple[Member, ...]) -> None:
    """Refuse robots with the same name and vendor, because their certificates would look alike.

    Raises:
        FleetError: two robots have the same name and vendor.
    """
    seen: dict[tuple[str, str], int] = {}
    for number, member in enumerate(members, 1):
        first = seen.setdefault(member.identity, number)
        if first != number:
            raise FleetError(
                f"{path}: [[robot]] number {first} and number {number} would be signed as the same robot, "
                f"{member.identity[0]!r} of {member.identity[1]!r}: give each statement a [robot] name of its own"
            )


def _addresses(where: Endpoints) -> set[str]:
    """Return the URLs of a robot. WSDL files are left out, because several robots may share one."""
    urls = (where.rest, where.publishers_endpoint, where.subscribers_endpoint)
    wsdls = (where.publishers_wsdl, where.subscribers_wsdl)
    return {url.rstrip("/") for url in urls if url} | {url for url in wsdls if url and "://" in url}

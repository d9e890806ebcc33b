"""The implementation conformance statement, as far as a load test reads it.

It is the same TOML file that `roaas certify` takes. Here count `[robot]`, `[endpoints]` and `[load]`; the other
tables belong to conformance and are passed over.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from loadtests.statistics.thresholds import Threshold, ThresholdsError, read_tables

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

_ENDPOINT_TEXTS = (
    "rest",
    "publishers_wsdl",
    "subscribers_wsdl",
    "publishers_endpoint",
    "subscribers_endpoint",
    "ca_file",
    "token_file",
)
_ENDPOINT_NUMBERS = ("request_rate", "timeout_s")
_LOAD_NUMBERS = ("max_rate", "max_duration_s")
_FILES = ("ca_file", "token_file")


class StatementError(ValueError):
    """A statement that cannot be used; the message names the offending key and value."""


@dataclass(frozen=True)
class Statement:
    """What the statement says.

    Attributes:
        robot: name, vendor and version, where given.
        endpoints: URLs and files; files are resolved against the statement's folder.
        request_rate: the robot's ceiling, requests per second.
        max_rate, max_duration_s: what the vendor allows of a load test.
    """

    robot: dict[str, str] = field(default_factory=dict)
    endpoints: dict[str, str] = field(default_factory=dict)
    request_rate: float | None = None
    timeout_s: float | None = None
    max_rate: float | None = None
    max_duration_s: float | None = None
    thresholds: tuple[Threshold, ...] = ()


def read(path: Path) -> Statement:
    """Read a statement.

    Raises:
        StatementError: unreadable, no TOML, an unknown key in a table of ours, or a value of the wrong kind.
    """
    try:
        content = tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        raise StatementError(f"statement {str(path)!r}: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise StatementError(f"statement {str(path)!r} is no TOML: {error}") from None
    return parse(content, path)


def parse(content: Mapping[str, Any], path: Path) -> Statement:
    """Read a statement's tables; see `read`."""
    where = f"statement {str(path)!r}"
    robot = _table(content, "robot", where)
    endpoints = _table(content, "endpoints", where)
    load = _table(content, "load", where)
    _refuse_unknown(endpoints, {*_ENDPOINT_TEXTS, *_ENDPOINT_NUMBERS}, f"{where}, [endpoints]")
    _refuse_unknown(load, {*_LOAD_NUMBERS, "thresholds"}, f"{where}, [load]")
    numbers = {key: _number(endpoints, key, f"{where}, [endpoints]") for key in _ENDPOINT_NUMBERS}
    numbers |= {key: _number(load, key, f"{where}, [load]") for key in _LOAD_NUMBERS}
    try:
        thresholds = tuple(read_tables(load.get("thresholds", []), f"{where}, [load]"))
    except ThresholdsError as error:
        raise StatementError(str(error)) from None
    return Statement(
        robot={key: str(robot[key]) for key in ("name", "vendor", "version") if key in robot},
        endpoints={
            key: _text(endpoints, key, f"{where}, [endpoints]", path) for key in _ENDPOINT_TEXTS if key in endpoints
        },
        thresholds=thresholds,
        **numbers,
    )


def _table(content: Mapping[str, Any], name: str, where: str) -> dict[str, Any]:
    table = content.get(name, {})
    if not isinstance(table, dict):
        raise StatementError(f"{where}: [{name}] is no table but {table!r}")
    return table


def _refuse_unknown(table: dict[str, Any], known: set[str], where: str) -> None:
    unknown = sorted(set(table) - known)
    if unknown:
        raise StatementError(
            f"{where}: unknown key {', '.join(map(repr, unknown))}; known are {', '.join(sorted(known))}"
        )


def _number(table: dict[str, Any], key: str, where: str) -> float | None:
    value = table.get(key)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or value <= 0:
        raise StatementError(f"{where}: {key} = {value!r}; it is a positive number")
    return float(value)


def _text(table: dict[str, Any], key: str, where: str, path: Path) -> str:
    value = table[key]
    if not isinstance(value, str) or not value:
        raise StatementError(f"{where}: {key} = {value!r}; it is a string")
    is_file = key in _FILES or (key.endswith("_wsdl") and "://" not in value)
    return str((path.parent / value).resolve()) if is_file else value

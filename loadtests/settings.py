"""What a run is asked to do: options over statement over defaults, checked before anything is sent."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from conformance.contract.thresholds import Threshold
from loadtests.clients.endpoint import Endpoint, EndpointError, tls_context
from loadtests.schedule.plan import CLIENTS, INTERFACES, MOVES, OPERATIONS
from loadtests.statistics.steps import DEFAULT_RATES, STEP_S

if TYPE_CHECKING:
    from conformance.contract.statement import Statement

DEFAULT_RATE = 200.0
DEFAULT_DURATION_S = 20.0
DEFAULT_WARMUP_S = 2.0
#: For anything that moves a robot, unless its statement's [load] says otherwise.
MOTION_RATE = 500.0
MOTION_DURATION_S = 120.0
_MOST_RATE = 1_000_000.0
_MOST_USERS = 10_000
_MOST_DURATION_S = 24 * 3600.0


class SettingsError(ValueError):
    """A run that cannot be, or must not be; the message says what to change."""


@dataclass(frozen=True)
class Settings:
    """A run, ready to be carried out. Options not given are filled in.

    Attributes:
        publishers, subscribers: the SOAP services' addresses; None: as their WSDL says.
        rate: arrivals per second (open model); None in the closed model.
        max_rate: ceiling on starts per second in the closed model, where there is one.
        expect: workers in all, those of other machines included; 0 when only this process works.
    """

    rest: str | None
    publishers: str | None
    subscribers: str | None
    publishers_wsdl: str | None
    subscribers_wsdl: str | None
    ca_file: str | None
    token: str | None
    timeout_s: float
    operations: tuple[str, ...]
    interfaces: tuple[str, ...]
    clients: tuple[str, ...]
    rate: float | None
    users: int | None
    duration_s: float
    warmup_s: float
    arrivals: str
    seed: int
    max_rate: float | None
    max_duration_s: float | None
    processes: int
    expect: int
    master_host: str
    master_port: int
    web_host: str
    web_port: int | None
    metrics_port: int | None
    step_rates: tuple[float, ...]
    step_s: float
    thresholds: tuple[Threshold, ...]
    about: dict[str, str]
    out: str
    command: str

    def to_json(self) -> str:
        """For the process that measures."""
        return json.dumps(msgspec.to_builtins(self))

    @classmethod
    def from_json(cls, text: str) -> Settings:
        """Read what `to_json` wrote."""
        found = json.loads(text)
        for key in ("operations", "interfaces", "clients", "step_rates"):
            found[key] = tuple(found[key])
        found["thresholds"] = msgspec.convert(found["thresholds"], tuple[Threshold, ...])
        return cls(**found)


@dataclass
class Wishes:
    """The command line's options; None where one was not given."""

    rest: str | None = None
    publishers_wsdl: str | None = None
    subscribers_wsdl: str | None = None
    publishers_endpoint: str | None = None
    subscribers_endpoint: str | None = None
    operations: tuple[str, ...] = ()
    interfaces: tuple[str, ...] = ()
    clients: tuple[str, ...] = ()
    rate: float | None = None
    users: int | None = None
    duration_s: float | None = None
    warmup_s: float | None = None
    arrivals: str = "constant"
    seed: int = 1
    processes: int = 1
    expect: int = 0
    master_host: str = "127.0.0.1"
    master_port: int = 0
    web_host: str = "127.0.0.1"
    web_port: int | None = None
    metrics_port: int | None = None
    steps: bool = False
    step_rates: tuple[float, ...] = ()
    step_s: float = STEP_S
    timeout_s: float | None = None
    token_file: str | None = None
    ca_file: str | None = None
    allow_motion: bool = False
    thresholds: tuple[Threshold, ...] = ()
    out: str = ""
    command: str = ""


def settle(wishes: Wishes, statement: Statement) -> Settings:
    """Fill in and check.

    Raises:
        SettingsError: contradictions, values out of range, limits of the statement exceeded, motion not allowed.
    """
    endpoints = statement.endpoints
    addresses = {
        "rest": wishes.rest or endpoints.rest,
        "publishers": wishes.publishers_endpoint or endpoints.publishers_endpoint,
        "subscribers": wishes.subscribers_endpoint or endpoints.subscribers_endpoint,
    }
    descriptions = {
        "publishers_wsdl": wishes.publishers_wsdl or endpoints.publishers_wsdl,
        "subscribers_wsdl": wishes.subscribers_wsdl or endpoints.subscribers_wsdl,
    }
    ca_file = wishes.ca_file or endpoints.ca_file
    try:
        for address in (*addresses.values(), *descriptions.values()):
            if address and ("://" in address or address in addresses.values()):
                Endpoint.parse(address)
        if ca_file:
            tls_context(Path(ca_file))
    except EndpointError as error:
        raise SettingsError(str(error)) from None
    soap = any((addresses["publishers"], addresses["subscribers"], *descriptions.values()))
    interfaces = wishes.interfaces or tuple(
        name for name, there in (("rest", addresses["rest"]), ("soap", soap)) if there
    )
    if not interfaces:
        raise SettingsError("no endpoint: give a statement, --rest, --publishers-wsdl or --subscribers-wsdl")
    if "rest" in interfaces and not addresses["rest"]:
        raise SettingsError("--interface rest needs --rest or the statement's [endpoints] rest")
    if "soap" in interfaces and not soap:
        raise SettingsError("--interface soap needs --publishers-wsdl, --subscribers-wsdl or an endpoint")
    operations = _operations(wishes)
    _check_numbers(wishes)
    rate, duration_s = _bounded(wishes, statement, operations)
    return Settings(
        **(addresses | descriptions),
        ca_file=ca_file,
        token=_token(wishes.token_file or endpoints.token_file),
        timeout_s=wishes.timeout_s or endpoints.timeout_s,
        operations=operations,
        interfaces=tuple(name for name in INTERFACES if name in interfaces),
        clients=tuple(name for name in CLIENTS if name in (wishes.clients or CLIENTS)),
        rate=rate,
        users=wishes.users,
        duration_s=duration_s,
        warmup_s=DEFAULT_WARMUP_S if wishes.warmup_s is None else wishes.warmup_s,
        arrivals=wishes.arrivals,
        seed=wishes.seed,
        max_rate=_ceiling(statement, operations)[0],
        max_duration_s=_longest(statement, operations)[0],
        processes=wishes.processes,
        expect=max(wishes.expect, wishes.processes if wishes.processes > 1 else 0),
        master_host=wishes.master_host,
        master_port=wishes.master_port,
        web_host=wishes.web_host,
        web_port=wishes.web_port,
        metrics_port=wishes.metrics_port,
        step_rates=_step_rates(wishes, statement, operations),
        step_s=wishes.step_s,
        thresholds=wishes.thresholds or statement.load.thresholds,
        about=statement.robot,
        out=wishes.out,
        command=wishes.command,
    )


def _operations(wishes: Wishes) -> tuple[str, ...]:
    if not wishes.operations:
        return ("delivery", "pose") if wishes.allow_motion else ("pose",)
    moving = [name for name in wishes.operations if name in MOVES]
    if moving and not wishes.allow_motion:
        raise SettingsError(
            f"operation {moving[0]!r} makes the robot drive: say --allow-motion when its surroundings are clear, "
            "or measure --operation pose"
        )
    return tuple(name for name in OPERATIONS if name in wishes.operations)


def _check_numbers(wishes: Wishes) -> None:
    if wishes.rate is not None and wishes.users is not None:
        raise SettingsError("--rate (open model) and --users (closed model) exclude each other")
    if wishes.users is not None and (wishes.steps or wishes.step_rates):
        raise SettingsError("--steps offers rates, which is an open model: give --rate instead of --users")
    if wishes.processes + wishes.expect < 1:
        raise SettingsError("--processes 0 leaves the work to others: say how many with --expect-workers")
    ranges: list[tuple[str, Any, float, float]] = [
        ("--rate", wishes.rate, 0.0, _MOST_RATE),
        ("--users", wishes.users, 0, _MOST_USERS),
        ("--duration", wishes.duration_s, 0.0, _MOST_DURATION_S),
        ("--timeout", wishes.timeout_s, 0.0, 3600.0),
        ("--step-duration", wishes.step_s, 0.0, 600.0),
        *(("--step-rates", rate, 0.0, _MOST_RATE) for rate in wishes.step_rates),
    ]
    for name, value, low, high in ranges:
        if value is not None and not low < value <= high:
            raise SettingsError(f"{name} {value:g} is out of range: above {low:g}, at most {high:g}")
    if wishes.warmup_s is not None and not 0 <= wishes.warmup_s <= _MOST_DURATION_S:
        raise SettingsError(f"--warmup {wishes.warmup_s:g} is out of range: 0 or more")


def _ceiling(statement: Statement, operations: tuple[str, ...]) -> tuple[float | None, str]:
    """The highest rate allowed, and who says so."""
    found: list[tuple[float, str]] = []
    if statement.endpoints.request_rate is not None:
        found.append((statement.endpoints.request_rate, "the statement's [endpoints] request_rate"))
    if statement.load.max_rate is not None:
        found.append((statement.load.max_rate, "the statement's [load] max_rate"))
    elif MOVES.intersection(operations):
        found.append(
            (MOTION_RATE, "the default limit for what moves a robot; the statement's [load] max_rate lifts it")
        )
    return min(found) if found else (None, "")


def _longest(statement: Statement, operations: tuple[str, ...]) -> tuple[float | None, str]:
    """The longest duration allowed, and who says so."""
    if statement.load.max_duration_s is not None:
        return statement.load.max_duration_s, "the statement's [load] max_duration_s"
    if MOVES.intersection(operations):
        why = "the default limit for what moves a robot; the statement's [load] max_duration_s lifts it"
        return MOTION_DURATION_S, why
    return None, ""


def _bounded(wishes: Wishes, statement: Statement, operations: tuple[str, ...]) -> tuple[float | None, float]:
    """Rate and duration within what is allowed; defaults bend, wishes are refused."""
    most, why = _ceiling(statement, operations)
    longest, reason = _longest(statement, operations)
    rate = None if wishes.users is not None else (wishes.rate or min(DEFAULT_RATE, most or DEFAULT_RATE))
    if rate is not None and most is not None and rate > most:
        raise SettingsError(f"--rate {rate:g} exceeds {most:g} requests/s ({why})")
    duration_s = wishes.duration_s or min(DEFAULT_DURATION_S, longest or DEFAULT_DURATION_S)
    if longest is not None and duration_s > longest:
        raise SettingsError(f"--duration {duration_s:g} exceeds {longest:g} s ({reason})")
    return rate, duration_s


def _step_rates(wishes: Wishes, statement: Statement, operations: tuple[str, ...]) -> tuple[float, ...]:
    """The rates of the stepped load, which is one of reads where there is one; empty when it was not asked for."""
    reads = tuple(name for name in operations if name not in MOVES)
    ceiling = _ceiling(statement, reads or operations)[0]
    if wishes.step_rates:
        above = [rate for rate in wishes.step_rates if ceiling is not None and rate > ceiling]
        if above:
            raise SettingsError(
                f"--step-rates {above[0]:g} exceeds {ceiling:g} requests/s, which is the highest allowed"
            )
        return tuple(sorted(set(wishes.step_rates)))
    if not wishes.steps:
        return ()
    return tuple(rate for rate in DEFAULT_RATES if ceiling is None or rate <= ceiling) or (ceiling or DEFAULT_RATES[0],)


def _token(path: str | None) -> str | None:
    """The bearer token in a file.

    Raises:
        SettingsError: unreadable, empty, or nothing that a header may hold (RFC 6750 section 2.1).
    """
    if path is None:
        return None
    try:
        token = Path(path).read_text("utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise SettingsError(f"token file {path!r}: {getattr(error, 'strerror', None) or error}") from None
    if not token or not token.isascii() or not token.isprintable() or " " in token:
        raise SettingsError(f"token file {path!r} holds no token: one line of printable ASCII without spaces")
    return token

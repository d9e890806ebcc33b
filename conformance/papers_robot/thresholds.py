"""Thresholds of a load test: what a robot has to keep to. A statement's ``[load]`` may hold some, or a file of its own.

```toml
[[threshold]]            # in a statement: [[load.thresholds]]
operation = "delivery"
interface = "rest"
quantile = "p99"
below_ms = 5.0
time = "response"
client = "wire"
name = "courier over REST"
```
"""

from enum import StrEnum
from pathlib import Path
from typing import Any

import msgspec

from conformance.contract.toml_file import Positive, TomlFileError, read_toml


class Operation(StrEnum):
    """What is asked of the robot."""

    DELIVERY = "delivery"
    COFFEE = "coffee"
    POSE = "pose"


class ApiStyle(StrEnum):
    """The ways to a robot that are compared: the two of its web services, and rosbridge beside them."""

    REST = "rest"
    SOAP = "soap"
    ROSBRIDGE = "rosbridge"


class Client(StrEnum):
    """Who asks: octets made beforehand, or the library that people use."""

    WIRE = "wire"
    ZEEP = "zeep"


class Quantile(StrEnum):
    """The figure of a series that is judged."""

    MEAN = "mean"
    P50 = "p50"
    P90 = "p90"
    P95 = "p95"
    P99 = "p99"
    P999 = "p999"
    MAX = "max"


class Time(StrEnum):
    """Since when an answer is awaited: since the request was sent, or since it was due (open model)."""

    SERVICE = "service"
    RESPONSE = "response"


class ThresholdsError(TomlFileError):
    """A thresholds file that cannot be used; the message names the offending key."""


class Threshold(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One limit on one series. It is met only if the upper bound of the 95 % interval lies below it.

    Attributes:
        operation: what is called.
        interface: over which interface.
        quantile: the figure of the series that is judged.
        below_ms: what it must lie below, ms.
        time: ``service`` counts from the sending of a request, ``response`` from when it was due.
        client: whose requests: the lean client's, or those of the library that people use.
        name: for readers; empty: made from the others.
    """

    operation: Operation
    interface: ApiStyle
    quantile: Quantile
    below_ms: Positive
    time: Time = Time.RESPONSE
    client: Client = Client.WIRE
    name: str = ""

    def as_message(self) -> dict[str, Any]:
        """A JSON object."""
        return msgspec.structs.asdict(self) | {"name": self.name or self.title}

    @property
    def title(self) -> str:
        """What it asks for, in words."""
        return f"{self.quantile} {self.time} time of {self.operation} over {self.interface} ({self.client})"


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    threshold: tuple[Threshold, ...] = ()


def load_thresholds(path: Path) -> tuple[Threshold, ...]:
    """Read a file of ``[[threshold]]`` tables.

    Raises:
        ThresholdsError: it cannot be read, is no TOML, or holds something else or nothing.
    """
    found = read_toml(path, _File, ThresholdsError).threshold
    if not found:
        raise ThresholdsError(f"{path} holds no [[threshold]]")
    return found

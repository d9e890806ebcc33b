"""Thresholds: what a robot has to keep to, and whether it did.

A threshold is met only if the upper bound of the 95 % interval lies below it: a lucky run passes nothing.

```toml
[[threshold]]
operation = "delivery"
interface = "rest"
quantile = "p99"     # mean, p50, p90, p95, p99, p999 or max
below_ms = 5.0
time = "response"    # from the intended start (default), or "service"
client = "wire"      # default
name = "courier over REST"
```
"""

from __future__ import annotations

import tomllib
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from loadtests.schedule.plan import CLIENTS, INTERFACES, OPERATIONS

if TYPE_CHECKING:
    from pathlib import Path

QUANTILES = ("mean", "p50", "p90", "p95", "p99", "p999", "max")
TIMES = ("service", "response")
_CHOICES = {"operation": OPERATIONS, "interface": INTERFACES, "quantile": QUANTILES, "time": TIMES, "client": CLIENTS}
_REQUIRED = ("operation", "interface", "quantile", "below_ms")


class ThresholdsError(ValueError):
    """A thresholds file or table that cannot be used; the message names the offending key."""


@dataclass(frozen=True)
class Threshold:
    """One limit on one series."""

    operation: str
    interface: str
    quantile: str
    below_ms: float
    time: str = "response"
    client: str = "wire"
    name: str = ""

    def as_message(self) -> dict[str, Any]:
        """A JSON object."""
        return asdict(self) | {"name": self.name or self.title}

    @property
    def title(self) -> str:
        """What it asks for, in words."""
        return f"{self.quantile} {self.time} time of {self.operation} over {self.interface} ({self.client})"


def read_tables(tables: Any, where: str) -> list[Threshold]:
    """Thresholds from TOML tables.

    Raises:
        ThresholdsError: an unknown key, a missing one, or a value that is none of the choices.
    """
    if not isinstance(tables, list):
        raise ThresholdsError(f"{where}: thresholds are an array of tables, [[threshold]]")
    found = []
    for number, table in enumerate(tables, 1):
        here = f"{where}, threshold {number}"
        if not isinstance(table, dict):
            raise ThresholdsError(f"{here}: {table!r} is no table")
        known = {*_CHOICES, "below_ms", "name"}
        unknown = sorted(set(table) - known)
        if unknown:
            raise ThresholdsError(
                f"{here}: unknown key {', '.join(map(repr, unknown))}; known are {', '.join(sorted(known))}"
            )
        missing = [key for key in _REQUIRED if key not in table]
        if missing:
            raise ThresholdsError(f"{here}: {', '.join(map(repr, missing))} is missing")
        for key, choices in _CHOICES.items():
            if key in table and table[key] not in choices:
                raise ThresholdsError(f"{here}: {key} = {table[key]!r}; it is one of {', '.join(choices)}")
        limit = table["below_ms"]
        if isinstance(limit, bool) or not isinstance(limit, int | float) or not 0 < limit < float("inf"):
            raise ThresholdsError(f"{here}: below_ms = {limit!r}; it is a positive number of milliseconds")
        found.append(
            Threshold(**{key: str(value) for key, value in table.items() if key != "below_ms"}, below_ms=float(limit))
        )
    return found


def read_file(path: Path) -> list[Threshold]:
    """Thresholds from a file of `[[threshold]]` tables.

    Raises:
        ThresholdsError: it cannot be read, is no TOML, or holds something else.
    """
    try:
        content = tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        raise ThresholdsError(f"thresholds file {str(path)!r}: {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ThresholdsError(f"thresholds file {str(path)!r} is no TOML: {error}") from None
    unknown = sorted(set(content) - {"threshold"})
    if unknown:
        raise ThresholdsError(
            f"thresholds file {str(path)!r}: unknown key {', '.join(map(repr, unknown))}; it holds [[threshold]] tables"
        )
    found = read_tables(content.get("threshold", []), f"thresholds file {str(path)!r}")
    if not found:
        raise ThresholdsError(f"thresholds file {str(path)!r} holds no [[threshold]]")
    return found

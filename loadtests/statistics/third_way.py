"""Interfaces beside SOAP and REST, each over REST: the `other_ways` of latency.json."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from loadtests.statistics.figures import COMPARED, compared, named

if TYPE_CHECKING:
    from loadtests.statistics.figures import Measured

_BASE = "rest"
_WEB_SERVICES = (_BASE, "soap")


def other_ways(measured: Measured) -> list[dict[str, Any]]:
    """Every further interface's service time over REST's, by operation, client and quantile."""
    plan = measured.plan
    names = set(plan.series_names())
    found: list[dict[str, Any]] = []
    for name in plan.series_names():
        base = (name[0], _BASE, name[2])
        if name[1] in _WEB_SERVICES or base not in names:
            continue
        rest, other = ({pair: cell.service for pair, cell in measured.blocks("duel", side)} for side in (base, name))
        pairs = [(rest[pair], other[pair]) for pair in sorted(set(rest) & set(other))]
        found += [named(name) | compared(pairs, quantile, plan.load.seed, "minus_rest_ms") for quantile in COMPARED]
    return found

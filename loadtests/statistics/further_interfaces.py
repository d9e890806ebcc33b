"""Interfaces beside SOAP and REST, such as rosbridge, each over REST: the `further_interfaces` of latency.json."""

from typing import Any

from loadtests.statistics.figures import COMPARED, compared, named, pair_s
from loadtests.statistics.measured import Measured, Side

_BASE = "rest"
_WEB_SERVICES = (_BASE, "soap")


def further_interfaces(measured: Measured) -> list[dict[str, Any]]:
    """Every further interface's service time over REST's, by operation, client and quantile."""
    plan = measured.plan
    names = set(plan.series_names())
    found: list[dict[str, Any]] = []
    for name in plan.series_names():
        base = (name[0], _BASE, name[2])
        if name[1] in _WEB_SERVICES or base not in names:
            continue
        units, length = measured.paired(Side("duel", base), Side("duel", name)), pair_s(measured, "duel", name)
        found += [named(name) | compared(units, quantile, measured, "minus_rest_ms", length) for quantile in COMPARED]
    return found

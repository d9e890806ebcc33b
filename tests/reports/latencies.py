"""Latency results of a robot that is slower, or quicker, than the example's."""

import copy


def scaled(latency, factor, *interfaces):
    """Return a copy in which these interfaces, or all, take `factor` times as long."""
    changed = copy.deepcopy(latency)
    for series in changed["series"]:
        if interfaces and series["interface"] not in interfaces:
            continue
        for group in ("service_ms", "response_ms"):
            series[group] = {name: value and value * factor for name, value in series[group].items()}
        for group in ("ci95_ms", "response_ci95_ms"):
            series[group] = {name: value and [v * factor for v in value] for name, value in series[group].items()}
    return changed

"""Say in plain words what a user of the robot will notice of the measured latency.

The bounds are Nielsen's (Usability Engineering, 1993, section 5.5, after Miller 1968): a response within 0.1 s seems
immediate, within 1 s the delay is noticed but does not interrupt a train of thought, and beyond that people wait.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from reports.latency.numbers import ms, rate
from reports.pages.untrusted import excerpt

_AT_ONCE_MS, _FLOW_MS = 100.0, 1000.0
#: _TAILS: by quantile, the share of requests within it. _BEYOND: the share beyond it.
_TAILS = {"p99": "99 of 100", "p95": "95 of 100", "p90": "9 of 10"}
_BEYOND = {"p99": "1 of 100", "p95": "1 of 20", "p90": "1 of 10"}
_MOST = 6


def sentences(result: Mapping[str, Any]) -> list[str]:
    """Return sentences for each series of the leading client, the slowest first, and what else limits them."""
    own = [item for item in result["series"] if item["client"] == "wire"] or result["series"]
    told = [item for item in own if item["count"] and item["response_ms"]["p50"] is not None]
    if not told or not result.get("trustworthy", result["valid"]):
        return ["This run does not show what a user of the robot will notice; the reasons are below."]
    told.sort(key=lambda item: -_tail(item)[1])
    lines = [sentence for item in told[:_MOST] for sentence in _of_series(item, result)]
    if len(told) > _MOST:
        lines.append(f"The other {len(told) - _MOST} are faster than these.")
    return [*lines, *_of_streams(result), *_of_stops(result), *_limits(result, any(item["errors"] for item in told))]


def _tail(one: Mapping[str, Any]) -> tuple[str, float]:
    """Return the quantile farthest in the tail up to p99 that the series has, and its value."""
    times = one["response_ms"]
    name = next((name for name in _TAILS if times[name] is not None), "p50")
    return name, times[name]


def _of_series(one: Mapping[str, Any], result: Mapping[str, Any]) -> Iterator[str]:
    several = len({each["interface"] for each in result["series"]}) > 1
    name = excerpt(one["operation"], 100) + (f" over {one['interface'].upper()}" if several else "")
    half, (quantile, slow) = one["response_ms"]["p50"], _tail(one)
    if quantile == "p50":
        yield f"{name}: half of the responses take {ms(half)} ms or less; there are too few to say more."
    elif slow < _AT_ONCE_MS:
        yield (
            f"{name}: a person notices no delay. {_TAILS[quantile]} responses come within {ms(slow)} ms, and a delay "
            "below about 100 ms seems immediate."
        )
    elif half < _AT_ONCE_MS:
        delay = "a short delay" if slow < _FLOW_MS else "a wait"
        yield (
            f"{name}: a person usually notices no delay (half of the responses come within {ms(half)} ms), but "
            f"{_BEYOND[quantile]} takes {ms(slow)} ms or more, which is noticed as {delay}."
        )
    else:
        delay = "a short delay" if half < _FLOW_MS else "a wait"
        yield (
            f"{name}: a person notices {delay} each time. Half of the responses take {ms(half)} ms or more, and "
            f"{_BEYOND[quantile]} takes {ms(slow)} ms or more."
        )
    if slow > 0 and quantile != "p50" and not result.get("overload"):
        yield (
            f"A program that waits for each response of {name} can repeat that about {rate(_round(1000 / slow))} times "
            f"a second and is late in {_BEYOND[quantile]} cases."
        )
    failed = one["errors"] + one.get("dropped", 0)
    if failed:
        total = one["count"] + failed
        yield f"{name}: {failed:,} of {total:,} requests failed{_how_often(failed / total, result, one)}."


def _of_streams(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield how old the data is that a display shows, for each stream and for polling beside it."""
    for item in result.get("streams", []):
        ages, intervals = item["age_ms"], item["interval_ms"]
        name = f"{excerpt(item['name'], 100)}, {'polled' if item['kind'] == 'polling' else 'streamed'}"
        if item.get("stamped") and item.get("clock") == "not known":
            yield f"{name}: the age of the data is not known, because the robot's clock is not."
        elif ages and intervals:
            error = item.get("age_error_ms") or 0.0
            old = f"{ms(ages['p50'])} ms old when it comes ({ms(ages['max'])} ms at most)"
            if error:
                least = max(0.0, ages["p50"] - error)
                old = (
                    f"{ms(least)} to {ms(ages['p50'] + error)} ms old when it comes (the robot's clock is known to "
                    f"± {ms(error)} ms only)"
                )
            yield (
                f"{name}: the data is {old}, and a display that shows it until the next shows data that is up to "
                f"{ms(ages['max'] + error + intervals['max'])} ms old."
            )


def _of_stops(result: Mapping[str, Any]) -> Iterator[str]:
    """Yield how late a stop took effect, alone and beside other operators."""
    found = result.get("operators") or {"by_number": [], "error": None}
    for item in found["by_number"]:
        if not item["stops"]:
            continue
        number = "One operator" if item["operators"] == 1 else f"Each of {item['operators']} operators reads the state"
        rest, late = item["rest_ms"], item["late"]
        promised = found.get("promised_ms")
        yield (
            f"{number}: a stop takes effect after {ms(rest['p50'])} ms at the median and {ms(rest['max'])} ms at most "
            f"(± {ms(item['known_to_ms'])} ms"
            + (f"; the motion map promises {ms(promised)} ms" if promised else "")
            + (f", which {late} of {item['stops']} stops did not keep" if late else "")
            + ")."
        )
    if found["error"]:
        yield f"How late a stop takes effect is not known: {excerpt(found['error'], 200)}."


def _round(value: float) -> float:
    """Return a number with two significant digits."""
    return float(f"{value:.2g}")


def _how_often(share: float, result: Mapping[str, Any], one: Mapping[str, Any]) -> str:
    """Return how often that is at the rate of the run."""
    plan = result["plan"]
    weights = plan.get("weights") or dict.fromkeys(plan["operations"], 1)
    whole = plan.get("rate")
    if not whole or one["operation"] not in weights:
        return ""
    every = 1 / (share * whole * weights[one["operation"]] / sum(weights.values()))
    return f": at this load, one every {every:.2g} s"


def _limits(result: Mapping[str, Any], failed: bool) -> Iterator[str]:  # noqa: FBT001 -- whether any request failed
    plan = result["plan"]
    users = f"{plan.get('users')} user{'' if plan.get('users') == 1 else 's'}"
    load = f"at {rate(plan['rate'])} requests/s" if plan.get("rate") else f"with {users}"
    if plan.get("stages"):
        load = f"in {len(plan['stages'])} stages of up to {rate(plan['rate'])} requests/s"
    near = (result["environment"].get("robot") or {}).get("same_machine")
    network = " on the robot's own machine: a network adds its delay" if near else ""
    yield f"{'' if failed else 'No request failed. '}Measured {load} for {plan['duration_s']:g} s{network}."
    if plan["model"] == "closed":
        whose = "The scenario's users wait" if plan.get("scenario") else "Each user waits"
        yield (
            f"{whose} for a response before the next request (closed model): a slow robot gets fewer requests. "
            "Requests at a fixed rate, as with --rate, may take longer than these."
        )

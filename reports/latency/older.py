"""What files say that were written before a result had a headline of its own: the interval and no judgement."""

from collections.abc import Mapping
from typing import Any

from reports.latency.distributions import Series
from reports.latency.numbers import interval, ms, ratio

_ORDER = {"delivery": 0, "pose": 1, "coffee": 2}


def headline(result: Mapping[str, Any], series: Mapping[tuple[str, str, str], Series]) -> dict[str, str]:
    """`words` and `sentence`, as newer files hold them."""
    if not result["valid"]:
        words = "Not valid: these figures say nothing about the robot"
        return {"words": words, "sentence": f"{words}, because {_reasons(result)}."}
    words, sentence = _found(result, series)
    return {"words": _thresholds(result) or words, "sentence": sentence}


def _reasons(result: Mapping[str, Any]) -> str:
    return "; ".join(result["invalid_because"]) or "no reason was recorded"


def _thresholds(result: Mapping[str, Any]) -> str | None:
    outcomes = [threshold["outcome"] for threshold in result.get("thresholds", [])]
    if not outcomes:
        return None
    return f"{outcomes.count('met')} of {len(outcomes)} threshold{'' if len(outcomes) == 1 else 's'} met"


def _found(result: Mapping[str, Any], series: Mapping[tuple[str, str, str], Series]) -> tuple[str, str]:
    medians = [entry for entry in result["comparisons"] if entry["quantile"] == "p50" and entry["ci95"]]
    if not medians:
        return _alone(series)
    leading = min(medians, key=lambda entry: (entry["client"] != "wire", _ORDER[entry["operation"]]))
    noise = next((one["ci95"] for one in result.get("noise_floor", []) if _belongs(one, leading)), None)
    known = f", noise {interval(noise, of_ratio=True)}" if noise else ""
    where = f"{leading['operation']}, {leading['client']} client"
    low, high = leading["ci95"]
    if low <= 1 <= high or (noise and noise[0] <= leading["ratio"] <= noise[1]):
        words = "No difference between SOAP and REST can be shown"
    else:
        words = f"SOAP takes {ratio(leading['ratio'])} times as long as REST"
    return words, f"{words} at the median (95 % interval {interval(leading['ci95'], of_ratio=True)}{known}): {where}."


def _belongs(noise: Mapping[str, Any], leading: Mapping[str, Any]) -> bool:
    same = all(noise[key] == leading[key] for key in ("operation", "client", "quantile"))
    return same and noise["ci95"] is not None


def _alone(series: Mapping[tuple[str, str, str], Series]) -> tuple[str, str]:
    """What can be said where SOAP and REST cannot be compared."""
    for one in series.values():
        median, bounds = one.data["service_ms"]["p50"], one.data["ci95_ms"]["p50"]
        if one.data["count"] and median is not None:
            sure = f" (95 % interval {interval(bounds)} ms)" if bounds else ""
            words = f"Half of the {one.data['operation']} requests over {one.data['interface'].upper()} take at most "
            return f"{words}{ms(median)} ms", f"{words}{ms(median)} ms{sure}: {one.data['client']} client."
    return "Nothing was measured", "No series has enough answered requests for a figure."

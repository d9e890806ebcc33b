"""The one sentence of a run: effect, interval, noise and p99, or that there is no telling.

Terminal, page and Markdown say these words and no others.
"""

from collections.abc import Sequence
from typing import Any

from loadtests.statistics.against import DECIDING, NOT_SLOWER, SLOWER, UNCLEAR

Entry = dict[str, Any]

_ORDER = {"delivery": 0, "pose": 1, "coffee": 2}
_TAIL = "p99"
_TENTHS_MS = 10
_AGAINST = {
    SLOWER: "Slower than the other robot",
    NOT_SLOWER: "Not slower than the other robot",
    UNCLEAR: "Whether it is slower than the other robot cannot be told",
}
_WORTHLESS = "Not valid: these figures say nothing about the robot"
_UNDECIDED = "This run carries no statement"


def headline(document: Entry, worthless: Sequence[str], undecided: Sequence[str]) -> dict[str, str]:
    """The `headline` of latency.json: a few `words`, and a `sentence` that stands alone.

    Args:
        document: the rest of latency.json.
        worthless: why its figures say nothing about the robot.
        undecided: why they leave nothing to compare; thresholds are judged all the same.
    """
    if worthless:
        return {"words": _WORTHLESS, "sentence": f"{_WORTHLESS}, because {'; '.join(worthless)}."}
    judged = _thresholds([entry["outcome"] for entry in document["thresholds"]])
    if undecided:
        return {"words": judged or _UNDECIDED, "sentence": f"{_UNDECIDED}, because {'; '.join(undecided)}."}
    words, sentence = _found(document)
    return {"words": judged or words, "sentence": sentence + _two_modes(document["series"])}


def _thresholds(outcomes: Sequence[str]) -> str | None:
    """What became of the thresholds; None where there are none."""
    number = f"{len(outcomes)} threshold{'' if len(outcomes) == 1 else 's'}"
    for outcome, word in (("missed", "missed"), ("inconclusive", "undecided")):
        if outcome in outcomes:
            return f"{outcomes.count(outcome)} of {number} {word}"
    if not outcomes:
        return None
    return "The threshold is met" if len(outcomes) == 1 else f"All {number} are met"


def _found(document: Entry) -> tuple[str, str]:
    """Words and sentence on what was measured."""
    plan = document["plan"]
    compared = document.get("against")
    if compared is not None:
        return _AGAINST[compared["verdict"]], _other_robot(compared, document["noise_floor"], plan)
    medians = [entry for entry in document["comparisons"] if entry["quantile"] == DECIDING]
    if medians:
        leading = min(medians, key=_rank)
        words, sentence = _SAID[leading["judgement"]](leading)
        tail = _tail(_tail_of(leading, document["comparisons"]))
        return words, f"{sentence}{tail}: {leading['operation']}, {_how(leading, plan)}."
    series = [entry for entry in document["series"] if entry["service_ms"][DECIDING] is not None]
    return _alone(min(series, key=_rank), plan) if series else ("Nothing was measured", _NOTHING)


_NOTHING = "No series has enough answered requests for a figure."


def _rank(entry: Entry) -> tuple[bool, int]:
    return entry["client"] != "wire", _ORDER[entry["operation"]]


def _tail_of(leading: Entry, entries: Sequence[Entry]) -> Entry:
    """The same as an entry, at the 99th percentile."""
    same = ("operation", "client", "interface")
    return next(
        entry for entry in entries if entry["quantile"] == _TAIL and all(entry.get(k) == leading.get(k) for k in same)
    )


def _how(entry: Entry, plan: Entry) -> str:
    return f"{entry['client']} client, {_load(plan)}"


def _load(plan: Entry) -> str:
    if plan["model"] == "open":
        return f"{plan['rate']:g} requests/s"
    users = f"{plan['users']} user{'' if plan['users'] == 1 else 's'}"
    cap = plan["limits"]["max_rate"]
    return users if cap is None else f"{users} under a cap of {cap:g} requests/s, which is part of the figures"


def _ms(value: float) -> str:
    return f"{value:,.3f}" if abs(value) < _TENTHS_MS else f"{value:,.1f}"


def _more(value: float) -> str:
    return f"{_ms(abs(value))} ms {'more' if value >= 0 else 'less'}"


def _between(bounds: Sequence[float], least: int = 2) -> str:
    """An interval of ratios, with as many digits as tell its ends apart."""
    low, high = bounds
    digits = next((digits for digits in range(least, 4) if f"{low:.{digits}f}" != f"{high:.{digits}f}"), 4)
    return f"{low:.{digits}f} to {high:.{digits}f}"


def _differs(entry: Entry) -> tuple[str, str]:
    words = f"SOAP takes {entry['ratio']:.2f} times as long as REST"
    sure = f"95 % interval {_between(entry['ci95'])}, noise {_between(entry['noise_ci95'])}"
    return words, f"{words} at the median ({sure}; {_more(entry['soap_minus_rest_ms'])})"


def _bounded(entry: Entry) -> tuple[str, str]:
    words = f"SOAP takes {_least(entry['bound'])} times as long as REST"
    return words, (
        f"{words} at the median (95 % interval {_between(entry['ci95'])}, less this run's noise, "
        f"{_between(entry['noise_ci95'])})"
    )


def _in_noise(entry: Entry) -> tuple[str, str]:
    words = "No difference between SOAP and REST can be told from noise"
    return words, (
        f"{words} at the median (95 % interval {_between(entry['ci95'])}, noise "
        f"{_between(entry['noise_ci95'])}; a factor beyond {entry['bound']:.2f} is excluded)"
    )


def _no_statement(entry: Entry) -> tuple[str, str]:
    words = "How SOAP compares with REST cannot be told"
    return words, f"{words} at the median ({entry['judgement_reason']})"


def _least(bound: float) -> str:
    return f"{'at least' if bound > 1 else 'at most'} {bound:.2f}"


_SAID = {"differs": _differs, "bounded": _bounded, "noise": _in_noise, "none": _no_statement}


def _tail(entry: Entry) -> str:
    """What may be said of the 99th percentile, to go on with."""
    if entry["judgement"] == "differs":
        return f", and {entry['ratio']:.2f} times at the 99th percentile ({_between(entry['ci95'])})"
    if entry["judgement"] == "bounded":
        return f", and {_least(entry['bound'])} times at the 99th percentile"
    if entry["judgement"] == "noise":
        return (
            "; at the 99th percentile no difference can be told from noise (a factor beyond "
            f"{entry['bound']:.2f} is excluded)"
        )
    return "; nothing can be said of the 99th percentile"


def _other_robot(compared: Entry, noise_floor: Sequence[Entry], plan: Entry) -> str:
    """The change that the verdict rests on: of those that decided it, the one with the highest upper bound."""
    deciding = [change for change in compared["changes"] if change["ci95"] and change["verdict"] == compared["verdict"]]
    if not deciding:
        return "No figure of the two robots has an interval: measure longer."
    leading = max(deciding, key=lambda change: (change["quantile"] == DECIDING, change["ci95"][1]))
    where = "the median" if leading["quantile"] == DECIDING else "the 99th percentile"
    noise = next((entry["ci95"] for entry in noise_floor if _same_figure(entry, leading)), None)
    itself = f", noise {_between(noise)}" if noise else ""
    sure = f"95 % interval {_between(leading['ci95'])}{itself}; {_more(leading['difference_ms'])}"
    tail = _tail_of(leading, compared["changes"])
    told = (
        f", and {tail['ratio']:.2f} times at the 99th percentile ({_between(tail['ci95'])}),"
        if tail is not leading and tail["ci95"]
        else ","
    )
    return (
        f"This robot takes {leading['ratio']:.2f} times as long as the other one at {where} ({sure}){told} where "
        f"{1 + compared['tolerance']:.4g} times is tolerated: {leading['operation']} over "
        f"{leading['interface'].upper()}, {_how(leading, plan)}."
    )


def _same_figure(entry: Entry, leading: Entry) -> bool:
    return all(entry[key] == leading[key] for key in ("operation", "interface", "client", "quantile"))


def _alone(entry: Entry, plan: Entry) -> tuple[str, str]:
    """What can be said of one series, where there is nothing to compare it with."""
    words = (
        f"Half of the {entry['operation']} requests over {entry['interface'].upper()} take {_at_most(entry, DECIDING)}"
    )
    tail = (
        "; they are too few for a 99th percentile"
        if entry["service_ms"][_TAIL] is None
        else f", and 99 of 100 take {_at_most(entry, _TAIL)}{_sure(entry, _TAIL)}"
    )
    return words, f"{words}{_sure(entry, DECIDING)}{tail}: {_how(entry, plan)}."


def _at_most(entry: Entry, quantile: str) -> str:
    """A quantile that stands for requests that were never answered is a lower bound."""
    side = "at least" if quantile in entry["at_least"] else "at most"
    return f"{side} {_ms(entry['service_ms'][quantile])} ms"


def _sure(entry: Entry, quantile: str) -> str:
    bounds = entry["ci95_ms"][quantile]
    return f" (95 % interval {_ms(bounds[0])} to {_ms(bounds[1])} ms)" if bounds else ""


def _two_modes(series: Sequence[Entry]) -> str:
    """What has to be said where a median stands for two kinds of request."""
    names = dict.fromkeys(
        f"{entry['operation']} over {entry['interface'].upper()}"
        for entry in series
        if (entry["modes"] or {}).get("split_ms") is not None
    )
    return f" Two modes, for which no one figure stands: {', '.join(names)}." if names else ""

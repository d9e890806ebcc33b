"""The one sentence of a run: effect, interval, noise and p99, or that there is no telling."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

_ORDER = {"delivery": 0, "pose": 1, "coffee": 2}


def headline(comparisons: Sequence[dict[str, Any]], plan: dict[str, Any]) -> dict[str, str] | None:
    """The `headline` of latency.json: a few `words`, and a `sentence`; None where nothing was compared.

    Args:
        comparisons: those of latency.json.
        plan: likewise.
    """
    medians = [entry for entry in comparisons if entry["quantile"] == "p50"]
    if not medians:
        return None
    leading = min(medians, key=lambda entry: (entry["client"] != "wire", _ORDER[entry["operation"]]))
    tail = next(
        entry
        for entry in comparisons
        if entry["quantile"] == "p99" and all(entry[key] == leading[key] for key in ("operation", "client"))
    )
    words, sentence = _SAID[leading["judgement"]](leading)
    where = f"for {leading['operation']}, with the {leading['client']} client, {_load(plan)}"
    return {"words": words, "sentence": f"{sentence}, {where}. {_tail(tail)}"}


def _load(plan: dict[str, Any]) -> str:
    if plan["model"] == "open":
        return f"at {plan['rate']:g} requests/s"
    users = f"{plan['users']} user{'' if plan['users'] == 1 else 's'}"
    cap = plan["limits"]["max_rate"]
    return (
        f"by {users}" if cap is None else f"by {users} under a cap of {cap:g} requests/s, which is part of the figures"
    )


def _noise(entry: dict[str, Any]) -> str:
    low, high = entry["noise_ci95"]
    return f"an interface against itself {low:.2f} to {high:.2f}"


def _differs(entry: dict[str, Any]) -> tuple[str, str]:
    low, high = entry["ci95"]
    words = f"SOAP takes {entry['ratio']:.2f} times as long as REST"
    return words, f"{words} at the median (95 % interval {low:.2f} to {high:.2f}; {_noise(entry)})"


def _bounded(entry: dict[str, Any]) -> tuple[str, str]:
    side, bound = ("at least", entry["bound"]) if entry["bound"] > 1 else ("at most", entry["bound"])
    words = f"SOAP takes {side} {bound:.2f} times as long as REST"
    low, high = entry["ci95"]
    return words, (
        f"{words} at the median: measured {low:.2f} to {high:.2f} (95 %), less what this run makes of no difference, "
        f"{_noise(entry)}"
    )


def _in_noise(entry: dict[str, Any]) -> tuple[str, str]:
    low, high = entry["ci95"]
    words = "No difference between SOAP and REST can be told from noise"
    return words, (
        f"{words} at the median: SOAP takes {low:.2f} to {high:.2f} times as long (95 % interval; {_noise(entry)}), "
        f"so that a factor beyond {entry['bound']:.2f} is excluded"
    )


def _no_statement(entry: dict[str, Any]) -> tuple[str, str]:
    return (
        "The duel carries no statement",
        f"This run cannot say how SOAP compares with REST ({entry['judgement_reason']})",
    )


_SAID = {"differs": _differs, "bounded": _bounded, "noise": _in_noise, "none": _no_statement}


def _tail(entry: dict[str, Any]) -> str:
    """The same at the 99th percentile."""
    if entry["judgement"] == "differs":
        low, high = entry["ci95"]
        return f"At 99 % it is {entry['ratio']:.2f} times ({low:.2f} to {high:.2f})."
    if entry["judgement"] == "bounded":
        return f"At 99 % it is {'at least' if entry['bound'] > 1 else 'at most'} {entry['bound']:.2f} times."
    if entry["judgement"] == "noise":
        return f"At 99 % no difference can be told from noise; a factor beyond {entry['bound']:.2f} is excluded."
    return "At 99 % nothing can be said."

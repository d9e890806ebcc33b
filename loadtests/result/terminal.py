"""The summary of a run, for the terminal."""

from collections.abc import Mapping, Sequence
from typing import Any

from conformance.commandline.help_pages import inert

_JUDGED = {
    "differs": "a difference",
    "bounded": "a difference, known only by a bound",
    "noise": "not significant",
    "none": "inconclusive",
}
_SHOWN = ("p50", "p90", "p95", "p99", "max")
_TIMES = "service p50      p90      p95      p99      max  response p99   (ms)"  # heads the columns of these
_CARRIED = 1.01  # more responses in the measured part than to its requests, and those of the warm-up are named
#: When a request failed that the counts do not hold.
_WHEN = {"preflight": ", before the run", "warmup": ", in the warm-up", "step": ", in the search for the knee"}


def _ms(value: float | None) -> str:
    return "       -" if value is None else f"{value:8.3f}"


def _times(entry: dict[str, Any]) -> str:
    """Return a ratio with its interval."""
    bounds = entry["ci95"]
    sure = f" (95 %: {bounds[0]:.3f} to {bounds[1]:.3f})" if bounds else ""
    return f"{entry['ratio']:.3f}{sure} times"


def summary(document: dict[str, Any]) -> str:
    """Return a table of the series, the comparisons of medians, the service levels, and last the headline."""
    wide = max([9, *(len(entry["operation"]) for entry in document["series"])])
    lines = [f"{'operation':{wide}}  interface  client     count  errors  {_TIMES}"]
    for entry in document["series"]:
        service, response = entry["service_ms"], entry["response_ms"]
        lines.append(
            f"{entry['operation']:{wide}}  {entry['interface']:10} {entry['client']:6} {entry['count']:9} "
            f"{entry['errors']:7}     "
            f"{' '.join(_ms(service[name]) for name in _SHOWN)}      {_ms(response['p99'])}"
        )
    lines += _counts(document["counts"], document["plan"], in_stages=bool(document["stages"]))
    lines += _stages(document["stages"])
    lines += _medians(document)
    lines += _against(document.get("against"))
    lines += _streams(document["streams"])
    lines += [
        f"service level {entry['outcome']}: {entry['operation']} over {entry['interface']}, {entry['limit']} at most "
        f"{entry['most']:g}: {entry['reason']}"
        for entry in document["slo"]
    ]
    lines += [
        f"{entry['count']} errors ({entry['kind']}{_WHEN.get(entry['phase'], '')}): {entry['message']}"
        for entry in document["errors"][:5]
    ]
    lines += [f"note: {note}" for note in document["notes"]]
    words, sentence = document["headline"]["words"], document["headline"]["sentence"]
    lines.append(sentence if sentence.startswith(words) else f"{words}. {sentence}")
    return "\n".join(map(inert, lines)) + "\n"


def _counts(counts: Mapping[str, Any], plan: Mapping[str, Any], *, in_stages: bool) -> list[str]:
    """Return the numbers of requests by their outcome, as a table."""
    offered, achieved, seconds = counts["asked_rate"], counts["achieved_rate"] or 0.0, counts["seconds"]
    kinds = ", ".join(f"{number:,} {kind}" for kind, number in counts["failed"].items())
    asked = f"{offered:,.1f}/s for {seconds:.1f} s" if offered else "by users that wait"
    if offered and plan["rate"] and not in_stages and offered < 0.99 * plan["rate"]:
        asked += f": nothing was due in the gaps between {plan['blocks']:,} blocks"
    late = f", {counts['waiting_at_end']:,} of them when the time was over" if counts["waiting_at_end"] else ""
    if achieved * seconds > 1 + _CARRIED * (counts["answered"] - counts["waiting_at_end"]):
        late += ", with those of the warm-up that came late"
    rows = [
        ("asked", counts["asked"], asked),
        ("sent", counts["sent"], ""),
        ("answered", counts["answered"], f"{achieved:,.1f}/s{late}"),
        ("failed", sum(counts["failed"].values()), kinds),
        ("not sent", counts["not_sent"], "no connection was free until their deadline"),
        ("lost", counts["lost"], "neither sent nor given up"),
        ("in the series", counts["in_series"], "what the times are of"),
        ("in the A/A control", counts["in_control"], "" if counts["control_only"] else "of these, to estimate noise"),
        ("to the other robot", counts["other_robot"], ""),
    ]
    always = {"asked", "sent", "answered", "failed", "in the series"}
    return [f"{name:18} {number:9,}  {said}".rstrip() for name, number, said in rows if number or name in always]


def _stages(stages: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return each stage of a changing load with its figures."""
    lines = []
    for each in (each for each in stages if each["seconds"]):
        times = ", ".join(
            f"{name} {each['response_ms'][name]:.3f}"
            for name in ("p50", "p95", "p99", "max")
            if each["response_ms"][name] is not None
        )
        lines.append(
            f"stage {each['stage']}, {each['from_rate']:g} to {each['to_rate']:g}/s in {each['seconds']:g} s, "
            f"{each['operation']} over {each['interface']} ({each['client']}): {each['answered']:,} answered, "
            f"{each['failed']:,} failed{f'; response {times} ms' if times else ''}"
        )
    return lines


def _medians(document: dict[str, Any]) -> list[str]:
    """Return each interface's median beside REST's."""
    soap = [
        f"{entry['operation']} ({entry['client']}): SOAP takes {_times(entry)} as long as REST at the median, "
        f"{entry['soap_minus_rest_ms']:+.3f} ms: {_JUDGED[entry['judgement']]}"
        for entry in document["comparisons"]
        if entry["quantile"] == "p50" and entry["ratio"] is not None
    ]
    further = [
        f"{entry['operation']} ({entry['client']}): {entry['interface']} takes {_times(entry)} as long as REST at the "
        f"median, {entry['minus_rest_ms']:+.3f} ms"
        for entry in document["further_interfaces"]
        if entry["quantile"] == "p50" and entry["ratio"] is not None
    ]
    return soap + further


def _against(compared: dict[str, Any] | None) -> list[str]:
    """Return the comparison with another robot, one line for each judged figure."""
    if compared is None:
        return []
    lines = []
    for entry in compared["changes"]:
        if entry["verdict"] is None or entry["ratio"] is None:
            continue
        lines.append(
            f"{entry['operation']} over {entry['interface']} ({entry['client']}): {_times(entry)} "
            f"as long as the other robot at {entry['quantile']}, {entry['difference_ms']:+.3f} ms: {entry['verdict']}"
        )
    return lines


def _streams(found: list[dict[str, Any]]) -> list[str]:
    """Return how often each stream had a message, and how old its data was."""
    lines = []
    for entry in found:
        intervals, ages = entry["interval_ms"], entry["age_ms"]
        often = (
            f"one every {intervals['p50']:.3f} ms at the median, jitter {entry['jitter_ms']:.3f} ms, "
            f"{entry['gaps']['count']} gaps, longest interval {intervals['max']:.3f} ms"
            if intervals
            else "too few for intervals"
        )
        old = f"; data {ages['p50']:.3f} ms old at the median, {ages['max']:.3f} at most" if ages else ""
        if entry["stamped"]:
            old += _sure(entry["age_error_ms"])
        lines.append(f"{entry['name']} ({entry['kind']}): {entry['messages']} messages, {often}{old}")
    return lines


def _sure(error_ms: float | None) -> str:
    """Return how well the age of data is known, by the error of the robot's clock."""
    if error_ms is None:
        return "; the age of the data is not known, because the robot's clock is not"
    return f" (± {error_ms:.3f} ms: the robot's clock)" if error_ms else ""

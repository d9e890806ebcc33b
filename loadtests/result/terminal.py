"""What a run has to say in the end, for the terminal."""

from __future__ import annotations

from typing import Any

_JUDGED = {
    "differs": "a difference",
    "bounded": "a difference of which only a bound is known",
    "noise": "cannot be told from noise",
    "none": "says nothing",
}


def _ms(value: float | None) -> str:
    return "       -" if value is None else f"{value:8.3f}"


def summary(document: dict[str, Any]) -> str:
    """A table of the series, the comparisons of medians, thresholds, and whether it is worth anything."""
    lines = ["operation  interface  client     count  errors  service p50      p90      p99  response p99   (ms)"]
    for entry in document["series"]:
        service, response = entry["service_ms"], entry["response_ms"]
        lines.append(
            f"{entry['operation']:10} {entry['interface']:10} {entry['client']:6} {entry['count']:9} "
            f"{entry['errors']:7}     {_ms(service['p50'])} {_ms(service['p90'])} {_ms(service['p99'])}      "
            f"{_ms(response['p99'])}"
        )
    for entry in document["comparisons"]:
        if entry["quantile"] == "p50" and entry["ratio"] is not None:
            interval = entry["ci95"]
            between = f" (95 %: {interval[0]:.3f} to {interval[1]:.3f})" if interval else ""
            lines.append(
                f"{entry['operation']} ({entry['client']}): SOAP takes {entry['ratio']:.3f}{between} times as long "
                f"as REST at the median, {entry['soap_minus_rest_ms']:+.3f} ms: {_JUDGED[entry['judgement']]}"
            )
    for entry in document["other_ways"]:
        if entry["quantile"] == "p50" and entry["ratio"] is not None:
            interval = entry["ci95"]
            between = f" (95 %: {interval[0]:.3f} to {interval[1]:.3f})" if interval else ""
            lines.append(
                f"{entry['operation']} ({entry['client']}): {entry['interface']} takes {entry['ratio']:.3f}{between} "
                f"times as long as REST at the median, {entry['minus_rest_ms']:+.3f} ms"
            )
    lines += _end_to_end(document.get("end_to_end"))
    if document["headline"]:
        lines.append(document["headline"]["sentence"])
    lines += _against(document.get("against"))
    for entry in document["knee"]:
        highest = entry["highest_rate"]
        reached = (
            "no rate offered meets" if highest is None else f"{highest:g}/s is the highest rate offered that meets"
        )
        lines.append(f"{entry['interface']}: {reached}: {entry['criterion']}")
    for entry in document["knee_search"]:
        found = entry["rate"] is not None
        between = (
            f" ({entry['interval'][0]:.0f} to {entry['interval'][1]:.0f}, {entry['searches']} searches)"
            if found
            else ""
        )
        held = f"held up to {entry['held_up_to'] or 0:.0f}/s and on"
        lines.append(f"{entry['interface']}: " + (f"gives way at {entry['rate']:.0f}/s{between}" if found else held))
    for entry in document["thresholds"]:
        reason = f": {entry['reason']}" if entry["reason"] else ""
        lines.append(f"threshold {entry['outcome']}: {entry['name']}{reason}")
    lines += [f"{entry['count']} errors ({entry['kind']}): {entry['message']}" for entry in document["errors"][:5]]
    lines += [f"note: {note}" for note in document["notes"]]
    lines += [f"not valid: {reason}" for reason in document["invalid_because"]]
    return "\n".join(lines) + "\n"


def _against(compared: dict[str, Any] | None) -> list[str]:
    """What the comparison with another robot found, a line for each figure that is judged, and the verdict."""
    if compared is None:
        return []
    lines = []
    for entry in compared["changes"]:
        if entry["verdict"] is None or entry["ratio"] is None:
            continue
        interval = entry["ci95"]
        between = f" (95 %: {interval[0]:.3f} to {interval[1]:.3f})" if interval else ""
        lines.append(
            f"{entry['operation']} over {entry['interface']} ({entry['client']}): {entry['ratio']:.3f}{between} times "
            f"as long as the other robot at {entry['quantile']}, {entry['difference_ms']:+.3f} ms: {entry['verdict']}"
        )
    told = {"slower": "slower", "not slower": "shown not to be slower", "unclear": "it cannot be told: measure longer"}
    tolerance = f"{compared['tolerance']:.3g}"
    return [*lines, f"against the other robot, tolerance {float(tolerance):.1%}: {told[compared['verdict']]}"]


def _end_to_end(found: dict[str, Any] | None) -> list[str]:
    """How long a delivery takes over each way until the application has it."""
    lines = []
    for entry in (found or {"ways": []})["ways"]:
        times, lost = entry["to_application_ms"], entry["lost"] + entry["errors"]
        answer = entry["answer_ms"]["p50"] if entry["answer_ms"] else None
        answered = "" if answer is None else f", the answer after {answer:.3f} ms"
        missing = f", {lost} never arrived" if lost else ""
        lines.append(
            f"{entry['interface']} to the application: {_ms(times['p50']).strip()} ms at the median, "
            f"{_ms(times['p90']).strip()} at p90{answered}{missing}"
        )
    return lines

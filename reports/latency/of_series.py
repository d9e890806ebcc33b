"""Write remarks on single series: the server's own work, requests after a pause, and repeats."""

from collections.abc import Iterator

from reports.latency.distributions import AllSeries
from reports.latency.numbers import interval, ms, rate

#: If the robot's own times over two interfaces differ by this factor, it does different work for them.
_OTHER_WORK = 1.5


def work(series: AllSeries) -> Iterator[str]:
    """Yield a remark for each operation whose server time differs by 1.5 times or more between REST and SOAP."""
    for (operation, client, interface), rest in series.items():
        soap = series.get((operation, client, "soap"))
        if interface != "rest" or client != "wire" or soap is None:
            continue
        spent = [float((one.data["spans_ms"]["server"] or {}).get("p50") or 0.0) for one in (rest, soap)]
        if 0 < _OTHER_WORK * min(spent) <= max(spent):
            yield (
                f"{operation.capitalize()}: by its Server-Timing header the robot itself works for {ms(spent[0])} ms "
                f"over REST and {ms(spent[1])} ms over SOAP at the median. That is not the same work."
            )


def cold(series: AllSeries) -> Iterator[str]:
    """Yield one sentence that compares median times of requests after a pause with those without a pause."""
    text, after, behind = [], "", ""
    for one in series.values():
        pause = one.data.get("after_pause")
        if pause and pause["cold_ms"]["p50"] is not None and pause["warm_ms"]["p50"] is not None:
            bounds = pause["cold_ci95_ms"]
            sure = f" ({interval(bounds)})" if bounds else ""
            after, behind = f"after a pause of {pause['pause_s']:g} s", _behind(pause["spacing_s"])
            text.append(f"{one.name} {ms(pause['cold_ms']['p50'])} ms{sure} and {ms(pause['warm_ms']['p50'])} ms")
    if text:
        yield f"Medians {after}, and {behind}: {'; '.join(text)}."


def _behind(spacing_s: float) -> str:
    """Return words for the time between successive requests without a pause; `spacing_s` is in seconds, 0 for none."""
    if not spacing_s:
        return "right behind another request"
    limit = f"the limit of {rate(1 / spacing_s)} requests/s allows no less"
    return f"{spacing_s * 1e3:g} ms after the start of the one before ({limit})"


def repeated(series: AllSeries) -> Iterator[str]:
    """Yield a remark for each series with repeats, on the range of their medians.

    It also says how many of the repeats' intervals do not contain the overall median.
    """
    for one in series.values():
        repeats = [repeat for repeat in one.data.get("repeats", []) if repeat["p50"] and repeat["ci95_ms"]["p50"]]
        whole = one.data["service_ms"]["p50"]
        if len(repeats) > 1 and whole:
            missed = sum(not low <= whole <= high for low, high in (repeat["ci95_ms"]["p50"] for repeat in repeats))
            medians = [repeat["p50"] for repeat in repeats]
            yield (
                f"{one.name}, {one.data['client']}: medians of {len(repeats)} repeats from {ms(min(medians))} to "
                f"{ms(max(medians))} ms; the intervals of {missed} of them do not contain the overall median."
            )

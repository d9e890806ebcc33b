"""Write the latency report: a measurement as an HTML page and as Markdown."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from reports.latency.distributions import AllSeries, all_series
from reports.latency.figures.canvas import COLOUR, INK, Picture
from reports.latency.figures.ratios import SPANS, Ratio, means, ratios, spans
from reports.latency.figures.spectrum import spectrum
from reports.latency.figures.timeline import heat, load, timeline
from reports.latency.findings import AGAINST, PAPER, remarks, sentences, verdict
from reports.latency.numbers import NONE, interval, ms, rate, ratio, share
from reports.pages.page import html_page, markdown_page

QUANTILES = ("mean", "p50", "p90", "p95", "p99", "p999", "max")
QUANTILE_WORDS = {
    "mean": "mean",
    "p50": "50 %",
    "p90": "90 %",
    "p95": "95 %",
    "p99": "99 %",
    "p999": "99.9 %",
    "max": "longest",
}


JUDGED = {
    "differs": "a difference",
    "bounded": "a difference beyond",
    "noise": "within noise, below a factor of",
    "none": "not significant",
}


@dataclass(frozen=True, slots=True)
class PaperRow:
    """A table row with mean times over REST and SOAP, of the paper or of this run; None if not measured.

    `bounds` is the 95 % interval of the ratio.
    """

    label: str
    rest_ms: float | None
    soap_ms: float | None
    ratio: float | None
    bounds: tuple[float, float] | None


def latency_html(result: Mapping[str, Any], path: str = "latency.json") -> str:
    """Return a valid `roaas-latency/1` document as an HTML page; `path` is its file, for error messages.

    Raises:
        ResultInvalidError: a histogram cannot be decoded.
    """
    series = all_series(result, path)
    return html_page("latency.html.j2", pictures=_pictures(result, series), **_values(result, series))


def latency_markdown(result: Mapping[str, Any], path: str = "latency.json") -> str:
    """Return a valid `roaas-latency/1` document as short Markdown for a pull request; errors as for `latency_html`."""
    series = all_series(result, path)
    return markdown_page("latency.md.j2", **_values(result, series))


def _values(result: Mapping[str, Any], series: AllSeries) -> dict[str, Any]:
    return {
        "result": result,
        "series": list(series.values()),
        "verdict": verdict(result, series),
        "noticed": sentences(result),
        "remarks": remarks(result, series),
        "paper": paper_rows(result, series),
        "reasons": _missing(series),
        "means": means,
        "spans": SPANS,
        "quantiles": QUANTILES,
        "words": QUANTILE_WORDS,
        "judged": JUDGED,
        "rounds": _rounds(result),
        "ms": ms,
        "ratio": ratio,
        "rate": rate,
        "share": share,
        "failed_when": _failed_when,
        "interval": interval,
        "dash": NONE,
        "tag": lambda change: AGAINST.get(change["verdict"]),
    }


def _missing(series: AllSeries) -> list[str]:
    """Return the reasons why values of any series are missing, each reason once."""
    reasons = (reason for one in series.values() for reason in one.data.get("reasons", {}).values())
    return sorted({reason.rpartition("; ")[2] for reason in reasons})


#: The phases whose failures no series counts.
_UNCOUNTED = {"preflight": "before the run", "warmup": "in the warm-up", "step": "in the search for the knee"}


def _failed_when(error: Mapping[str, Any]) -> str:
    """Return when requests first failed of a kind: the phase if no series counts them, or else the time."""
    first_s = error.get("first_s")
    return _UNCOUNTED.get(error.get("phase", ""), NONE if first_s is None else f"{first_s:.1f} s")


def _rounds(result: Mapping[str, Any]) -> list[str]:
    """Return a line for each operation and client on the resampling: numbers of rounds and blocks, autocorrelation."""
    lines = []
    for entry in result["comparisons"]:
        rounds = entry.get("rounds")
        if entry["quantile"] == "p50" and rounds:
            before, after = (rounds["autocorrelation"][key] for key in ("pairs", "rounds"))
            known = "" if before is None or after is None else f", autocorrelation {after:.2f} (of pairs {before:.2f})"
            lines.append(
                f"{rounds['number']} rounds of {rounds['pairs']} pairs of blocks for {entry['operation']}, "
                f"{entry['client']}{known}"
            )
    return lines


def paper_rows(result: Mapping[str, Any], series: AllSeries) -> list[PaperRow]:
    """Return the table rows of mean times: the paper's, followed by this run's for each operation and client."""
    means_compared = {(c["operation"], c["client"]): c for c in result["comparisons"] if c["quantile"] == "mean"}
    rows = [PaperRow("the paper, delivery", PAPER["rest_ms"], PAPER["soap_ms"], PAPER["ratio"], None)]
    for operation, client in dict.fromkeys(key[:2] for key in series):
        rest, soap = (series.get((operation, client, name)) for name in ("rest", "soap"))
        compared = means_compared.get((operation, client))
        bounds = compared["ci95"] if compared else None
        rows.append(
            PaperRow(
                f"this run, {operation}, {client} client",
                rest.data["service_ms"]["mean"] if rest else None,
                soap.data["service_ms"]["mean"] if soap else None,
                compared["ratio"] if compared else None,
                (bounds[0], bounds[1]) if bounds else None,
            )
        )
    return rows


def _pictures(result: Mapping[str, Any], series: AllSeries) -> dict[str, Picture | None]:
    return {
        "against": _against_picture(result),
        "ratios": _ratio_picture(result),
        "spectrum": spectrum(series),
        "heat": heat(result),
        "spans": spans(series),
        "timeline": timeline(result),
        "load": load(result),
    }


def _ratio_picture(result: Mapping[str, Any]) -> Picture | None:
    mark = None if result["plan"].get("description") else (PAPER["ratio"], f"the paper's {PAPER['ratio']}")
    line = " The dashed line is the ratio of the paper's two means."
    rows = [
        Ratio(
            f"{c['operation']}, {c['client']}, {QUANTILE_WORDS[c['quantile']]}",
            c["ratio"],
            (c["ci95"][0], c["ci95"][1]) if c["ci95"] else None,
            COLOUR["soap"] if c["client"] == "wire" else INK,
        )
        for c in sorted(result["comparisons"], key=lambda c: (c["client"] != "wire", c["operation"]))
        if c["ratio"] is not None and c["quantile"] in {"p50", "p99"}
    ]
    return ratios(
        "ratios",
        "SOAP's service time over REST's",
        rows,
        "SOAP's service time divided by REST's, at the median (50 %) and at the 99th percentile, with 95 % intervals. "
        f"Right of 1 SOAP is slower.{'' if mark is None else line}",
        mark=mark,
    )


def _against_picture(result: Mapping[str, Any]) -> Picture | None:
    """Return a figure of the ratios of service times of both robots, or None without a second robot.

    Each ratio has its 95 % interval; a dashed line marks the tolerance.
    """
    compared = result.get("against")
    if compared is None:
        return None
    rows = [
        Ratio(
            f"{change['operation']}, {change['interface'].upper()}, {QUANTILE_WORDS[change['quantile']]}",
            change["ratio"],
            (change["ci95"][0], change["ci95"][1]) if change["ci95"] else None,
            COLOUR[change["interface"]],
        )
        for change in compared["changes"]
        if change["ratio"] is not None and change["verdict"] is not None
    ]
    return ratios(
        "against",
        "this robot over the other",
        rows,
        "Service time on this robot divided by service time on the other one, with 95 % intervals. Right of 1 this "
        "robot is slower. The dashed line is the tolerance.",
        mark=(1 + compared["tolerance"], f"tolerance, {share(compared['tolerance'])}"),
    )

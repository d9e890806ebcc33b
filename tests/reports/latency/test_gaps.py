"""What a result does not hold is a dash or a sentence on its pages, never a programmer's word for nothing."""

import re

import pytest
from lxml import html

from reports.latency.findings import verdict as verdict_of
from reports.latency.page import latency_html, latency_markdown
from reports.reading import LATENCY_FORMAT, validator

NOTHING = re.compile(r"\b(None|nan|NaN|null|undefined|Undefined)\b")
QUANTILES = dict.fromkeys(("mean", "p50", "p90", "p95", "p99", "p999", "max"))


def as_in_the_first_version(_latency):
    """It had neither judgements nor a headline."""


def with_one_interface(latency):
    latency.update(series=latency["series"][:1], comparisons=[], knee_search=[])


def invalid(latency):
    latency.update(valid=False, invalid_because=["the generator was busy 97% of the time"], exit_code=4)


def without_an_answer(latency):
    latency["errors"][0].update(first_s=None, last_s=None)
    latency["generator"] = {"cpu_share": None, "lag_ms": QUANTILES, "asked_rate": None, "achieved_rate": None}
    latency["noise_floor"] = [one | {"ratio": None, "ci95": None} for one in latency["noise_floor"]]
    for one in latency["comparisons"]:
        one.update(dict.fromkeys(("soap_minus_rest_ms", "ratio", "ci95", "ci95_difference_ms")), judgement="none")
    for one in latency["series"]:
        one.update(count=0, service_ms=QUANTILES, response_ms=QUANTILES, histogram="", response_histogram="")
        one.update(request_bytes=None, response_bytes=None, modes=None, reasons={"p50": "0 samples"})
        one.update(ci95_ms={"p50": None, "p99": None}, spans_ms=dict.fromkeys(("build", "wire", "server", "parse")))


def against_another(latency):
    change = {"operation": "pose", "interface": "rest", "client": "wire", "reason": None, "difference_ms": 0.01}
    known = change | {"ratio": 1.2, "ci95": [1.1, 1.3], "ci95_difference_ms": [0.0, 0.02]}
    unknown = change | dict.fromkeys(("difference_ms", "ratio", "ci95", "ci95_difference_ms"))
    latency["comparisons"] = []
    latency["against"] = {
        "robot": {"rest": "http://old:7003", "publishers": None, "subscribers": None},
        "tolerance": 0.05,
        "verdict": "unclear",
        "changes": [
            known | {"quantile": "mean", "verdict": None},
            known | {"quantile": "p50", "verdict": "unclear"},
            unknown | {"quantile": "p99", "verdict": "unclear"},
        ],
        "series": [],
    }


def with_knees(latency):
    search = {"searches": 2, "criterion": "p99 below 50 ms", "confidence": None, "brackets": [[None, 50]], "trials": 3}
    none = dict.fromkeys(("rate", "interval", "held_up_to", "errors_from", "reason", "limited_by"))
    latency["knee_search"] = [
        search | none | {"interface": "rest"},
        search | none | {"interface": "both", "held_up_to": 400.0},
        search | none | {"interface": "soap", "rate": 90.0, "interval": [80.0, 100.0], "brackets": [[80.0, 100.0]]},
    ]
    step = {"interface": "soap", "offered_rate": 90.0, "achieved_rate": 0.0, "count": 0, "errors": 0, "meets": False}
    latency["knee_search"][2]["curve"] = [step | {"p50_ms": None, "p99_ms": None}]


@pytest.mark.parametrize(
    "change",
    [as_in_the_first_version, with_one_interface, invalid, without_an_answer, against_another, with_knees],
    ids=lambda change: change.__name__,
)
def test_no_cell_and_no_sentence_says_none(latency, change):
    # Few drawings, which take their time; every table stays.
    latency.update(series=latency["series"][:2], blocks=[], time_series={"width_s": 1.0, "series": []})
    for series in latency["series"]:
        series.update(histogram="", response_histogram="")
    del latency["heat_map"]
    change(latency)
    validator(LATENCY_FORMAT).validate(latency)
    page = html.document_fromstring(latency_html(latency)).find(".//main").text_content()
    shown = page + latency_markdown(latency)
    assert not [shown[max(0, word.start() - 60) : word.end() + 20] for word in NOTHING.finditer(shown)]


def test_run_without_an_answer(latency):
    """It was interrupted before."""
    without_an_answer(latency)
    latency.update(knee_search=[], slo=[], noise_floor=[], errors=[], blocks=[], interrupted=True)
    latency.update(heat_map={"width_s": 1.0, "edges_ms": [], "series": []}, time_series={"width_s": 1.0, "series": []})
    document = html.document_fromstring(latency_html(latency))
    assert not list(document.iter("figure"))
    assert "The run was interrupted" in document.text_content()
    assert "0 samples" in document.text_content()
    assert verdict_of(latency, {}).tone == "warning"


def test_figures_come_before_tables_and_tables_fold(latency):
    latency.update(series=latency["series"][:2], time_series={"width_s": 1.0, "series": []}, blocks=[])
    document = html.document_fromstring(latency_html(latency))
    for section in document.iter("section"):
        order = [one.tag for one in section.iter("figure", "table")]
        assert order == sorted(order), section.get("aria-labelledby")
    unfolded = [
        table.xpath("ancestor::section/@aria-labelledby")[0]
        for table in document.iter("table")
        if not table.xpath("ancestor::details[not(@open)]")
    ]
    assert unfolded == ["slo", "errors"], "what decides and what failed is seen at once"


@pytest.mark.parametrize(("verdict", "sign"), [("slower", "✗"), ("not slower", "✓"), ("unclear", "?")])
def test_the_headline_of_two_robots_leads_with_the_sign_of_its_verdict(latency, verdict, sign):
    against_another(latency)
    latency["against"]["verdict"] = verdict
    latency |= {"valid": True, "invalid_because": [], "slo": [], "knee_search": []}
    latency |= {"time_series": {"width_s": 1.0, "series": []}}  # few figures: drawing takes seconds
    latency["headline"] = {"words": f"So it is {verdict}", "sentence": "This robot takes 1.21 times as long."}
    validator(LATENCY_FORMAT).validate(latency)
    text = latency_markdown(latency)
    assert f"{sign} So it is {verdict}" in text
    assert "This robot takes 1.21 times as long." in text
    if verdict == "slower":  # drawing takes its time: one page for all three
        page = latency_html(latency)
        assert f"{sign} So it is {verdict}" in page
        assert "http://old:7003" in page
        assert 'id="against-0"' in page, "the ratios are drawn"

"""The report of a run in which two robots were measured alternately."""

import pytest

from reports.latency.page import latency_html, latency_markdown
from reports.reading import LATENCY_FORMAT, validator

CHANGE = {"operation": "pose", "interface": "rest", "client": "wire", "quantile": "p50", "reason": None}
FIGURES = {"difference_ms": 0.021, "ratio": 1.21, "ci95": [1.14, 1.29], "ci95_difference_ms": [0.014, 0.029]}


@pytest.mark.parametrize(("verdict", "sign"), [("slower", "✗"), ("not slower", "✓"), ("unclear", "?")])
def test_the_headline_leads_with_the_sign_of_its_verdict(latency, verdict, sign):
    judged = CHANGE | FIGURES | {"verdict": verdict}
    shown = CHANGE | FIGURES | {"quantile": "mean", "verdict": None}
    none = CHANGE | dict.fromkeys(FIGURES) | {"quantile": "p99", "verdict": "unclear", "reason": "9 samples"}
    latency |= {"valid": True, "invalid_because": [], "slo": [], "comparisons": []}
    latency |= {"knee_search": [], "time_series": {"width_s": 1.0, "series": []}}  # few figures: drawing takes seconds
    latency["against"] = {
        "robot": {"rest": "http://old:7003", "publishers": None, "subscribers": None},
        "tolerance": 0.05,
        "verdict": verdict,
        "changes": [judged, shown, none],
        "series": [],
    }
    latency["headline"] = {"words": f"So it is {verdict}", "sentence": "This robot takes 1.21 times as long."}
    validator(LATENCY_FORMAT).validate(latency)
    text = latency_markdown(latency)
    assert f"{sign} So it is {verdict}" in text
    assert "This robot takes 1.21 times as long." in text
    assert "None" not in text
    if verdict == "slower":  # drawing takes its time: one page for all three
        page = latency_html(latency)
        assert f"{sign} So it is {verdict}" in page
        assert "http://old:7003" in page
        assert 'id="against-0"' in page, "the ratios are drawn"

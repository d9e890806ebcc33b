"""The report of a run in which two robots took turns."""

import pytest

from reports.latency.page import latency_html, latency_markdown
from reports.reading import LATENCY_FORMAT, validator

CHANGE = {"operation": "pose", "interface": "rest", "client": "wire", "quantile": "p50", "reason": None}
FIGURES = {"difference_ms": 0.021, "ratio": 1.21, "ci95": [1.14, 1.29], "ci95_difference_ms": [0.014, 0.029]}


@pytest.mark.parametrize(
    ("verdict", "words"),
    [
        ("slower", "Slower than the other robot"),
        ("not slower", "Not slower than the other robot"),
        ("unclear", "Whether it is slower cannot be told"),
    ],
)
def test_the_verdict_leads_with_its_interval(latency, verdict, words):
    judged = CHANGE | FIGURES | {"verdict": verdict}
    shown = CHANGE | FIGURES | {"quantile": "mean", "verdict": None}
    none = CHANGE | dict.fromkeys(FIGURES) | {"quantile": "p99", "verdict": "unclear", "reason": "9 samples"}
    latency |= {"valid": True, "invalid_because": [], "thresholds": [], "comparisons": []}
    latency["against"] = {
        "robot": {"rest": "http://old:7003", "publishers": None, "subscribers": None},
        "tolerance": 0.05,
        "verdict": verdict,
        "changes": [judged, shown, none],
        "series": [],
    }
    validator(LATENCY_FORMAT).validate(latency)
    text = latency_markdown(latency)
    assert words in text
    assert "1.14 to 1.29 times as long as the other one" in text
    assert "None" not in text
    if verdict == "slower":  # drawing takes its time: one page for all three
        page = latency_html(latency)
        assert words in page
        assert "http://old:7003" in page
        assert 'id="against-0"' in page, "the ratios are drawn"

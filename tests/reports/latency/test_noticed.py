"""What a user notices, in plain words; and the run as test cases."""

import copy

import pytest
from lxml import etree, html

from reports.formats.catalogue import latency_junit
from reports.latency.findings import sentences
from reports.latency.page import latency_html, latency_markdown

LEVEL = {
    "operation": "GET /a/{b_c}",
    "interface": "rest",
    "client": "wire",
    "limit": "p99_ms",
    "most": 50.0,
    "at_rate": 100.0,
    "rate": 100.0,
    "measured": 61.5,
    "requests": 4000,
    "beyond": 90,
    "share_ci95": [0.01, 0.03],
    "share_allowed": 0.01,
    "outcome": "broken",
    "reason": "90 of 4,000 requests took longer than 50 ms",
}


@pytest.fixture
def described(latency):
    """A result of one described operation, with service levels."""
    result = copy.deepcopy(latency)
    (one,) = [each for each in result["series"] if (each["operation"], each["interface"]) == ("pose", "rest")][:1]
    one |= {"operation": "GET /a/{b_c}", "client": "wire", "errors": 0, "dropped": 0}
    result |= {"series": [one], "valid": True, "invalid_because": [], "comparisons": [], "slo": []}
    result |= {"knee_search": [], "time_series": {"width_s": 1.0, "series": []}}  # few figures: drawing takes seconds
    result["plan"] |= {"description": "http://robot/openapi.json", "operations": ["GET /a/{b_c}"], "rate": 200.0}
    kept = LEVEL | {"limit": "error_rate", "most": 0.001, "measured": 0.0, "outcome": "kept", "beyond": 0}
    result["slo"] = [LEVEL, kept, kept | {"limit": "p50_ms", "most": 5.0, "measured": None, "outcome": "not known"}]
    return result


def told(result, **times):
    one = result["series"][0]
    one["response_ms"] = dict.fromkeys(one["response_ms"]) | times
    return sentences(result)


def test_delays_are_named_as_people_and_programs_notice_them(described):
    (person, program, load) = told(described, p50=2.0, p99=12.5)
    assert person == (
        "GET /a/{b_c}: a person notices no delay. 99 of 100 responses come within 12.5 ms, and a delay below about "
        "100 ms seems immediate."
    )
    assert "can run about 80 times a second, and is late in 1 of 100 turns" in program
    assert load.startswith("No request failed. Measured at 200 requests/s")
    assert "usually notices no delay" in told(described, p50=2.0, p99=300.0)[0]
    assert "1 of 10 takes 3,000 ms or more, which is noticed as a wait" in told(described, p50=2.0, p90=3000.0)[0]
    assert "a person notices a short delay each time" in told(described, p50=200.0, p95=300.0)[0]
    assert "a person notices a wait each time" in told(described, p50=2000.0, p95=3000.0)[0]
    assert "too few to say more" in told(described, p50=2.0)[0]


def test_the_closed_model_is_explained(described):
    described["plan"] |= {"model": "closed", "rate": None, "users": 3}
    *_, load, model = told(described, p50=2.0, p99=12.5)
    assert load.startswith("No request failed. Measured with 3 users for")
    assert model.startswith("Each user waits for a response before the next request (closed model): a slow robot gets")
    described["plan"]["scenario"] = {"file": "operators.py", "sha256": "0" * 64}
    assert told(described, p50=2.0, p99=12.5)[-1].startswith("The scenario's users wait for a response")


@pytest.mark.parametrize(
    ("clock", "error_ms", "words"),
    [
        ("shared", 0.0, "the data is 30.0 ms old when it comes (40.0 ms at most), and a display that"),
        (
            "estimated",
            5.0,
            "the data is 25.0 to 35.0 ms old when it comes (the robot's clock is known to ± 5.000 ms only)",
        ),
        ("estimated", 500.0, "the data is 0.000 to 530.0 ms old when it comes"),
        ("not known", None, "GET /a, polled: the age of the data is not known, because the robot's clock is not."),
    ],
)
def test_the_age_of_data_comes_with_its_error(described, clock, error_ms, words):
    ages = {"min": 20.0, "p50": 30.0, "p90": None, "p99": None, "max": 40.0} if error_ms is not None else None
    heard = {"name": "GET /a", "kind": "polling", "messages": 9, "stamped": 9, "clock": clock, "age_error_ms": error_ms}
    described["streams"] = [heard | {"age_ms": ages, "interval_ms": {"p50": 50.0, "max": 60.0}, "gaps": None}]
    assert any(words in sentence for sentence in told(described, p50=2.0, p99=12.5))
    page = html.fromstring(latency_html(described)).text_content()
    assert ("30.0 ± " in page) == bool(error_ms)
    assert ("the error of the robot's clock" in page) == (clock != "shared")
    assert "GET /a (polling)" in latency_markdown(described)


def test_failures_are_counted_in_time(described):
    described["series"][0] |= {"count": 95, "errors": 3, "dropped": 2}
    said = "5 of 100 requests failed (2 of them got no connection in time): at this load, one every 0.1 s."
    assert said in told(described, p50=2.0, p99=3.0)[2]
    described["series"][0] |= {"count": 98, "errors": 0}
    assert not any("No request failed" in line for line in told(described, p50=2.0, p99=3.0))
    described["trustworthy"] = False
    assert sentences(described) == [
        "This run does not show what a user of the robot will notice; the reasons are below."
    ]


def test_the_page_says_what_is_noticed_after_its_verdict_and_shows_service_levels(described):
    page = html.document_fromstring(latency_html(described))
    shown = " ".join(page.text_content().split())
    first = page.xpath("//ul[@id='noticed']/li")[0].text_content()
    assert first.startswith("GET /a/{b_c}: a person")
    assert shown.index(first[:40]) > shown.index(described["headline"]["sentence"][:40])
    assert [tag.text for tag in page.xpath("//section[@aria-labelledby='slo']//span")] == [
        "✗ broken",
        "✓ kept",
        "? not known",
    ]
    assert "SOAP compared with REST" not in shown
    assert "the paper" not in shown
    short = latency_markdown(described)
    assert "| 50.0 ms | 61.5 ms | broken |" in short
    assert "the paper" not in short


def test_ci_systems_read_a_case_for_each_level(described, latency):
    cases = etree.fromstring(latency_junit(described).encode()).findall(".//testcase")
    assert [(case.get("classname"), case[0].tag) for case in cases] == [
        ("roaas.run", "system-out"),
        ("roaas.slo", "failure"),
        ("roaas.slo", "system-out"),
        ("roaas.slo", "error"),
    ]
    assert cases[1].get("name") == "GET /a/{b_c} over REST: p99_ms at most 50"
    paper = etree.fromstring(latency_junit(latency).encode())
    assert (paper.get("tests"), paper.get("failures")) == ("3", "1")


def test_names_of_operations_do_no_harm(described):
    described["series"][0]["operation"] = "GET /<script>$x$|`"
    described["plan"]["operations"] = ["GET /<script>$x$|`"]
    assert "<script>$x" not in latency_html(described)
    latency_markdown(described)
    etree.fromstring(latency_junit(described).encode())

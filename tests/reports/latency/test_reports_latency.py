"""The latency report as page and as Markdown, and distributions out of HDR histograms."""

import copy
import json
from pathlib import Path

import numpy as np
import pytest
from hdrh.histogram import HdrHistogram
from lxml import html

from reports.errors import ResultInvalidError
from reports.latency.distributions import all_series, distribution
from reports.latency.figures.ratios import spans
from reports.latency.figures.timeline import load, stalls, timeline
from reports.latency.findings import remarks, verdict
from reports.latency.page import latency_html, latency_markdown

DATA = Path(__file__).parents[1] / "data"
#: What takes most time to draw, left out.
FEW = {"knee_search": [], "time_series": {"width_s": 1.0, "series": []}}
FIGURES = ["load", "ratios", "spectrum", "heat", "spans", "timeline"]


@pytest.fixture(scope="module")
def example():
    """The example's page, drawn once for all tests that only look at it."""
    return latency_html(json.loads((DATA / "latency-example.json").read_text(encoding="utf-8")))


def page(result):
    return html.document_fromstring(latency_html(result))


def text(element):
    return " ".join(element.text_content().split())


def figures(document):
    return [figure.get("id").removesuffix("-figure") for figure in document.iter("figure")]


def test_everything_is_in_it(latency, example):
    assert len(example) < 1_500_000
    document = html.document_fromstring(example)
    assert figures(document) == FIGURES
    shown = text(document)
    for wanted in (
        "✗ 1 of 2 service levels broken",
        latency["headline"]["sentence"],
        "1 stall in seconds 15 to 17 of the run: a request took 400.2 ms",
        "2 requests of 4,642 failed",
        "the paper, delivery1.5002.5001.67",
        "no complete response within 10 s",
        "Example CPU @ 2.80GHz",
        latency["environment"]["command"],
        latency["environment"]["robot_command"],
        "lost at 14.2 s",
        "4,640: 232/s; 3 came when the time was over",
        "pose, SOAP (wire client) has two modes: 23 % of the requests take more than 0.420 ms, about 1.320 ms",
        "Requests over five times the median: 3 % of pose, REST (wire client)",
    ):
        assert wanted in shown, wanted


def test_every_figure_tells_what_it_shows(example):
    document = html.document_fromstring(example)
    drawings = document.xpath("//figure//*[local-name()='svg']")
    assert len(drawings) == 18
    assert all(len(drawing.get("aria-label")) > 20 for drawing in drawings)
    assert all(text(caption) for caption in document.iter("figcaption"))


def test_ids_are_unique_and_the_page_loads_nothing(example):
    document = html.document_fromstring(example)
    ids = document.xpath("//@id")
    assert len(ids) == len(set(ids))
    assert document.xpath("//meta[@http-equiv='Content-Security-Policy']/@content")[0].startswith("default-src 'none'")
    assert all(str(link).startswith("#") for link in document.xpath("//@href | //@src"))
    assert example.count("url(") == example.count("url(#")
    assert "@import" not in example


def test_same_result_same_octets(latency, example):
    assert latency_html(latency) == example
    assert latency_markdown(latency) == latency_markdown(copy.deepcopy(latency))


def test_markdown_is_short_and_has_the_answer(latency):
    source = latency_markdown(latency)
    assert len(source) < 6000
    assert latency["headline"]["sentence"][:80] in source
    repeated = {"words": "REST breaks down", "sentence": "REST breaks down. Half take 1 ms."}
    assert latency_markdown(latency | {"headline": repeated}).count("REST breaks down") == 1
    assert "| delivery | SOAP | wire | 900 |" in source


def test_only_what_must_be_there(latency):
    latency["series"] = latency["series"][:2]
    required = ("format", "valid", "invalid_because", "headline", "environment", "plan", "series", "comparisons")
    assert figures(page({key: latency[key] for key in required})) == ["ratios", "spectrum", "spans"]


def test_no_series_at_all(latency):
    latency.update(series=[], comparisons=[], valid=False, exit_code=4, invalid_because=["the robot was gone"])
    del latency["time_series"]
    shown = text(page(latency))
    assert "✗ 1 of 2 service levels broken" in shown, "in the result's own words, and as what is bad"
    assert "the robot was gone" in shown


def test_invalid_run_says_so_first(latency):
    latency.update(
        FEW, series=latency["series"][:2], valid=False, exit_code=4, invalid_because=["generator CPU at 97 %"]
    )
    assert verdict(latency, all_series(latency, "x")).tone == "bad"
    assert "✗ 1 of 2 service levels broken" in text(page(latency)), "in the result's own words"


def test_one_interface_alone(latency):
    latency.update(FEW, comparisons=[], series=[s for s in latency["series"] if s["interface"] == "rest"][:1])
    assert "difference" not in figures(page(latency))


def test_a_robot_that_works_longer_over_one_interface_is_told_of(latency):
    said = "Pose: by its Server-Timing header the robot itself works for 0.035 ms over REST and 0.065 ms over SOAP"
    assert sum(said in remark for remark in remarks(latency, all_series(latency, "x"))) == 1
    for series in latency["series"]:
        series["spans_ms"]["server"]["p50"] = 0.05
    assert not any("not the same work" in remark for remark in remarks(latency, all_series(latency, "x")))


def test_the_runs_own_notes_are_sentences_as_the_other_remarks_are(latency):
    latency.update(FEW, series=latency["series"][:2])
    latency["notes"] = ["the machine was busy before the run: load average 8.0 on 2 CPUs"]
    said = "The machine was busy before the run: load average 8.0 on 2 CPUs."
    assert said in remarks(latency, all_series(latency, "x"))
    assert page(latency).text_content().count(said) == 1
    assert latency_markdown(latency).count(said) == 1


def test_robot_without_server_timing(latency):
    for series in latency["series"]:
        series["spans_ms"]["server"] = None
    assert spans(all_series(latency, "x"))


def test_negative_and_zero_figures(latency):
    latency.update(series=latency["series"][:2], time_series=FEW["time_series"])
    for comparison in latency["comparisons"]:
        comparison.update(soap_minus_rest_ms=-0.01, ratio=0.9, ci95=[0.88, 0.92], ci95_difference_ms=[0.0, 0.02])
    for step in latency["knee_search"][0]["curve"]:
        step.update(p50_ms=None, p99_ms=None, achieved_rate=0.0, count=0)
    assert "0.90" in text(page(latency))
    assert load(latency)
    latency_markdown(latency)


def test_one_request_in_each_series(latency):
    histogram = HdrHistogram(1, 3_600_000_000, 3)
    histogram.record_value(70)
    latency.update(series=latency["series"][:2], knee_search=[])
    for series in latency["series"]:
        series.update(count=1, histogram=histogram.encode().decode(), response_histogram=histogram.encode().decode())
    assert figures(page(latency)) == FIGURES[1:]


def test_stalls_are_found_and_those_of_one_moment_are_one(latency):
    found = stalls(latency)
    assert {(s.series, s.start_s, s.end_s) for s in found} == {
        (("delivery", "wire", "rest"), 15.0, 17.0),
        (("pose", "wire", "rest"), 15.0, 17.0),
    }
    assert sum("stall" in remark for remark in remarks(latency, all_series(latency, "x"))) == 1


def test_interval_without_any_answer_is_a_stall(latency):
    points = latency["time_series"]["series"][1]["points"]
    points[5].update(count=0, errors=45, p50_ms=None, p99_ms=None, max_ms=None)
    found = [s for s in stalls(latency) if s.series == ("delivery", "wire", "soap")]
    assert [(s.start_s, s.longest_ms) for s in found] == [(points[5]["t_s"], None)]
    assert timeline(latency)


def test_long_run_keeps_its_stall_and_its_size(latency):
    for series in latency["time_series"]["series"]:
        point = series["points"][0]
        series["points"] = [{**point, "t_s": float(second)} for second in range(20_000)]
    latency["time_series"]["series"][0]["points"][777].update(max_ms=5000.0)
    drawn = "".join(timeline(latency).panels)
    assert len(drawn) < 500_000
    assert "5,000 ms" in drawn


def test_bad_histogram_is_told(latency):
    latency["series"][2]["histogram"] = "garbage"
    with pytest.raises(ResultInvalidError, match=r"latency\.json: at \$\.series\[2\]\.histogram"):
        latency_html(latency)


def test_noise_floor_of_a_short_run(latency):
    latency.update(FEW, series=latency["series"][:1])
    for noise in latency["noise_floor"]:
        noise.update(ci95=None, reason="fewer than 6 pairs of blocks")
    assert "for an A/A control, which compares an interface with itself (fewer than 6" in text(page(latency))


def encoded(values_us):
    histogram = HdrHistogram(1, 3_600_000_000, 3)
    for value in values_us:
        histogram.record_value(int(value))
    return histogram.encode().decode()


def test_quantiles_are_those_of_the_values():
    values = np.random.default_rng(1).lognormal(4.5, 0.5, 20_000).astype(int) + 1
    found = distribution(encoded(values), "here")
    at = np.asarray([0.0, 0.1, 0.5, 0.9, 0.99, 0.999, 1.0])
    assert found.total == len(values)
    # A microsecond bucket each, up to 2 ms: only the half microsecond of rounding is between them.
    assert found.quantiles(at) * 1000 == pytest.approx(np.quantile(values, at), abs=1.0)


def test_wide_buckets_keep_three_digits():
    found = distribution(encoded([1_234_567] * 10), "here")
    assert found.quantiles(np.asarray([0.5]))[0] == pytest.approx(1234.567, rel=1e-3)


def test_one_value():
    found = distribution(encoded([100]), "here")
    assert found.quantiles(np.asarray([0.0, 0.5, 1.0])) == pytest.approx([0.0995, 0.1, 0.1005])


def test_highest_supported_quantile_is_that_of_the_producer(latency):
    # The example's producer says that 3688 values support the 99.9th percentile, and fewer do not.
    assert distribution(encoded([5] * 3688), "here").highest_supported >= 0.999
    assert distribution(encoded([5] * 3687), "here").highest_supported < 0.999
    assert any("needs 3688" in r for s in latency["series"] for r in s.get("reasons", {}).values())


def test_nothing_recorded():
    assert distribution("", "here") is None
    assert distribution(encoded([]), "here") is None


@pytest.mark.parametrize("bad", ["x", "HISTFAAAA", "!!!!", "AAAA" * 20, "HISTFAAAAIt4nJNpmSzMwMBQzAABzFCaEcyZ3M5g"])
def test_bad_histogram_is_told_with_its_place(bad):
    with pytest.raises(ResultInvalidError, match=r"latency.json: at \$.series\[3\]"):
        distribution(bad, "latency.json: at $.series[3].histogram")


def test_series_hold_what_they_count(latency):
    for series in all_series(latency, "latency.json").values():
        assert series.service.total == series.data["count"]
        median = series.service.quantiles(np.asarray([0.5]))[0]
        assert median == pytest.approx(series.data["service_ms"]["p50"], rel=0.03, abs=0.002)

"""The history of a device over its runs, by the version of the device."""

import copy
import json

import pytest
from click.testing import CliRunner
from lxml import html

from reports.certificate.runs import MOST, history_html
from reports.cli.results import report


def text(element):
    return " ".join(element.text_content().split())


@pytest.fixture
def runs(tmp_path, described_result):
    """Three runs of a device in folders; the requirement that failed first passes in the last."""
    described_result["statement"]["robot"].pop("version", None)
    failed = next(i for i, one in enumerate(described_result["requirements"]) if one["verdict"] == "fail")
    for number, version in enumerate(("1.0", "1.1", "2.0")):
        one = copy.deepcopy(described_result)
        one["started"] = f"2026-11-2{number}T10:00:00Z"
        one["api"]["version"] = version
        if version == "2.0":
            one["requirements"][failed] |= {"verdict": "pass", "failures": []}
        folder = tmp_path / f"run {9 - number}"
        folder.mkdir()
        (folder / "result.json").write_text(json.dumps(one), encoding="utf-8")
    (tmp_path / "run 9" / "certificate.html").touch()
    return tmp_path, described_result["requirements"][failed]["id"]


def test_runs_are_shown_by_version_the_newest_first(runs):
    folder, failed = runs
    done = CliRunner().invoke(report, [str(folder)])
    assert (done.exit_code, done.stdout.strip()) == (0, str(folder / "history.html")), done.output
    page = html.document_fromstring((folder / "history.html").read_text(encoding="utf-8"))
    first, second = page.xpath("//table")
    assert [text(row.xpath("./th")[0]) for row in first.xpath(".//tbody/tr")] == ["2.0", "1.1", "1.0"]
    assert "1 fixed" in text(first.xpath(".//tbody/tr")[0])
    assert text(first.xpath(".//tbody/tr")[2]).endswith("The first run.")
    assert first.xpath(".//a/@href") == ["run%209/certificate.html"]
    row = next(row for row in second.xpath(".//tbody/tr") if failed in text(row.xpath("./th")[0]))
    assert row.xpath(".//@aria-label") == ["passed", "failed", "failed"]


def test_a_folder_with_a_result_of_its_own_has_no_history(runs, described_result):
    folder, _ = runs
    (folder / "result.json").write_text(json.dumps(described_result), encoding="utf-8")
    assert CliRunner().invoke(report, [str(folder)]).exit_code == 0
    assert not (folder / "history.html").exists()


def test_a_run_that_cannot_be_read_is_named(runs):
    folder, _ = runs
    (folder / "run 9" / "result.json").write_text("{", encoding="utf-8")
    done = CliRunner().invoke(report, [str(folder)])
    assert (done.exit_code, "run 9" in done.stderr) == (2, True), done.stderr


def test_there_is_a_most_of_runs(runs):
    folder, _ = runs
    for number in range(MOST):
        (folder / f"x{number}").mkdir()
        (folder / f"x{number}" / "result.json").touch()
    done = CliRunner().invoke(report, [str(folder)])
    assert (done.exit_code, f"more than the {MOST}" in done.stderr) == (2, True), done.stderr


def test_devices_are_kept_apart_and_hostile_text_stays_text(tmp_path, result, described_result, hostile_text):
    described_result["api"] |= {"title": hostile_text, "version": hostile_text}
    files = [(tmp_path / name / "result.json", one) for name, one in (("a", result), ("b", described_result))]
    page = history_html(files)
    assert len(html.document_fromstring(page).xpath("//h1")) == 2
    assert "<script>alert" not in page
    page.encode()

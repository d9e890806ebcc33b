"""The commands `roaas report` and `roaas compare`, and the function behind the first."""

import json

import pytest
from click.testing import CliRunner
from latencies import scaled

from reports.cli.results import compare, report
from reports.errors import ResultMissingError
from reports.rendering import render


def run(command, *arguments):
    return CliRunner().invoke(command, [str(argument) for argument in arguments])


def put(directory, name, document):
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / name
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def test_report_writes_what_belongs_to_both_results(tmp_path, result, latency):
    latency["series"] = latency["series"][:1]
    put(tmp_path, "result.json", result)
    put(tmp_path, "latency.json", latency)
    done = run(report, tmp_path)
    assert done.exit_code == 0
    names = ["certificate.html", "certificate.md", "junit.xml", "latency.html", "latency.md", "latency-junit.xml"]
    assert done.stdout.split() == [str(tmp_path / name) for name in names]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*names, "result.json", "latency.json"])


def test_one_result_alone(tmp_path, result):
    put(tmp_path, "result.json", result)
    assert [path.name for path in render(tmp_path)] == ["certificate.html", "certificate.md", "junit.xml"]


def test_rendering_again_replaces(tmp_path, result):
    put(tmp_path, "result.json", result)
    render(tmp_path)
    first = (tmp_path / "certificate.html").read_bytes()
    render(tmp_path)
    assert (tmp_path / "certificate.html").read_bytes() == first


def test_no_results(tmp_path):
    with pytest.raises(ResultMissingError, match=r"holds no result\.json, latency\.json, fleet\.json"):
        render(tmp_path)
    assert run(report, tmp_path).exit_code == 2
    done = run(report, tmp_path / "nowhere")
    assert (done.exit_code, "no such directory" in done.stderr) == (2, True), done.stderr


def test_broken_result_leaves_old_pages_alone(tmp_path, result):
    put(tmp_path, "result.json", result)
    render(tmp_path)
    before = (tmp_path / "certificate.html").read_bytes()
    result["verdict"] = "splendid"
    put(tmp_path, "result.json", result)
    done = run(report, tmp_path)
    assert (done.exit_code, "$.verdict" in done.stderr) == (2, True), done.stderr
    assert "splendid" in done.stderr
    assert (tmp_path / "certificate.html").read_bytes() == before


def test_compare_of_files_and_directories(tmp_path, latency):
    old = put(tmp_path / "old", "latency.json", latency)
    new = put(tmp_path / "new", "latency.json", scaled(latency, 2))
    assert run(compare, old, old).exit_code == 0
    done = run(compare, old.parent, new)
    assert (done.exit_code, "It got slower" in done.stdout) == (1, True), done.stdout
    assert run(compare, new, old).exit_code == 0
    assert run(compare, old, new, "--threshold", "150").exit_code == 0


def test_compare_writes_pages(tmp_path, latency):
    latency["series"] = latency["series"][:1]
    old = put(tmp_path, "latency.json", latency)
    done = run(compare, old, old, "--out", tmp_path / "made" / "here")
    assert done.exit_code == 0
    assert sorted(path.name for path in (tmp_path / "made" / "here").iterdir()) == ["compare.html", "compare.md"]
    assert "compare.html" not in done.stdout


def test_compare_of_an_invalid_result(tmp_path, latency):
    old = put(tmp_path / "old", "latency.json", latency)
    latency.update(valid=False, invalid_because=["generator CPU at 97 %"])
    done = run(compare, old, put(tmp_path / "new", "latency.json", latency))
    assert (done.exit_code, "generator CPU at 97 %" in done.stdout) == (4, True), done.stdout


def test_compare_of_what_cannot_be_compared(tmp_path, latency):
    old = put(tmp_path / "old", "latency.json", latency)
    latency["plan"]["rate"] = 1000.0
    done = run(compare, old, put(tmp_path / "new", "latency.json", latency))
    assert (done.exit_code, "only results under the same load can be compared" in done.stderr) == (2, True), done.stderr
    assert run(compare, old, tmp_path / "nowhere").exit_code == 2


def test_unwritable_place(tmp_path, latency):
    latency["series"] = latency["series"][:1]
    old = put(tmp_path, "latency.json", latency)
    (tmp_path / "file").write_text("", encoding="utf-8")
    done = run(compare, old, old, "--out", tmp_path / "file" / "below")
    assert (done.exit_code, "cannot write" in done.stderr) == (2, True), done.stderr


def test_broken_result_does_not_keep_the_other_from_being_written(tmp_path, result):
    put(tmp_path, "result.json", result)
    (tmp_path / "latency.json").write_text("{", encoding="utf-8")
    done = run(report, tmp_path)
    assert (done.exit_code, "latency.json: line 1" in done.stderr) == (2, True), done.stderr
    assert (tmp_path / "certificate.html").exists()
    assert not (tmp_path / "latency.html").exists()

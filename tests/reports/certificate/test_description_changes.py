"""What changed between two descriptions, as text, as pages, and the command that shows it."""

import json

import pytest
from click.testing import CliRunner

from reports.certificate.difference_page import changes_pages, changes_text, description_changes
from reports.cli.results import diff

GONE = (True, "GET /a", "status 404 is gone")
UNKNOWN = (None, "GET /a", "not compared: xml")
NEW = (False, "GET /b", "the operation is new")


class Door:
    """Stands in for roaas.py: every comparison finds the same."""

    def __init__(self, *found):
        self.found, self.asked = list(found), []

    def description_changes(self, old, new, *, allow_files=False):
        assert not allow_files
        self.asked.append((old, new))
        return self.found


def run(door, *arguments):
    return CliRunner().invoke(diff, list(map(str, arguments)), obj=door)


@pytest.mark.parametrize(
    ("found", "headline"),
    [
        ([], "No change breaks existing clients."),
        ([NEW], "No change breaks existing clients; 1 other change."),
        ([UNKNOWN, NEW], "Of 1 change it is not known whether existing clients break; 1 other change."),
        ([GONE], "1 change breaks existing clients."),
        ([GONE, (True, "GET /a", "gone"), NEW, NEW], "2 changes break existing clients; 1 other change."),
    ],
)
def test_the_headline_counts_changes_and_not_operations(found, headline):
    assert description_changes(found).headline == headline


def test_a_change_of_many_operations_is_told_once():
    found = description_changes([(True, f"GET /{number}", "status 404 is gone") for number in range(9)])
    assert changes_text(found).count("status 404 is gone") == 1
    assert "GET /4 and 4 more: status 404 is gone" in changes_text(found)
    page, markdown = changes_pages(found, ("a", "b"), "diff").values()
    assert page.count("status 404 is gone") == markdown.count("status 404 is gone") == 1
    assert "GET /8" in page


def test_hostile_text_stays_text(hostile_text):
    found = description_changes([(True, hostile_text, hostile_text)])
    page, markdown = changes_pages(found, (hostile_text, "b"), "diff").values()
    assert "<script>alert" not in page
    for text in (page, markdown, changes_text(found)):
        assert "\x1b" not in text


@pytest.mark.parametrize(
    ("found", "code"), [([GONE, NEW], 1), ([NEW], 0), ([], 0), ([UNKNOWN, NEW], 4), ([UNKNOWN, GONE], 1)]
)
def test_two_descriptions(tmp_path, found, code):
    (tmp_path / "old.yaml").write_text("openapi: 3.1.0")
    door = Door(*found)
    done = run(door, tmp_path / "old.yaml", "http://robot/openapi.json", "--out", tmp_path / "out")
    assert done.exit_code == code, done.output
    assert door.asked == [(str(tmp_path / "old.yaml"), "http://robot/openapi.json")]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["diff.html", "diff.md"]


def result_in(folder, document):
    (folder / "description").mkdir(parents=True)
    (folder / "result.json").write_text(json.dumps(document))
    (folder / "description" / "openapi.json").write_text('{"openapi": "3.1.0"}')
    return folder


@pytest.mark.parametrize(("found", "code"), [([GONE], 1), ([NEW], 0)])
def test_two_results_are_compared_with_their_descriptions(tmp_path, described_result, found, code):
    old, new = (result_in(tmp_path / name, described_result) for name in ("old", "new"))
    done = run(Door(*found), old, new / "result.json", "--out", tmp_path / "out")
    assert done.exit_code == code, done.output
    assert "No regression" in done.output
    assert found[0][2] in done.output
    names = {"diff.html", "diff.md", "description-diff.html", "description-diff.md"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == names


def test_a_result_is_compared_with_a_description(tmp_path, described_result):
    door = Door(GONE)
    done = run(door, result_in(tmp_path / "old", described_result), "http://robot/openapi.json")
    assert done.exit_code == 1
    assert door.asked == [(str(tmp_path / "old" / "description" / "openapi.json"), "http://robot/openapi.json")]


def test_a_result_without_a_description_is_not_compared_with_one(tmp_path, result):
    (tmp_path / "result.json").write_text(json.dumps(result))
    assert run(Door(), tmp_path, "http://robot/openapi.json").exit_code == 2

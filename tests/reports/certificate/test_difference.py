"""What changed between two results, each requirement under what happened to it."""

import copy
import json

import pytest
from click.testing import CliRunner
from lxml import html
from vendors import requirement

from reports.certificate.difference import Kind, difference
from reports.certificate.difference_page import SHOWN, difference_html, difference_markdown, difference_text
from reports.cli.results import diff

ACCEPTED = {"expected_failure": {"reason": "ticket 7", "expires": "2027-01-01"}}


@pytest.fixture
def pair(result):
    def of(old, new):
        results = []
        for items in (old, new):
            one = copy.deepcopy(result)
            one["requirements"] = items
            results.append(one)
        return results

    return of


LEVEL = {"level": "SHOULD"}
COURSES = [
    ("pass", "fail", {}, {Kind.NEW_FAILURE}, True),
    ("skip", "fail", {}, {Kind.NEW_FAILURE}, True),
    ("error", "fail", {}, {Kind.NEW_FAILURE}, True),
    ("pass", "skip", {}, {Kind.LOST}, True),
    ("pass", "error", {}, {Kind.LOST}, True),
    ("pass", "not-claimed", {}, {Kind.LOST}, True),
    ("pass", "warn", LEVEL, {Kind.NEW_WARNING}, False),
    ("pass", "skip", LEVEL, {Kind.LOST}, False),
    ("warn", "pass", LEVEL, {Kind.FIXED}, False),
    ("fail", "pass", {}, {Kind.FIXED}, False),
    ("fail", "skip", {}, {Kind.OUT_OF_SIGHT}, False),
    ("fail", "not-claimed", {}, {Kind.OUT_OF_SIGHT}, False),
    ("skip", "pass", {}, {Kind.FIRST_JUDGED}, False),
    ("not-claimed", "fail", {}, {Kind.FIRST_JUDGED}, False),
    ("not-claimed", "skip", {}, set(), False),
    ("pass", "pass", {}, set(), False),
    ("fail", "fail", {}, set(), False),
    ("skip", "error", {}, set(), False),
]


@pytest.mark.parametrize(("old", "new", "both", "kinds", "regression"), COURSES)
def test_each_course_has_its_name(pair, old, new, both, kinds, regression):
    found = difference(*pair([requirement(old, **both)], [requirement(new, **both)]))
    assert ({change.kind for change in found.changes}, bool(found.regressions)) == (kinds, regression)
    assert found.still == (old == new == "fail", old == new == "warn")


@pytest.mark.parametrize(
    ("old", "new", "kinds", "regression"),
    [
        (requirement("pass"), requirement("warn", **ACCEPTED), {Kind.ACCEPTED}, False),
        (requirement("fail"), requirement("warn", **ACCEPTED), {Kind.ACCEPTED}, False),
        (requirement("fail"), requirement("fail", **ACCEPTED), {Kind.ACCEPTED}, False),
        (requirement("warn", **ACCEPTED), requirement("warn", **ACCEPTED), set(), False),
        (requirement("warn", **ACCEPTED), requirement("fail"), {Kind.NEW_FAILURE}, True),
        (requirement("warn", **ACCEPTED), requirement("pass"), {Kind.FIXED}, False),
        (requirement("warn", "SHOULD"), requirement("fail"), {Kind.LEVEL}, False),
        (requirement("fail"), requirement("warn", "SHOULD"), {Kind.LEVEL}, False),
        (requirement("pass", "SHOULD"), requirement("fail"), {Kind.LEVEL, Kind.NEW_FAILURE}, True),
        (requirement("pass"), requirement("pass", text="It does more."), {Kind.TEXT}, False),
        (None, requirement("fail"), {Kind.ADDED}, False),
        (requirement("pass"), None, {Kind.REMOVED}, False),
    ],
)
def test_what_the_suite_or_the_baseline_changed_is_no_change_of_the_robot(pair, old, new, kinds, regression):
    found = difference(*pair([old] if old else [], [new] if new else []))
    assert ({change.kind for change in found.changes}, bool(found.regressions)) == (kinds, regression)


def test_how_the_runs_differ_is_told(pair):
    old, new = pair([], [])
    new["suite"]["version"] = "9.9"
    new["statement"]["robot"]["version"] = "3.0"
    old["statement"]["motion_allowed"] = False
    found = difference(old, new)
    told = [("firmware", "2.4.1", "3.0"), ("suite", "0.1.0", "9.9"), ("motion allowed", "no", "yes")]
    assert list(found.circumstances) == told
    for text in (difference_text(found), difference_markdown(found, ("a", "b")), difference_html(found, ("a", "b"))):
        assert "9.9" in text


def test_every_form_names_what_changed(pair):
    items = [requirement("pass", id_=f"http/x{number}") for number in range(SHOWN + 3)]
    found = difference(*pair(items, [{**item, "verdict": "fail"} for item in items]))
    page = html.document_fromstring(difference_html(found, ("old.json", "new.json")))
    assert page.xpath("//h2")[0].text_content().strip() == f"{SHOWN + 3} New failures"
    for text in (difference_text(found), difference_markdown(found, ("a", "b")), page.text_content()):
        for said in ("http/x0", "3 more", f"{SHOWN + 3} regressions"):
            assert said in text


@pytest.mark.parametrize(("new", "code"), [("fail", 1), ("pass", 0)])
def test_the_command(pair, tmp_path, new, code):
    folders = [tmp_path / "old", tmp_path / "new"]
    for folder, document in zip(folders, pair([requirement("pass")], [requirement(new)]), strict=True):
        folder.mkdir()
        (folder / "result.json").write_text(json.dumps(document))
    done = CliRunner().invoke(diff, [str(folders[0]), str(folders[1] / "result.json"), "--out", str(tmp_path / "out")])
    assert done.exit_code == code, done.output
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["diff.html", "diff.md"]


def test_what_cannot_be_read_is_no_difference(tmp_path):
    assert CliRunner().invoke(diff, [str(tmp_path), str(tmp_path)]).exit_code == 2


def test_requirements_that_were_merged_are_compared_with_the_one_that_asks_it_now(pair):
    merged = {**requirement(id_="http/one"), "aliases": ["http/two"]}
    found = difference(*pair([requirement(id_="http/one"), requirement("fail", id_="http/two")], [merged]))
    assert {change.kind for change in found.changes} == {Kind.MERGED, Kind.FIXED}
    assert found.changes[-1].reason == "It was http/one, http/two."
    same = difference(*pair([requirement(id_="http/one"), requirement(id_="http/two")], [merged]))
    assert {change.kind for change in same.changes} == {Kind.MERGED}


def test_what_is_beside_the_verdict_is_shown_and_no_regression(pair):
    """A result of an earlier suite has the requirement by its old id, and within the verdict."""
    old, new = pair([requirement("pass", id="http/host-missing")], [])
    beside = requirement("fail", id="web-server/host-missing", aliases=["http/host-missing"])
    new["web_server"] = {"requirements": [beside]}
    found = difference(old, new)
    assert {change.kind for change in found.changes} == {Kind.MERGED, Kind.NEW_WARNING}
    assert not found.regressions
    lost = {"requirements": [requirement("skip", id="web-server/host-missing", aliases=["http/host-missing"])]}
    assert not difference(old, {**new, "web_server": lost}).regressions


SAME = "Suite, statement, motion map, description, classes, effort and the operations called are the same in both runs."


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({}, SAME),
        ({"suite": {"version": "9.9", "contract": "1.2", "digest": "x"}}, "Changed between the runs: the suite ("),
        ({"digests": {"statement": "sha256:y", "map": "sha256:1"}}, "Changed between the runs: the statement. "),
        ({"digests": {"statement": "sha256:x", "map": "sha256:2"}}, "Changed between the runs: the motion map. "),
        ({"effort": "deep"}, "Changed between the runs: the effort ("),
        ({"classes": {"http": "pass"}}, "Changed between the runs: the classes judged ("),
        ({"selected": ["http/date"]}, "Changed between the runs: the requirements selected. "),
        (
            {"api": {"operations": [{"operation": "GET /x", "called": True}]}},
            "Changed between the runs: the operations",
        ),
    ],
)
def test_it_says_what_changed_the_suite_the_statement_the_map_or_the_device(pair, changes, told):
    old, new = pair([requirement("pass")], [requirement("fail")])
    old["digests"] = new["digests"] = {"statement": "sha256:x", "map": "sha256:1"}
    new.update(changes)
    found = difference(old, new)
    assert found.origin.startswith(told)
    for text in (difference_text(found), difference_html(found, ("a", "b")), difference_markdown(found, ("a", "b"))):
        assert told.split("(")[0] in text.replace("\\", "")


def test_a_new_version_of_the_device_explains_a_change(pair):
    old, new = pair([requirement("pass")], [requirement("fail")])
    new["statement"]["robot"]["version"] = "9.0"
    assert difference(old, new).origin == "Changed between the runs: the device (2.4.1 → 9.0)."


def test_a_description_alone_is_no_other_suite_and_a_version_is_told_of_the_statement(pair):
    old, new = pair([requirement("pass")], [requirement("fail")])
    for result, number in ((old, "1"), (new, "2")):
        result["suite"]["digest"] = result["digests"]["statement"] = f"sha256:{number}"
        result["digests"]["contract"] = {"openapi.json": f"sha256:{number}"}
        result["api"] = {"version": f"{number}.0", "operations": []}
        result["statement"]["robot"]["version"] = f"{number}.0"
    found = difference(old, new)
    assert found.origin.startswith(
        "Changed between the runs: the statement, at least the device's version in it, the description (1.0 → 2.0), "
        "the device (1.0 → 2.0). "
    )
    assert "suite's digest" not in {name for name, _, _ in found.circumstances}
    new["digests"]["contract"] = old["digests"]["contract"]
    assert difference(old, new).origin.startswith("Changed between the runs: the suite, the statement")

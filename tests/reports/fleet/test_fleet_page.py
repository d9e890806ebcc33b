"""The page of a fleet: a cell is green where a robot passed a class without an accepted failure, and nowhere else."""

from lxml import html

from reports.fleet import fleet_html, fleet_markdown
from reports.pages.matrix import Mark, marks


def cells(document):
    page = html.document_fromstring(fleet_html(document))
    names = [name.text_content() for name in page.xpath("//table[contains(@class, 'matrix')]/thead//th")][1:]
    rows = page.xpath("//table[contains(@class, 'matrix')]/tbody/tr")
    return {
        row.xpath("string(th/a | th[not(a)]/text())").strip(): dict(
            zip(names, [cell.get("class").split()[1] for cell in row.xpath("td")], strict=True)
        )
        for row in rows
    }


def test_green_is_what_a_robot_may_be_trusted_with(fleet):
    found = cells(fleet)
    for robot in fleet["robots"]:
        green = {name for name, tone in found[robot["name"]].items() if tone == "good"}
        assert green == set(robot["trusted"]), robot["name"]
    assert found["courier-04"]["http"] == "warning", "it passed by an accepted failure"
    assert found["courier-04"]["rest-resources"] == "bad"


def test_nothing_of_a_run_that_was_cut_short_is_green(fleet):
    for robot in fleet["robots"]:
        robot["outcome"] = "interrupted"
    assert not any("good" in row.values() for row in cells(fleet).values())
    assert marks({"http": "fail"}, ["http"]) == {"http": Mark.FAILED}, "a contradiction is never green"


def test_the_filter_numbers_the_columns_that_are_green(fleet):
    page = html.document_fromstring(fleet_html(fleet))
    names = [name.text_content() for name in page.xpath("//table//thead//th")][1:]
    for robot, row in zip(fleet["robots"], page.xpath("//tr[@data-may]"), strict=True):
        assert {names[int(number)] for number in row.get("data-may").split()} == set(robot["trusted"])
    assert len(page.xpath("//input[@name='may']")) == len(names) + 1


def test_markdown_says_who_may_do_what(fleet):
    text = fleet_markdown(fleet)
    assert text.startswith("## ❌ 1 of 4 robots is conformant")
    assert "| `courier-07` | given up | nothing | given up after 3600 s, its time limit |" in text

"""Write fleet.json as HTML and Markdown: which robots passed, failed or could not be judged."""

from collections.abc import Mapping
from typing import Any

from reports.pages.matrix import Mark, Matrix, Row, marks
from reports.pages.page import html_page, markdown_page, opened

OUTCOMES = {
    "conformant": ("good", "conformant"),
    "not-conformant": ("bad", "not conformant"),
    "inconclusive": ("warning", "inconclusive"),
    "unreachable": ("warning", "not reached"),
    "given-up": ("warning", "given up"),
    "not-judged": ("warning", "not judged"),
    "interrupted": ("quiet", "interrupted"),
    "not-started": ("quiet", "not started"),
}
"""Tone and words for each outcome."""


def fleet_html(document: Mapping[str, Any]) -> str:
    """Return a valid `roaas-fleet/1` document as an HTML page, which links to the robots' certificates."""
    return html_page("fleet.html.j2", **_values(document))


def fleet_markdown(document: Mapping[str, Any]) -> str:
    """Return a valid `roaas-fleet/1` document as short Markdown for a pull request."""
    return markdown_page("fleet.md.j2", **_values(document))


def _values(document: Mapping[str, Any]) -> dict[str, Any]:
    robots = document["robots"]
    conformant = sum(robot["outcome"] == "conformant" for robot in robots)
    return {
        "fleet": document,
        "matrix": Matrix(tuple(map(_row, robots)), document["class_titles"]),
        "key": tuple(Mark),
        "outcomes": OUTCOMES,
        "headline": f"{conformant} of {len(robots)} robots {'is' if conformant == 1 else 'are'} conformant",
        "all_conformant": conformant == len(robots),
    }


def _row(robot: Mapping[str, Any]) -> Row:
    tone, word = OUTCOMES[robot["outcome"]]
    stated = robot.get("robot", {})
    maker = ", ".join(str(part) for part in (stated.get("name"), stated.get("vendor"), stated.get("version")) if part)
    effort = f"{robot['effort']} effort" if robot.get("effort") else ""
    moved = "" if robot.get("motion_allowed", True) else "not allowed to move"
    run = ", ".join(filter(None, [f"{robot['seconds']:.0f} s" if robot["seconds"] else "", effort, moved]))
    notes = (maker if maker != robot["name"] else "", run, robot["reason"])
    return Row(
        name=robot["name"],
        marks=marks(
            robot.get("classes", {}),
            robot["trusted"],
            stands=robot["outcome"] in {"conformant", "not-conformant", "inconclusive"},
        ),
        tone=tone,
        word=word,
        notes=tuple(opened(note) for note in notes if note),
        href=f"{robot['folder']}/certificate.html" if robot["result"] else "",
    )

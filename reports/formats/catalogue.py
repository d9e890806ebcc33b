"""List all output formats by the name that `roaas report --format` takes, with their file names.

The shortest is here too: a badge for shields.io's endpoint, green only if the robot is conformant.
"""

import json
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from reports.certificate.page import certificate_markdown, verdict_words
from reports.formats.ci_systems import ctrf, junit
from reports.formats.code_hosts import annotations, gitlab, sarif

_COLOURS = {"conformant": "brightgreen", "not-conformant": "red", "inconclusive": "lightgrey"}


def badge(result: Mapping[str, Any]) -> str:
    """Return the JSON of a shields.io badge with the verdict of a valid `roaas-result/1` document."""
    verdict, colour = verdict_words(result)[result["verdict"]].lower(), _COLOURS[result["verdict"]]
    values = list(result["classes"].values())
    text = result.get("verdict_line") or f"{verdict} ({values.count('pass')} of {len(values)} classes)"
    if result.get("accepted_until"):
        text, colour = f"{verdict}, known failures until {result['accepted_until']}", "orange"
    if result.get("interrupted"):
        text, colour = f"{verdict}, interrupted", "red" if result["verdict"] == "not-conformant" else "lightgrey"
    return json.dumps({"schemaVersion": 1, "label": "RoAAS", "message": text, "color": colour}, indent=1) + "\n"


class Format(NamedTuple):
    """An output format: the file name that its readers expect, and the function that converts a result to its text."""

    file: str
    write: Callable[[Mapping[str, Any]], str]


FORMATS = {
    "junit": Format("junit.xml", junit),
    "sarif": Format("roaas.sarif", sarif),
    "ctrf": Format("ctrf-report.json", ctrf),
    "gitlab": Format("gl-code-quality-report.json", gitlab),
    "markdown": Format("certificate.md", certificate_markdown),
    "annotations": Format("annotations.txt", annotations),
    "badge": Format("badge.json", badge),
}

"""List all output formats by the name that `roaas report --format` takes, with their file names."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from reports.certificate.markdown import certificate_markdown
from reports.formats.badge import badge
from reports.formats.ctrf import ctrf
from reports.formats.gitlab import annotations, gitlab
from reports.formats.junit import junit
from reports.formats.sarif import sarif


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

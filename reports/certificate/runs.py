"""Write the history of a device: the results of its runs, one after the other, by the version of the device."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from reports.certificate.difference import Difference, difference
from reports.certificate.difference_page import headline
from reports.certificate.page import Certificate, certificate, verdict_words
from reports.errors import ResultMissingError, ResultUnreadableError
from reports.given_files import showing
from reports.pages.page import html_page, write_pages
from reports.reading import RESULT_NAME, read_result

HISTORY_NAME = "history.html"
MOST = 200
"""Runs of one history."""
COLUMNS = 10
"""Runs, the newest ones, whose verdict on a requirement is shown."""
_BROKEN = frozenset({"fail", "warn", "error"})


@dataclass(frozen=True, slots=True)
class Run:
    """One run of a device.

    Attributes:
        certificate: its content.
        page: where its certificate is, relative to the history; empty if there is none.
        change: what changed since the run before; None for the first one.
    """

    certificate: Certificate
    page: str = ""
    change: Difference | None = None

    @property
    def version(self) -> str:
        """Return the version of the device: as the statement names it, or `info.version` of its description."""
        result = self.certificate.result
        return str(result["statement"]["robot"].get("version") or result.get("api", {}).get("version") or "not named")

    @property
    def verdict(self) -> str:
        """Return the verdict in words."""
        result = self.certificate.result
        return verdict_words(result)[result["verdict"]]

    @property
    def since(self) -> str:
        """Return in a sentence or two what changed since the run before."""
        return f"{headline(self.change)} {self.change.origin}" if self.change else "The first run."

    @property
    def shortly(self) -> str:
        """Return the same, without the remark that nothing but the device changed."""
        if self.change and not self.change.is_explained:
            return headline(self.change)
        return self.since

    def count(self, verdict: str) -> int:
        """Return how many requirements have that verdict."""
        return len(self.certificate.with_verdict(verdict))

    def of(self, requirement: str) -> str:
        """Return the verdict on a requirement, or an empty text if the run does not know it."""
        found = (item["verdict"] for item in self.certificate.result["requirements"] if item["id"] == requirement)
        return next(found, "")


@dataclass(frozen=True, slots=True)
class Device:
    """A device with its runs, the newest first."""

    name: str
    runs: tuple[Run, ...]

    @property
    def broken(self) -> list[tuple[str, str]]:
        """Return id and text of each requirement that one of the shown runs does not meet, or could not judge."""
        found: dict[str, str] = {}
        for run in self.runs[:COLUMNS]:
            for item in run.certificate.result["requirements"]:
                if item["verdict"] in _BROKEN:
                    found.setdefault(item["id"], item["text"])
        return sorted(found.items())


def results_below(folder: Path) -> list[Path]:
    """Return the result files of conformance runs in the folders of a folder."""
    try:
        return sorted(path for path in folder.glob(f"*/{RESULT_NAME}") if path.is_file())
    except OSError as error:
        raise ResultUnreadableError(f"{folder}: {error.strerror or error}") from error


def write_history(folder: Path) -> list[Path]:
    """Write history.html into a folder whose folders hold results, and return its path.

    Raises:
        ReportError: there are no results or too many, or one cannot be read.
    """
    paths = results_below(folder)
    if not paths:
        raise ResultMissingError(f"{folder}: no folder in it holds a {RESULT_NAME}")
    if len(paths) > MOST:
        raise ResultUnreadableError(f"{folder}: {len(paths)} results are more than the {MOST} that a history shows")
    with showing(folder):
        return write_pages(folder, {HISTORY_NAME: history_html([(path, read_result(path)) for path in paths])})


def history_html(found: Sequence[tuple[Path, Mapping[str, Any]]]) -> str:
    """Return the history of some results as an HTML page.

    Args:
        found: each file, in a folder of the history's, with its content.
    """
    by_device: dict[str, list[tuple[Path, Mapping[str, Any]]]] = {}
    for path, result in sorted(found, key=lambda one: one[1]["started"]):
        by_device.setdefault(certificate(result).robot, []).append((path, result))
    devices = [Device(name, tuple(reversed(_runs(own)))) for name, own in by_device.items()]
    return html_page("runs.html.j2", devices=devices, columns=COLUMNS)


def _runs(found: Sequence[tuple[Path, Mapping[str, Any]]]) -> list[Run]:
    runs: list[Run] = []
    for path, result in found:
        change = difference(runs[-1].certificate.result, result) if runs else None
        page = f"{quote(path.parent.name)}/certificate.html" if path.with_name("certificate.html").is_file() else ""
        runs.append(Run(certificate(result), page, change))
    return runs

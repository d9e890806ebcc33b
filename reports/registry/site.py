"""Write the files of a registry site: an index of robots and classes, a page for each robot, and the envelopes."""

import datetime as dt
import re
from collections.abc import Sequence
from pathlib import Path

from reports.attestation.statement import RESULT_SUBJECT, Run
from reports.certificate.described import DESCRIBED_CLASS, WORDS
from reports.certificate.difference import MEANINGS, Kind
from reports.certificate.difference_page import SHOWN, headline
from reports.errors import ResultUnreadableError
from reports.pages.matrix import Mark, Matrix, Row, marks
from reports.pages.page import html_page, write_pages
from reports.registry.entries import History, Refused, Standing, firmware_changes

INDEX = "index.html"
ROBOTS, ENVELOPES = "robots", "envelopes"
# File names of an earlier build. Outdated pages are deleted, because they would still be green.
_OURS = {ROBOTS: re.compile(r"[a-z0-9-]+-[0-9a-f]{12}\.html"), ENVELOPES: re.compile(r"[0-9a-f]{64}\.intoto\.json")}
_TONES = {"conformant": "good", "not-conformant": "bad"}
# No change is green, because the certificate that fixed a failure may not count.
_CHANGE_TONES = {Kind.NEW_FAILURE: "bad", Kind.LOST: "warning"}


def write_site(site: Path, found: Sequence[History], refused: Sequence[Refused], now: dt.datetime) -> list[Path]:
    """Write the registry site, delete outdated pages and envelopes of an earlier build, and return the paths written.

    Raises:
        ResultUnreadableError: the folder cannot be written to.
    """
    robots = {history.page: history for history in found}
    envelopes = {
        _envelope(standing): standing.certificate
        for history in found
        for standing in history.standings
        if standing.certificate.publishable
    }
    try:
        for folder, names in ((ROBOTS, robots), (ENVELOPES, envelopes)):
            # A link in its place would lead out of the site.
            if (site / folder).is_symlink():
                (site / folder).unlink()
            for path in (site / folder).glob("*"):
                if path.name not in names and _OURS[folder].fullmatch(path.name):
                    path.unlink()
    except OSError as error:
        raise ResultUnreadableError(f"{site}: cannot write there: {error.strerror or error}") from error
    # One after the other: the pages of ten thousand robots do not fit into memory at once.
    written: list[Path] = []
    for name, history in robots.items():
        written += write_pages(site / ROBOTS, {name: _robot_html(history, now)})
    for name, certificate in envelopes.items():
        written += write_pages(site / ENVELOPES, {name: certificate.octets.decode()})
    return [*write_pages(site, {INDEX: _index_html(found, refused, now)}), *written]


def _index_html(found: Sequence[History], refused: Sequence[Refused], now: dt.datetime) -> str:
    counting = sum(history.current.stands for history in found)
    return html_page(
        "registry.html.j2",
        matrix=Matrix(tuple(map(_row, found))),
        refused=refused,
        counting=counting,
        robots=len(found),
        key=tuple(Mark),
        now=_minute(now),
    )


def _robot_html(history: History, now: dt.datetime) -> str:
    return html_page(
        "registry-robot.html.j2",
        history=history,
        runs=[(standing, *_word(standing), _envelope(standing)) for standing in history.standings],
        verdict=_verdict,
        marks=_marks(history.current),
        changes=[
            (change, headline(change.found) if change.found else "") for change in firmware_changes(history.firmwares)
        ],
        meanings=MEANINGS,
        tones=_CHANGE_TONES,
        shown=SHOWN,
        until=_until(history.current),
        result_name=RESULT_SUBJECT,
        now=_minute(now),
    )


def _row(history: History) -> Row:
    standing = history.current
    run = standing.certificate.run
    tone, word = _word(standing)
    keys = len({one.certificate.key for one in history.standings})
    firmware = f"firmware {run.robot.version}" if run.robot.version else ""
    notes = (
        ", ".join(filter(None, [history.vendor, firmware])),
        f"{run.finished[:10]}, {_judged_by(run)}",
        f"key {standing.certificate.key[:16]}…" + (f", {keys} keys in all" if keys > 1 else ""),
    )
    return Row(
        name=history.name,
        marks=_marks(standing),
        tone=tone,
        word=word,
        notes=tuple(filter(None, notes)),
        href=f"{ROBOTS}/{history.page}",
        until=_until(standing),
    )


def _marks(standing: Standing) -> dict[str, Mark]:
    classes = standing.certificate.run.classes
    return marks(classes, standing.trusted, stands=standing.stands)


def _word(standing: Standing) -> tuple[str, str]:
    """Return tone and words: the verdict of a certificate that counts, or the first reason against it."""
    if not standing.stands:
        return "quiet", standing.against[0]
    run = standing.certificate.run
    return _TONES.get(run.verdict, "warning"), _verdict(run)


def _verdict(run: Run) -> str:
    """Return the verdict in words; a device that is judged by its own description conforms to no contract."""
    words = WORDS.get(run.verdict) if DESCRIBED_CLASS in run.classes else None
    return words[0].lower() + words[1:] if words else run.verdict.replace("-", " ")


def _judged_by(run: Run) -> str:
    by = f"set {run.requirement_set.name}" if run.requirement_set else "a contract of its own"
    return f"RoAAS {run.suite.version}, {by}, {run.effort} effort"


def _envelope(standing: Standing) -> str:
    return f"{standing.certificate.digest}.intoto.json"


def _until(standing: Standing) -> str:
    return standing.until.strftime("%Y-%m-%dT%H:%M:%SZ") if standing.stands and standing.until else ""


def _minute(moment: dt.datetime) -> str:
    return moment.strftime("%Y-%m-%d, %H:%M UTC")

"""Writes the pages that belong to the result files of a directory."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from reports.attestation.envelope import ENVELOPE_NAME, open_envelope, read_envelope, statement_in
from reports.attestation.statement import RESULT_SUBJECT, sha256
from reports.certificate.page import certificate_html, certificate_print
from reports.certificate.seal import Seal
from reports.errors import ReportError, ResultMissingError
from reports.fleet.page import fleet_html, fleet_markdown
from reports.formats.catalogue import FORMATS
from reports.pages.page import write_pages
from reports.reading import FLEET_NAME, LATENCY_NAME, RESULT_NAME, read_fleet, read_latency, read_result

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from reports.attestation.signing import Notary


def render(directory: Path, notary: Notary | None = None) -> list[Path]:
    """Write what belongs to the result files in a directory, beside them.

    `result.json` gives certificate.html, certificate.md and junit.xml, where it is signed certificate-print.html too,
    and with a notary the signed certificate.intoto.json; `latency.json` gives latency.html and latency.md;
    `fleet.json` gives fleet.html and fleet.md. Each file is replaced at once, so that a reader never sees half of one.
    Where one of the results is broken, the others' pages are written before the error is raised.

    Returns:
        The files written.

    Raises:
        ResultMissingError: there is no such directory, or no result file in it.
        ResultUnreadableError: a file cannot be read, or the directory not be written to.
        ResultGarbledError: a file is no JSON.
        ResultFormatError: a file is of another format or version.
        ResultInvalidError: a file breaks its schema, a histogram in it cannot be decoded, or what is to be signed
            contradicts itself.
    """
    if not directory.is_dir():
        raise ResultMissingError(f"{directory}: there is no such directory")
    pages: dict[str, Callable[[Path], dict[str, str]]] = {
        RESULT_NAME: partial(_conformance, notary=notary),
        LATENCY_NAME: _latency,
        FLEET_NAME: _fleet,
    }
    there = {directory / name: pages_of for name, pages_of in pages.items() if (directory / name).exists()}
    if not there:
        raise ResultMissingError(f"{directory}: it holds no {', '.join(pages)}")
    written: list[Path] = []
    problems: list[ReportError] = []
    for path, pages_of in there.items():
        try:
            written += write_pages(directory, pages_of(path))
        except ReportError as error:
            problems.append(error)
    if problems:
        # One result is no worse for the other's fault: what could be written is there by now.
        raise problems[0]
    return written


def render_formats(directory: Path, names: Sequence[str]) -> list[Path]:
    """Write a directory's `result.json` in the formats of these names, as `reports.formats.catalogue` has them.

    Returns:
        The files written.

    Raises:
        ReportError: as `render`, of `result.json` alone.
    """
    return write_pages(directory, written_as(read_result(directory / RESULT_NAME), names))


def written_as(result: Mapping[str, Any], names: Sequence[str]) -> dict[str, str]:
    """A valid `roaas-result/1` document in some formats: each file's name and its text."""
    return {FORMATS[name].file: FORMATS[name].write(result) for name in names}


def _conformance(path: Path, notary: Notary | None) -> dict[str, str]:
    document = read_result(path)
    digest = sha256(path.read_bytes())
    seal = Seal(digest, notary.key if notary else _signed_by(path, digest))
    pages = {"certificate.html": certificate_html(document, seal), **written_as(document, ("markdown", "junit"))}
    if seal.key:
        pages["certificate-print.html"] = certificate_print(document, seal)
    return {**pages, ENVELOPE_NAME: notary.envelope(path, document, pages)} if notary else pages


def _signed_by(path: Path, digest: str) -> str | None:
    """The key that signed this very result, as the envelope beside it says: it is shown, and nothing follows."""
    try:
        opened = open_envelope(read_envelope(path.with_name(ENVELOPE_NAME)))
        return opened.keyid if statement_in(opened).digest_of(RESULT_SUBJECT) == digest else None
    except ReportError:
        return None


def _fleet(path: Path) -> dict[str, str]:
    document = read_fleet(path)
    return {"fleet.html": fleet_html(document), "fleet.md": fleet_markdown(document)}


def _latency(path: Path) -> dict[str, str]:
    # Loads matplotlib and numpy, which a certificate does without: that is worth half a second.
    from reports.latency.page import latency_html, latency_markdown  # noqa: PLC0415 - see above

    document = read_latency(path)
    return {"latency.html": latency_html(document, str(path)), "latency.md": latency_markdown(document, str(path))}

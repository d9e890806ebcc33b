"""Write all pages and CI files for the result files in a directory."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from reports.attestation.envelope import ENVELOPE_NAME, open_envelope, read_envelope, statement_in
from reports.attestation.statement import RESULT_SUBJECT, sha256
from reports.certificate.moves_drawn import grid, pictures
from reports.certificate.page import Seal, certificate_html, certificate_print
from reports.errors import ReportError, ResultMissingError, ResultUnsignableError
from reports.fleet import fleet_html, fleet_markdown
from reports.formats.catalogue import FORMATS, latency_junit
from reports.given_files import read_octets, showing
from reports.pages.page import write_pages
from reports.reading import FLEET_NAME, LATENCY_NAME, RESULT_NAME, read_fleet, read_latency, read_result

if TYPE_CHECKING:
    # It takes a twentieth of a second, and few results are signed.
    from reports.attestation.signing import Notary


def render(directory: Path, notary: "Notary | None" = None) -> list[Path]:
    """Write the pages for each result file in a directory, and return their paths.

    `result.json` becomes certificate.html, certificate.md and junit.xml; if it is signed, certificate-print.html as
    well, and with a notary the signed certificate.intoto.json. `latency.json` becomes latency.html, latency.md and
    latency-junit.xml, `fleet.json` fleet.html and fleet.md. If one result is broken, the pages of the others come
    first.

    Raises:
        ResultMissingError: the directory does not exist, or holds no result file.
        ResultUnreadableError: a file cannot be read, or the directory cannot be written to.
        ResultGarbledError: a file is not JSON.
        ResultFormatError: a file is of another format or version.
        ResultInvalidError: a file violates its schema, a histogram cannot be decoded, or a result to sign contradicts
            itself.
    """
    if not directory.is_dir():
        raise ResultMissingError(f"{directory}: there is no such directory")
    pages: dict[str, Callable[[Path], dict[str, str]]] = {
        RESULT_NAME: partial(_conformance, notary=notary),
        LATENCY_NAME: _latency,
        FLEET_NAME: _fleet,
    }
    found = [directory / name for name in pages if (directory / name).exists()]
    if not found:
        raise ResultMissingError(f"{directory}: it holds no {', '.join(pages)}")
    written: list[Path] = []
    problems: list[ReportError] = []
    for path in found:
        try:
            with showing(path):
                made = pages[path.name](path)
            written += write_pages(directory, made)
        except ReportError as error:
            problems.append(error)
            if isinstance(error, ResultUnsignableError):
                written += write_pages(directory, _conformance(path, None))
    if problems:
        raise problems[0]
    return written


def render_formats(directory: Path, names: Sequence[str]) -> list[Path]:
    """Write a directory's `result.json` in the named formats (see `reports.formats.catalogue`), and return the paths.

    Raises:
        ReportError: as for `render`.
    """
    path = directory / RESULT_NAME
    with showing(path):
        made = _in_formats(read_result(path), names)
    return write_pages(directory, made)


def _in_formats(result: Mapping[str, Any], names: Sequence[str]) -> dict[str, str]:
    return {FORMATS[name].file: FORMATS[name].write(result) for name in names}


def _conformance(path: Path, notary: "Notary | None") -> dict[str, str]:
    document = read_result(path)
    octets = read_octets(path, root=path.parent)
    digest = sha256(octets)
    if notary:
        notary.check(path, octets, document)
    seal = Seal(digest, notary.key if notary else _signed_by(path, digest))
    drawn = pictures(path.parent, document) if "motion" in document["classes"] else []
    shown = grid(path.parent, document) if "states" in document["classes"] else None
    pages = {
        "certificate.html": certificate_html(document, seal, drawn, shown),
        **_in_formats(document, ("markdown", "junit")),
    }
    if seal.key:
        pages["certificate-print.html"] = certificate_print(document, seal)
    return {**pages, ENVELOPE_NAME: notary.envelope(path, octets, document, pages)} if notary else pages


def _signed_by(path: Path, digest: str) -> str | None:
    """Return the id of the signing key that the envelope beside a result file names, without verifying the signature.

    Return None if no envelope exists, or if it is malformed or signs another result than the one with this digest.
    """
    try:
        opened = open_envelope(read_envelope(path.with_name(ENVELOPE_NAME)))
        return opened.keyid if statement_in(opened).digest_of(RESULT_SUBJECT) == digest else None
    except ReportError:
        return None


def _fleet(path: Path) -> dict[str, str]:
    document = read_fleet(path)
    return {"fleet.html": fleet_html(document), "fleet.md": fleet_markdown(document)}


def _latency(path: Path) -> dict[str, str]:
    # Loads matplotlib and numpy, half a second that a certificate does not need.
    from reports.latency.page import latency_html, latency_markdown  # noqa: PLC0415 - see above

    document = read_latency(path)
    return {
        "latency.html": latency_html(document, str(path)),
        "latency.md": latency_markdown(document, str(path)),
        "latency-junit.xml": latency_junit(document),
    }

"""Writes the pages that belong to the result files of a directory."""

from pathlib import Path

from reports.certificate.junit import junit
from reports.certificate.page import certificate_html, certificate_markdown
from reports.errors import ReportError, ResultMissingError
from reports.pages.page import write_pages
from reports.reading import LATENCY_NAME, RESULT_NAME, read_latency, read_result


def render(directory: Path) -> list[Path]:
    """Write what belongs to the result files in a directory, beside them.

    `result.json` gives certificate.html, certificate.md and junit.xml; `latency.json` gives latency.html and
    latency.md. Each file is replaced at once, so that a reader never sees half of one. Where one of the two
    results is broken, the other's pages are written before the error is raised.

    Returns:
        The files written.

    Raises:
        ResultMissingError: there is no such directory, or neither result file in it.
        ResultUnreadableError: a file cannot be read, or the directory not be written to.
        ResultGarbledError: a file is no JSON.
        ResultFormatError: a file is of another format or version.
        ResultInvalidError: a file breaks its schema, or a histogram in it cannot be decoded.
    """
    if not directory.is_dir():
        raise ResultMissingError(f"{directory}: there is no such directory")
    result, latency = directory / RESULT_NAME, directory / LATENCY_NAME
    if not result.exists() and not latency.exists():
        raise ResultMissingError(f"{directory}: it holds neither {RESULT_NAME} nor {LATENCY_NAME}")
    written: list[Path] = []
    problems: list[ReportError] = []
    for path, pages_of in ((result, _conformance), (latency, _latency)):
        if not path.exists():
            continue
        try:
            written += write_pages(directory, pages_of(path))
        except ReportError as error:
            problems.append(error)
    if problems:
        # One result is no worse for the other's fault: what could be written is there by now.
        raise problems[0]
    return written


def _conformance(path: Path) -> dict[str, str]:
    document = read_result(path)
    return {
        "certificate.html": certificate_html(document),
        "certificate.md": certificate_markdown(document),
        "junit.xml": junit(document).decode(),
    }


def _latency(path: Path) -> dict[str, str]:
    # Loads matplotlib and numpy, which a certificate does without: that is worth half a second.
    from reports.latency.page import latency_html, latency_markdown  # noqa: PLC0415 - see above

    document = read_latency(path)
    return {"latency.html": latency_html(document, str(path)), "latency.md": latency_markdown(document, str(path))}

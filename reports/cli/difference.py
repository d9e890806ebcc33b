"""Define the command `roaas diff`."""

import os
from pathlib import Path

import click

from reports.certificate.description_changes import changes_pages, changes_text, description_changes
from reports.certificate.difference import difference
from reports.certificate.difference_page import difference_html, difference_markdown, difference_text
from reports.cli.options import FOLDER, FrontDoor
from reports.errors import ReportError
from reports.given_files import parsed, read_octets, showing
from reports.pages.page import write_pages
from reports.reading import RESULT_NAME, read_result

EXIT_REGRESSIONS, EXIT_NOT_KNOWN = 1, 4
# Where a run leaves the description that it judged a device by.
_DESCRIPTION = Path("description") / "openapi.json"


@click.command()
@click.argument("old")
@click.argument("new")
@click.option("--allow-files", is_flag=True, help="A description in a file may refer to files outside its folder.")
@click.option("--out", type=FOLDER, metavar="DIR", help="Write diff.html and diff.md into DIR.")
@click.pass_obj
def diff(door: FrontDoor, old: str, new: str, out: Path | None, *, allow_files: bool) -> None:
    """Show what changed from OLD to NEW: two results of `roaas certify`, or two descriptions of an API.

    A result is result.json or the directory that holds it. A regression is a MUST that fails now and did not before, or
    that passed before and could not be judged now. A description is the URL or file of an OpenAPI or Swagger document.
    Of two devices that were judged by their own descriptions, the descriptions are compared as well.

    Exit code: 0 no regression, and nothing that breaks existing clients; 1 something does; 2 something cannot be read;
    4 nothing is known to, but a change could not be compared.
    """
    worse, unknown, pages = False, False, {}
    if not (_is_description(old) or _is_description(new)):
        paths = [path / RESULT_NAME if path.is_dir() else path for path in map(Path, (old, new))]
        names = str(paths[0]), str(paths[1])
        results = read_result(paths[0]), read_result(paths[1])
        with showing(f"{names[0]} and {names[1]}"):
            found = difference(*results)
            worse = bool(found.regressions)
            pages = {"diff.html": difference_html(found, names), "diff.md": difference_markdown(found, names)}
            text = difference_text(found)
        click.echo(text)
    described = _described(old), _described(new)
    if described[0] and described[1]:
        changed = description_changes(door.description_changes(*described, allow_files=allow_files))
        worse |= bool(changed.breaking)
        unknown = bool(changed.unknown)
        click.echo(f"\nThe descriptions: {changes_text(changed)}" if pages else changes_text(changed))
        pages |= changes_pages(changed, (old, new), "description-diff" if pages else "diff")
    elif not pages:
        raise click.UsageError(f"{new if described[0] else old} is neither a description nor a result with one")
    for path in write_pages(out, pages) if out is not None else ():
        click.echo(path, err=True)
    raise SystemExit(EXIT_REGRESSIONS if worse else EXIT_NOT_KNOWN if unknown else 0)


def _is_description(source: str) -> bool:
    """Return whether an argument is a URL, or a file that is no result."""
    return "://" in source or (Path(source).is_file() and not _is_result(Path(source)))


def _is_result(path: Path) -> bool:
    try:
        document = parsed(read_octets(path).decode("utf-8"))
    except (ReportError, ValueError, RecursionError):
        return path.name == RESULT_NAME
    return not isinstance(document, dict) or not {"openapi", "swagger"} & document.keys()


def _described(source: str) -> str:
    """Return the description that an argument is, or that is beside the result; empty if there is none."""
    if _is_description(source):
        return source
    path = Path(source)
    beside = (path if path.is_dir() else path.parent) / _DESCRIPTION
    # Whatever is there in its place is refused by the reader.
    return str(beside) if os.path.lexists(beside) else ""

"""Define the commands that read result files: `roaas report`, `roaas compare` and `roaas diff`."""

import os
from pathlib import Path

import click

from reports.certificate.difference import difference
from reports.certificate.difference_page import (
    changes_pages,
    changes_text,
    description_changes,
    difference_html,
    difference_markdown,
    difference_text,
)
from reports.certificate.runs import results_below, write_history
from reports.cli.options import FOLDER, PATH, FrontDoor
from reports.errors import ReportError
from reports.formats.catalogue import FORMATS
from reports.given_files import parsed, read_octets, showing
from reports.pages.page import write_pages
from reports.pages.untrusted import on_a_line
from reports.reading import FLEET_NAME, LATENCY_NAME, RESULT_NAME, read_latency, read_result
from reports.rendering import render, render_formats

EXIT_OK = 0
EXIT_SLOWER = 1
EXIT_INVALID = 4
EXIT_REGRESSIONS, EXIT_NOT_KNOWN = 1, 4
# Where a run leaves the description that it judged a device by.
_DESCRIPTION = Path("description") / "openapi.json"


@click.command()
@click.argument("directory", metavar="DIR", type=PATH)
@click.option(
    "--format",
    "formats",
    multiple=True,
    type=click.Choice(list(FORMATS)),
    help="Write result.json in this format instead of the pages; may be given several times.",
)
def report(directory: Path, formats: tuple[str, ...]) -> None:
    """Write the pages of the result files in DIR again, or the history of a device whose runs are in folders of DIR.

    result.json becomes certificate.html, certificate.md and junit.xml. latency.json becomes latency.html and
    latency.md. fleet.json becomes fleet.html and fleet.md. --format writes one file for a CI system or a code host.
    If DIR holds no result file, and folders in it do, history.html shows their runs by the version of the device.
    Exit code 2: there is no result file, or one that cannot be read.
    """
    if not formats and _holds_runs(directory):
        for path in write_history(directory):
            click.echo(path)
        return
    for path in render_formats(directory, formats) if formats else render(directory):
        click.echo(path)


def _holds_runs(directory: Path) -> bool:
    """Return whether a folder holds no result file, and folders in it do."""
    own = any((directory / name).exists() for name in (RESULT_NAME, LATENCY_NAME, FLEET_NAME))
    return not own and bool(results_below(directory))


@click.command()
@click.argument("old", type=PATH)
@click.argument("new", type=PATH)
@click.option(
    "--threshold",
    type=click.FloatRange(min=0.0),
    default=5.0,
    metavar="PERCENT",
    help="How much a quantile must change to count. A result's own noise counts instead where it is greater.",
)
@click.option("--out", type=FOLDER, metavar="DIR", help="Write compare.html and compare.md into DIR.")
def compare(old: Path, new: Path, threshold: float, out: Path | None) -> None:
    """Show what changed from OLD to NEW, two results of `roaas load`: latency.json or the directory that holds it.

    A change counts if its whole 95 % confidence interval is beyond the threshold. Exit code: 0 not slower; 1 slower;
    2 a result cannot be read, or the two cannot be compared; 4 one of them is not valid, or no change could be judged.
    """
    raise SystemExit(tell_change(old, new, threshold / 100, out))


def tell_change(old: Path, new: Path, threshold: float, out: Path | None = None) -> int:
    """Compare two latency results, print the changes, and return the exit code of `roaas compare`.

    Args:
        old: the older latency.json, or the folder that holds the file.
        new: the newer one, likewise.
        threshold: the share by which a quantile must change to count, 0.05 for 5 %.
        out: folder for compare.html and compare.md, or None to write no pages.

    Raises:
        ReportError: a result cannot be read, or the two cannot be compared.
    """
    # They load matplotlib and numpy, half a second that `roaas report` of a certificate does not need.
    from reports.latency import comparison, comparison_page  # noqa: PLC0415 - see above

    paths = [path / LATENCY_NAME if path.is_dir() else path for path in (old, new)]
    names = str(paths[0]), str(paths[1])
    results = read_latency(paths[0]), read_latency(paths[1])
    pages = {}
    with showing(f"{names[0]} and {names[1]}"):
        found = comparison.compare(*results, names, threshold)
        if out is not None:
            pages["compare.html"] = comparison_page.comparison_html(found, names)
            pages["compare.md"] = comparison_page.comparison_markdown(found, names)
        verdict = comparison_page.verdict(found)
        table = comparison_page.table(found)
    for path in write_pages(out, pages) if out is not None else ():
        click.echo(path, err=True)
    click.echo(table)
    for remark in found.remarks if found.valid else ():
        click.echo(f"\n{on_a_line(remark)}", nl=False)
    click.echo(f"\n{verdict.words}. {on_a_line(verdict.sentence)}")
    if not found.valid:
        return EXIT_INVALID
    # If every change is unclear, no operation is known to be as fast as before.
    judged = any(found.with_verdict(known) for known in ("same", "faster", "slower"))
    return EXIT_SLOWER if found.slower else EXIT_OK if judged else EXIT_INVALID


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
    described = _description_at(old), _description_at(new)
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


def _description_at(source: str) -> str:
    """Return the description that an argument is, or that is beside the result; empty if there is none."""
    if _is_description(source):
        return source
    path = Path(source)
    beside = (path if path.is_dir() else path.parent) / _DESCRIPTION
    # The reader refuses anything in its place that is no regular file.
    return str(beside) if os.path.lexists(beside) else ""

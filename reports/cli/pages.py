"""Define the commands `roaas report` and `roaas compare`."""

from pathlib import Path

import click

from reports.certificate.runs import results_below, write_history
from reports.cli.options import FOLDER, PATH
from reports.formats.catalogue import FORMATS
from reports.given_files import showing
from reports.pages.page import write_pages
from reports.pages.untrusted import on_a_line
from reports.reading import FLEET_NAME, LATENCY_NAME, RESULT_NAME, read_latency
from reports.rendering import render, render_formats

EXIT_OK = 0
EXIT_SLOWER = 1
EXIT_INVALID = 4


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
    for remark in found.remarks:
        click.echo(f"\n{on_a_line(remark)}", nl=False)
    click.echo(f"\n{verdict.words}. {on_a_line(verdict.sentence)}")
    if not found.valid:
        return EXIT_INVALID
    return EXIT_SLOWER if found.slower else EXIT_OK

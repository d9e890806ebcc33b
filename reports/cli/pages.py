"""`roaas report` and `roaas compare`."""

from pathlib import Path

import click

from reports.cli.refusal import refuse
from reports.errors import ReportError
from reports.formats.catalogue import FORMATS
from reports.pages.page import write_pages
from reports.pages.untrusted import visible
from reports.reading import LATENCY_NAME, read_latency
from reports.rendering import render, render_formats

EXIT_OK = 0
EXIT_SLOWER = 1
EXIT_INVALID = 4


@click.command()
@click.argument("directory", metavar="DIR", type=click.Path(path_type=Path))
@click.option(
    "--format",
    "formats",
    multiple=True,
    type=click.Choice(list(FORMATS)),
    help="Write result.json in this format instead; repeatable.",
)
def report(directory: Path, formats: tuple[str, ...]) -> None:
    """Write the pages that belong to the result files in DIR again.

    result.json gives certificate.html, certificate.md and junit.xml; latency.json gives latency.html and
    latency.md; fleet.json gives fleet.html and fleet.md. With --format: that file alone, for a CI system or a code
    host. Exit code 2 where DIR holds no result file, or an unreadable one.
    """
    try:
        written = render_formats(directory, formats) if formats else render(directory)
    except ReportError as error:
        refuse(error)
    for path in written:
        click.echo(path)


@click.command()
@click.argument("old", type=click.Path(path_type=Path))
@click.argument("new", type=click.Path(path_type=Path))
@click.option(
    "--threshold",
    type=click.FloatRange(min=0.0),
    default=5.0,
    show_default=True,
    metavar="PERCENT",
    help="How much a quantile has to change to count; a result's own noise floor counts where it is greater.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="Write compare.html and compare.md there.",
)
def compare(old: Path, new: Path, threshold: float, out: Path | None) -> None:
    """Tell what changed from OLD to NEW, two results of `roaas load`: latency.json or the directory that holds it.

    A change counts where its whole 95 % confidence interval lies beyond the threshold. Exit code 0: not
    slower; 1: slower; 2: a result cannot be read, or the two cannot be compared; 4: one of them is not valid,
    or nothing in them could be judged.
    """
    try:
        code = tell_change(old, new, threshold / 100, out)
    except ReportError as error:
        refuse(error)
    raise SystemExit(code)


def tell_change(old: Path, new: Path, threshold: float, out: Path | None = None) -> int:
    """Say what changed from one latency result to another, and return the exit code of `roaas compare`.

    `threshold` is a share, 0.05 for 5 %; pages go to `out`, where it is given.

    Raises:
        ReportError: a result cannot be read, or the two cannot be compared.
    """
    # They load matplotlib and numpy, which `roaas report` of a certificate does without.
    from reports.latency import comparison, comparison_page  # noqa: PLC0415 - see above

    names = _latency_file(old), _latency_file(new)
    texts = str(names[0]), str(names[1])
    found = comparison.compare(read_latency(names[0]), read_latency(names[1]), texts, threshold)
    if out is not None:
        pages = {
            "compare.html": comparison_page.comparison_html(found, texts),
            "compare.md": comparison_page.comparison_markdown(found, texts),
        }
        for path in write_pages(out, pages):
            click.echo(path, err=True)
    verdict = comparison_page.verdict(found)
    click.echo(comparison_page.table(found))
    for remark in found.remarks:
        click.echo(f"\n{visible(remark)}", nl=False)
    click.echo(f"\n{verdict.words}. {visible(verdict.sentence)}")
    if not found.valid:
        return EXIT_INVALID
    return EXIT_SLOWER if found.slower else EXIT_OK


def _latency_file(path: Path) -> Path:
    return path / LATENCY_NAME if path.is_dir() else path

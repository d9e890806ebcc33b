"""Define the command `roaas diff`."""

from pathlib import Path

import click

from reports.certificate.difference import difference
from reports.certificate.difference_page import difference_html, difference_markdown, difference_text
from reports.cli.options import FOLDER, PATH
from reports.pages.page import write_pages
from reports.reading import RESULT_NAME, read_result

EXIT_REGRESSIONS = 1


@click.command()
@click.argument("old", type=PATH)
@click.argument("new", type=PATH)
@click.option("--out", type=FOLDER, metavar="DIR", help="Write diff.html and diff.md into DIR.")
def diff(old: Path, new: Path, out: Path | None) -> None:
    """Show what changed from OLD to NEW, two results of `roaas certify`: result.json or the directory that holds it.

    A regression is a MUST that fails now and did not before, or that passed before and could not be judged now. Exit
    code: 0 no regression; 1 regressions; 2 a result cannot be read.
    """
    paths = [path / RESULT_NAME if path.is_dir() else path for path in (old, new)]
    names = str(paths[0]), str(paths[1])
    found = difference(read_result(paths[0]), read_result(paths[1]))
    if out is not None:
        pages = {"diff.html": difference_html(found, names), "diff.md": difference_markdown(found, names)}
        for path in write_pages(out, pages):
            click.echo(path, err=True)
    click.echo(difference_text(found))
    raise SystemExit(EXIT_REGRESSIONS if found.regressions else 0)

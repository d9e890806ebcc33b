"""`roaas registry build`."""

import datetime as dt
from pathlib import Path
from typing import Protocol

import click
import msgspec

from reports.attestation.policy import Known, Policy, read_policy
from reports.cli.refusal import refuse
from reports.errors import ReportError
from reports.pages.untrusted import excerpt
from reports.registry.entries import Certificate, Refused, find_envelopes, read_entries, read_keys
from reports.registry.site import INDEX, write_site
from reports.registry.standing import histories

EXIT_REFUSED = 1


class FrontDoor(Protocol):
    """What `build` asks of the front door."""

    def known(self) -> dict[str, object]:
        """What the installed suite knows, as `policy.Known` has it."""


@click.group()
def registry() -> None:
    """Make a static site of signed certificates: who passed what."""


@registry.command()
@click.argument("envelopes", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--keys",
    required=True,
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    metavar="DIR",
    help="Public keys of whom you trust (*.pem).",
)
@click.option(
    "--policy",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="What a certificate has to meet to count (TOML).  [default: the strict policy]",
)
@click.option(
    "--out", required=True, type=click.Path(file_okay=False, path_type=Path), metavar="SITE", help="Folder of the site."
)
@click.pass_obj
def build(door: FrontDoor, envelopes: tuple[Path, ...], keys: Path, policy: Path | None, out: Path) -> None:
    """Write SITE from ENVELOPES alone: files, or folders with certificate.intoto.json somewhere in them.

    The site is complete in itself and works without network. Exit code: 0 each envelope verifies; 1 the site is
    written, and envelopes were refused; 2 usage, or a file of yours cannot be read.
    """
    now = dt.datetime.now(dt.UTC)
    try:
        known = msgspec.convert(door.known(), Known)
        asked = read_policy(policy, known) if policy else Policy()
        trusted, private = read_keys(keys)
        paths = find_envelopes(envelopes)
        entries = read_entries(paths, trusted)
        found = histories((one for one in entries if isinstance(one, Certificate)), asked, known, now)
        refused = [one for one in entries if isinstance(one, Refused)]
        write_site(out, found, refused, now)
    except ReportError as error:
        refuse(error)
    for path in private:
        click.echo(f"{path} is a private key: not used, and better kept elsewhere", err=True)
    for one in refused:
        click.echo(f"refused: {excerpt(one.detail, 400)}", err=True)
    counting = sum(history.current.stands for history in found)
    click.echo(f"{counting} of {len(found)} robots with a certificate that counts, {len(refused)} refused")
    click.echo(f"site: {out / INDEX}")
    if refused:
        raise SystemExit(EXIT_REFUSED)

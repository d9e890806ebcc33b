"""Define the command `roaas registry build`."""

import datetime as dt
from pathlib import Path

import click

from reports.cli.options import CONTRACT, FILE, FOLDER, PATH, FrontDoor, policy_of
from reports.pages.untrusted import on_a_line
from reports.registry.entries import Certificate, Refused, histories, read_entries, read_keys
from reports.registry.site import INDEX, write_site

EXIT_REFUSED = 1


@click.group()
def registry() -> None:
    """Make a static site from signed certificates: which robot passed which classes."""


@registry.command()
@click.argument("envelopes", nargs=-1, required=True, type=PATH)
@click.option(
    "--keys",
    required=True,
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    metavar="DIR",
    help="Public keys (*.pem) of the signers whom you trust.",
)
@click.option(
    "--policy",
    type=FILE,
    metavar="FILE",
    help="What a certificate must meet to count (TOML).  [default: the strict policy]",
)
@CONTRACT
@click.option(
    "--device",
    "devices",
    multiple=True,
    nargs=3,
    metavar="NAME POLICY PACK",
    help="Judge the device of this name by a policy (TOML) and a pack of its own, such as the folder of its "
    "description; repeatable.",
)
@click.option("--out", required=True, type=FOLDER, metavar="SITE", help="Folder of the site.")
@click.pass_obj
def build(
    door: FrontDoor,
    envelopes: tuple[Path, ...],
    keys: Path,
    *,
    policy: Path | None,
    pack: str | None,
    devices: tuple[tuple[str, str, str], ...],
    out: Path,
) -> None:
    """Write a static site (SITE) from signed certificates: ENVELOPES are files or folders.

    Folders are searched for certificate.intoto.json at any depth. The site works without a network. Exit code: 0 every
    envelope verifies; 1 the site is written, and some envelopes were refused; 2 no site is written.
    """
    now = dt.datetime.now(dt.UTC)
    usual = policy_of(door, policy, pack)
    own = {name: policy_of(door, Path(file), folder) for name, file, folder in devices}
    trusted, unusable = read_keys(keys)
    entries = read_entries(envelopes, trusted)
    certificates = [certificate for certificate in entries if isinstance(certificate, Certificate)]
    unknown = own.keys() - {certificate.run.robot.name for certificate in certificates}
    if unknown:
        raise click.UsageError(f"--device: no certificate names the device {', '.join(map(repr, sorted(unknown)))}")
    found = histories(certificates, lambda name: own.get(name, usual), now)
    refused = [refusal for refusal in entries if isinstance(refusal, Refused)]
    write_site(out, found, refused, now)
    for said in unusable:
        click.echo(on_a_line(said, 400), err=True)
    for refusal in refused:
        click.echo(f"refused: {on_a_line(refusal.detail, 400)}", err=True)
    for history in (one for one in found if not one.current.stands):
        why = f"{on_a_line(history.name, 100)} does not count: {', '.join(history.current.against)}"
        is_own = history.current.certificate.run.described and history.name not in own
        click.echo(why + "; judged by its own description: --device NAME POLICY PACK" * is_own, err=True)
    counting = sum(history.current.stands for history in found)
    have = "robot has" if len(found) == 1 else "robots have"
    click.echo(f"{counting} of {len(found)} {have} a valid certificate; {len(refused)} refused")
    click.echo(f"site: {out / INDEX}")
    if refused:
        raise SystemExit(EXIT_REFUSED)

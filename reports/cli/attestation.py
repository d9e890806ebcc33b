"""Define the commands `roaas keygen` and `roaas verify`.

Define the command `roaas sign`.
"""

import datetime as dt
from pathlib import Path
from textwrap import fill

import click
import msgspec

from reports.attestation.envelope import read_envelope
from reports.attestation.files import DESCRIPTION
from reports.attestation.keys import PRIVATE_NAME, PUBLIC_NAME, generate, public_key
from reports.attestation.signing import Notary
from reports.attestation.statement import RESULT_SUBJECT
from reports.attestation.verifying import NOT_PROVED, PROVED, Verification
from reports.attestation.verifying import verify as verified
from reports.cli.options import CONTRACT, FILE, FOLDER, FrontDoor, policy_of
from reports.given_files import EnvelopeRefusedError
from reports.pages.untrusted import excerpt, on_a_line
from reports.reading import RESULT_NAME, read_result
from reports.rendering import render

EXIT_REFUSED = 1


@click.command()
@click.argument("directory", metavar="DIR", type=FOLDER)
def keygen(directory: Path) -> None:
    """Make an Ed25519 key pair for signing results: DIR/signing-key.pem and DIR/public-key.pem.

    Keep signing-key.pem secret. Give public-key.pem, or its fingerprint, to everybody who relies on your certificates.
    Exit code 2: one of the files exists already, or cannot be written.
    """
    fingerprint = generate(directory)
    click.echo(f"private: {directory / PRIVATE_NAME}\npublic:  {directory / PUBLIC_NAME}")
    click.echo(f"fingerprint: sha256:{fingerprint}")


@click.command()
@click.argument("file", type=FILE)
@click.option("--key", required=True, type=FILE, metavar="PUB", help="Public key (PEM) of the signer whom you trust.")
@click.option("--policy", type=FILE, help="What a certificate must meet (TOML).  [default: the strict policy]")
@CONTRACT
@click.option("--nonce", help="The nonce that you gave to the vendor: the run must have been made with it.")
@click.option("--result", type=FOLDER, metavar="DIR", help="Compare the files of DIR as well.")
@click.pass_obj
def verify(
    door: FrontDoor,
    file: Path,
    key: Path,
    *,
    policy: Path | None,
    pack: str | None,
    nonce: str | None,
    result: Path | None,
) -> None:
    """Verify the signature of a certificate and check the certificate against your policy, without a network.

    Exit code: 0 accepted; 1 refused; 2 wrong usage, or a file cannot be read.
    """
    wanted, known = policy_of(door, policy, pack)
    if nonce is not None:
        wanted = msgspec.structs.replace(wanted, nonce=nonce)
    trusted = public_key(key)
    try:
        found = verified(read_envelope(file), trusted, wanted, known, now=dt.datetime.now(dt.UTC), directory=result)
    except EnvelopeRefusedError as error:
        click.echo(f"REFUSED: {on_a_line(str(error), 500)}\n\nNothing is proved.")
        raise SystemExit(EXIT_REFUSED) from error
    _print(found, trusted.keyid)
    if not found.accepted:
        raise SystemExit(EXIT_REFUSED)


def _print(found: Verification, key: str) -> None:
    click.echo(f"signed by key  sha256:{key}")
    click.echo(f"result         sha256:{on_a_line(str(found.statement.digest_of(RESULT_SUBJECT)), 64)}\n")
    for point in found.points:
        click.echo(f"  {'ok     ' if point.met else 'REFUSED'}  {point.name:<17} {on_a_line(point.found, 400)}")
        if not point.met:
            click.echo(
                f"{'':11}demanded: {on_a_line(point.demanded, 400)}\n{'':11}what to do: {on_a_line(point.remedy, 400)}"
            )
    for remark in found.remarks:
        click.echo(f"\n{fill(on_a_line(remark, 400), 100)}")
    refused = [point.name for point in found.points if not point.met]
    for words in (PROVED, NOT_PROVED):
        click.echo(f"\n{fill(words, 100)}")
    click.echo(f"\nREFUSED by your policy: {', '.join(refused)}" if refused else "\nACCEPTED by your policy")


@click.command()
@click.argument("directory", metavar="DIR", type=FOLDER)
@click.option("--key", required=True, type=FILE, help="Private key, as `roaas keygen` makes it.")
@CONTRACT
@click.pass_obj
def sign(door: FrontDoor, directory: Path, key: Path, pack: str | None) -> None:
    """Sign DIR/result.json: write DIR/certificate.intoto.json, and write the pages again.

    Exit code 2: DIR has no result; the result is incomplete, was edited, or lies beside files of another run; or the
    key cannot be used.
    """
    by = _pack_of(door, directory) if pack is None else pack
    suite = read_result(directory / RESULT_NAME)["suite"]
    if suite["digest"] != door.known(by)["suite"]:
        click.echo(
            f"RoAAS {excerpt(suite['version'], 40)} judged the robot, with another suite or contract than the "
            "installed one: the requirements were not compared with a ledger",
            err=True,
        )
    for path in render(directory, Notary(key, lambda: door.known(by))):
        click.echo(path)


def _pack_of(door: FrontDoor, directory: Path) -> str | None:
    """Return the contract pack of a result: the description beside it, or an installed pack; None for the default."""
    result = read_result(directory / RESULT_NAME)
    if "api" in result and (directory / DESCRIPTION).is_dir():
        return str(directory / DESCRIPTION)
    name: str | None = result.get("pack", {}).get("name")
    # A result is data: a name in it leads to no folder.
    if name is not None and not door.is_installed(name):
        raise click.UsageError(
            f"the robot was judged by the contract pack {excerpt(name, 80)!r}, which is not installed: "
            "give its folder with --contract"
        )
    return name

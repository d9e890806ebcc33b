"""Define the commands `roaas keygen` and `roaas verify`."""

import datetime as dt
from pathlib import Path
from textwrap import fill

import click
import msgspec

from reports.attestation.envelope import read_envelope
from reports.attestation.keys import PRIVATE_NAME, PUBLIC_NAME, generate, public_key
from reports.attestation.policy import OF_DESCRIBED
from reports.attestation.statement import RESULT_SUBJECT
from reports.attestation.verifying import DESCRIBED, NOT_PROVED, PROVED, REFUSED, Verification, unseal
from reports.attestation.verifying import verify as verified
from reports.cli.options import CONTRACT, FILE, FOLDER, FrontDoor, policy_of
from reports.errors import EnvelopeRefusedError
from reports.pages.untrusted import on_a_line

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
@click.option(
    "--policy", type=FILE, help="What a certificate must meet (TOML).  [default: as docs/certificates.md says]"
)
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
    trusted, envelope = public_key(key), read_envelope(file)
    try:
        is_described = unseal(envelope, trusted).predicate.roaas.described
        folder = (result or file.parent) / "description"
        # Nothing in the folder of a description is run.
        pack = str(folder) if is_described and pack is None and folder.is_dir() else pack
        wanted, known = policy_of(door, policy, pack)
        wanted = OF_DESCRIBED if is_described and policy is None else wanted
        wanted = msgspec.structs.replace(wanted, nonce=wanted.nonce if nonce is None else nonce)
        found = verified(envelope, trusted, wanted, known, now=dt.datetime.now(dt.UTC), directory=result)
    except EnvelopeRefusedError as error:
        click.echo(f"REFUSED: {on_a_line(str(error), 500)}\n\nNothing is proved.")
        raise SystemExit(EXIT_REFUSED) from error
    _print(found, trusted.keyid)
    if not found.accepted and is_described and pack is None:
        click.echo(f"\n{fill(DESCRIBED, 100)}")
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
    for words in (REFUSED if refused else PROVED, NOT_PROVED):
        click.echo(f"\n{fill(words, 100)}")
    click.echo(f"\nREFUSED by your policy: {', '.join(refused)}" if refused else "\nACCEPTED by your policy")

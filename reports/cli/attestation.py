"""`roaas keygen` and `roaas verify`."""

import datetime as dt
from pathlib import Path
from textwrap import fill
from typing import Protocol

import click
import msgspec

from reports.attestation.envelope import read_envelope
from reports.attestation.keys import PRIVATE_NAME, PUBLIC_NAME, generate, public_key
from reports.attestation.policy import Known, Policy, read_policy
from reports.attestation.statement import RESULT_SUBJECT
from reports.attestation.verifying import NOT_PROVED, PROVED, Verification
from reports.attestation.verifying import verify as verified
from reports.cli.refusal import refuse
from reports.errors import EnvelopeRefusedError, ReportError
from reports.pages.untrusted import excerpt

EXIT_REFUSED = 1
_FILE = click.Path(dir_okay=False, path_type=Path)
_FOLDER = click.Path(file_okay=False, path_type=Path)


class FrontDoor(Protocol):
    """What `verify` asks of the front door."""

    def known(self) -> dict[str, object]:
        """What the installed suite knows, as `policy.Known` has it."""


@click.command()
@click.argument("directory", metavar="DIR", type=_FOLDER)
def keygen(directory: Path) -> None:
    """Make an Ed25519 key pair for signing results: DIR/signing-key.pem and DIR/public-key.pem.

    Keep the first to yourself; give the second, or its fingerprint, to whoever relies on your certificates. Exit code
    2 where one of them is there already or cannot be written.
    """
    try:
        fingerprint = generate(directory)
    except ReportError as error:
        refuse(error)
    click.echo(f"private: {directory / PRIVATE_NAME}\npublic:  {directory / PUBLIC_NAME}")
    click.echo(f"fingerprint: sha256:{fingerprint}")


@click.command()
@click.argument("file", type=_FILE)
@click.option("--key", required=True, type=_FILE, metavar="PUB", help="Public key of whom you trust (PEM).")
@click.option("--policy", type=_FILE, help="What you ask of a certificate (TOML).  [default: the strict policy]")
@click.option("--nonce", help="The nonce that you gave: the run must have been made with it.")
@click.option("--result", type=_FOLDER, metavar="DIR", help="Compare DIR/result.json and DIR/certificate.html, too.")
@click.pass_obj
def verify(door: FrontDoor, file: Path, key: Path, policy: Path | None, nonce: str | None, result: Path | None) -> None:
    """Say what a signed certificate proves, and whether it is enough for you; offline.

    Exit code: 0 accepted, 1 refused, 2 usage, or a file of yours cannot be read.
    """
    try:
        known = msgspec.convert(door.known(), Known)
        asked = read_policy(policy, known) if policy else Policy()
        if nonce is not None:
            asked = msgspec.structs.replace(asked, nonce=nonce)
        trusted = public_key(key)
        found = verified(read_envelope(file), trusted, asked, known, now=dt.datetime.now(dt.UTC), directory=result)
    except EnvelopeRefusedError as error:
        click.echo(f"REFUSED: {excerpt(str(error), 500)}\n\nNothing is proved.")
        raise SystemExit(EXIT_REFUSED) from error
    except ReportError as error:
        refuse(error)
    _tell(found, trusted.keyid)
    if not found.accepted:
        raise SystemExit(EXIT_REFUSED)


def _tell(found: Verification, key: str) -> None:
    click.echo(f"signed by key  sha256:{key}")
    click.echo(f"result         sha256:{found.statement.digest_of(RESULT_SUBJECT)}\n")
    for point in found.points:
        click.echo(f"  {'ok     ' if point.met else 'REFUSED'}  {point.name:<17} {excerpt(point.found, 400)}")
    refused = [point.name for point in found.points if not point.met]
    for words in (PROVED, NOT_PROVED):
        click.echo(f"\n{fill(words, 100)}")
    click.echo(f"\nREFUSED by your policy: {', '.join(refused)}" if refused else "\nACCEPTED by your policy")

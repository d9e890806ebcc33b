"""What the commands of this room share: kinds of parameters, and the front door."""

from pathlib import Path
from typing import Protocol

import click
import msgspec

from reports.attestation.policy import Known, Policy, read_policy

PATH = click.Path(path_type=Path)
FILE = click.Path(dir_okay=False, path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)


CONTRACT = click.option(
    "--contract", "pack", metavar="PACK", help="The contract pack of the certificates: its name, or its folder."
)


class FrontDoor(Protocol):
    """The object in the command's context, through which a command calls packages that it does not import."""

    def known(self, pack: str | None) -> dict[str, object]:
        """Return the versions and requirements of a contract pack that the installed suite knows.

        The keys are those of `policy.Known`.
        """


def policy_of(door: FrontDoor, path: Path | None, pack: str | None) -> tuple[Policy, Known]:
    """Return the policy in a file, or the default policy, and what `FrontDoor.known` returns for a contract pack."""
    known = msgspec.convert(door.known(pack), Known)
    return read_policy(path, known) if path else Policy(), known

"""Define the parameter types and options that the report commands share, and their interface to the suite."""

from pathlib import Path
from typing import Protocol

import click
import msgspec

from reports.attestation.policy import Known, Policy, read_policy

PATH = click.Path(path_type=Path)
FILE = click.Path(dir_okay=False, path_type=Path)
FOLDER = click.Path(file_okay=False, path_type=Path)


CONTRACT = click.option(
    "--contract",
    "pack",
    metavar="PACK",
    help="The contract pack of the certificates: its name, or its folder, whose code is run.",
)


class FrontDoor(Protocol):
    """The click context object (`ctx.obj`), by which a command gets information from the conformance suite."""

    def known(self, pack: str | None) -> dict[str, object]:
        """Return the installed suite's digests and profiles for a contract pack, with the fields of `policy.Known`."""

    def is_installed(self, pack: str) -> bool:
        """Return whether a name is that of a contract pack that comes with the suite or that a package installed."""

    def description_changes(
        self, old: str, new: str, *, allow_files: bool = False
    ) -> list[tuple[bool | None, str, str]]:
        """Return what changed: whether it breaks clients (None if that is not known), the operation, and what it is."""


def policy_of(door: FrontDoor, path: Path | None, pack: str | None) -> tuple[Policy, Known]:
    """Return the policy (from a file, or the default) and the installed suite's digests for a contract pack."""
    known = msgspec.convert(door.known(pack), Known)
    return read_policy(path, known) if path else Policy(), known

"""The options of `roaas certify`, which travel through it as one value."""

from dataclasses import dataclass
from pathlib import Path

import click
from click.core import ParameterSource

from conformance.api.call_rules import CallRules
from conformance.target.naming import DeviceOptions


@dataclass(frozen=True)
class CertifyOptions(DeviceOptions):
    """The options of `roaas certify`, by their names in Python; see --help."""

    openapi: str | None = None
    init: bool = False
    force: bool = False
    plan: bool = False
    requirements: str | None = None
    allow_motion: bool = False
    effort: str = "standard"
    minutes: float | None = None
    seed: int = 0
    nonce: str | None = None
    restart_command: str = ""
    wait_s: float | None = None
    baseline: Path | None = None
    write_baseline: Path | None = None
    select: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    exit_first: bool = False
    last_failed: bool = False
    fleet: str | None = None
    parallel: int | None = None
    key: str | None = None
    progress: str = "auto"
    as_json: bool = False
    drive: str | None = None
    read: str | None = None
    before: tuple[str, ...] = ()
    yes: bool = False
    save_map: Path | None = None

    @property
    def moves(self) -> bool:
        """Whether the class ``motion`` is judged without a statement that has a map."""
        return self.drive is not None

    @property
    def calls(self) -> CallRules:
        """The call rules from the options alone."""
        return CallRules(self.allow, self.never)

    def check_new_baseline(self) -> None:
        """Check that --write-baseline overwrites no file that was not read.

        Raises:
            click.UsageError: it would.
        """
        path = self.write_baseline
        if path is not None and path.exists() and path != self.baseline:
            raise click.UsageError(f"--write-baseline: {path} exists; give it as --baseline as well, to renew it")

    def check_nonce(self) -> None:
        """Check that the seed follows from the nonce, if there is one.

        Raises:
            click.UsageError: the nonce is not printable, or a seed is given as well.
        """
        if self.nonce is None:
            return
        if not self.nonce.strip() or not self.nonce.isprintable():
            raise click.UsageError(f"--nonce {self.nonce!r} must be printable text")
        if click.get_current_context().get_parameter_source("seed") is ParameterSource.COMMANDLINE:
            raise click.UsageError("--seed follows from --nonce: give one of the two")

"""The front door: the command ``roaas``, which hands each subcommand to its room.

Rooms are imported when their command is used, so that ``roaas certify`` needs neither ROS nor Locust.
"""

from __future__ import annotations

from importlib import import_module

import click

_COMMANDS = {
    "robot": ("reference_robot.cli", "robot"),
    "certify": ("conformance.cli.certify", "certify"),
    "load": ("loadtests.cli", "load"),
    "report": ("reports.cli", "report"),
    "compare": ("reports.cli", "compare"),
    "selftest": ("conformance.cli.selftest", "selftest"),
    "contract": ("conformance.cli.contract", "contract"),
}
_EXTRAS = {"robot": "robot", "load": "load"}


class _Rooms(click.Group):
    """A click group whose subcommands live in the rooms."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - click's signature
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        module, name = _COMMANDS[cmd_name]
        try:
            command = getattr(import_module(module), name)
        except ModuleNotFoundError as missing:
            extra = _EXTRAS.get(cmd_name)
            if extra is None or (missing.name or "").split(".")[0] in {"reference_robot", "loadtests"}:
                raise
            raise click.UsageError(
                f"'roaas {cmd_name}' needs the Python module {missing.name!r}, which is not installed: "
                f"pip install 'roaas[{extra}]'",
                ctx,
            ) from missing
        assert isinstance(command, click.Command)  # noqa: S101 - tells mypy what the table above holds
        return command


@click.command(cls=_Rooms, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="roaas", prog_name="roaas")
def main() -> None:
    """Conformance and load tests for robots that are web services."""


if __name__ == "__main__":
    main()

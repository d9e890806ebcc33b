"""The command ``roaas``: finds each subcommand in its package ("room") and runs it.

The rooms are the packages conformance, loadtests, proof, reference_robot, reports and ros_probe. A room is imported
only when its command is used, so that ``roaas certify`` needs neither ROS nor Locust.
"""

import difflib
import gc
import os
import sys

# `python -m roaas` puts the working directory first, and a module in it, such as click.py, would be imported.
if (
    __name__ == "__main__"
    and not sys.flags.safe_path
    and os.path.realpath(sys.path[0]) != os.path.realpath(f"{__file__}/..")
):
    del sys.path[0]

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import click

# The module of each command, in which the command has its own name, and the summary in `roaas --help`, which is given
# here so that it need not import every package.
_COMMANDS = {
    "robot": ("reference_robot.cli", "Run the reference robot."),
    "certify": ("conformance.cli.certify", "Judge a device by its own description, or by its contract."),
    "load": ("loadtests.cli", "Measure how fast a robot responds."),
    "replay": ("conformance.cli.replay", "Send a finding's requests again, and report whether it persists."),
    "judge": ("conformance.cli.judge", "Judge a stored run again, without the robot."),
    "report": ("reports.cli.results", "Write the pages from the result files again."),
    "compare": ("reports.cli.results", "Show whether a robot got slower between two load tests."),
    "diff": ("reports.cli.results", "Show what changed between two results, or between two descriptions of an API."),
    "keygen": ("reports.cli.attestation", "Make a key pair for signing results."),
    "sign": ("reports.cli.signing", "Sign a result, so that others can verify the signer."),
    "verify": ("reports.cli.attestation", "Check a signed certificate, and whether it meets your policy."),
    "registry": (
        "reports.cli.registry",
        "Make a static site from signed certificates: which robot passed which classes.",
    ),
    "selftest": ("proof.cli.selftest", "Test the suite: it must kill mutants, and must not fail a good device."),
    "contract": ("conformance.cli.contract", "Show the requirements, export the contract's files."),
    "explain": ("conformance.cli.explain", "Explain a requirement: why, by which source, how judged, how to fix it."),
}
_MEASURING = {"robot", "load"}  # commands whose time for single requests counts
_EXTRAS = {"load"}  # commands that need the optional dependencies of the same name
_USAGE, _INCONCLUSIVE, _INTERRUPTED = 2, 4, 130
_START = """\
Judge a device by its own OpenAPI description or WSDL; nothing moves:
  roaas certify http://robot:8000/openapi.json

Measure how fast it answers:
  roaas load http://robot:8000/openapi.json --operation 'GET /state'

Understand a finding, and how to fix it:
  roaas explain http/date

All commands: roaas --help"""
_INSTALLED = Path(__file__).with_name("roaas_rooms")


def open_rooms() -> None:
    """Make the packages of RoAAS importable in this process and in the processes that it starts.

    In a checkout the packages are next to this file. A wheel installs them in the folder ``roaas_rooms``, so that names
    such as `reports` and `conformance` do not collide with other installed packages.
    """
    folder = str(_INSTALLED)
    if folder in sys.path or not _INSTALLED.is_dir():
        return
    sys.path.insert(0, folder)
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (folder, os.environ.get("PYTHONPATH"))))


class _Rooms(click.Group):
    """The click group of all subcommands; it imports a subcommand's module when the subcommand is used."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - click's signature
        return list(_COMMANDS)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments; without any, print what to try and exit."""
        if not args and not ctx.resilient_parsing:
            click.echo(_START, err=True)
            ctx.exit(_USAGE)
        return super().parse_args(ctx, args)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that the arguments name.

        Raises:
            click.UsageError: there is none; it names the nearest.
        """
        word = args[0]
        if word in _COMMANDS or word.startswith("-") or self.get_command(ctx, word):
            return super().resolve_command(ctx, args)
        near = difflib.get_close_matches(word, _COMMANDS, 1)
        meant = f"certify {word}" if "://" in word or "." in word else next(iter(near), "")
        raise click.UsageError(f"No such command {word!r}." + (f" Did you mean: roaas {meant}" if meant else ""), ctx)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002 - click's
        with formatter.section("Commands"):
            formatter.write_dl([(name, summary) for name, (_, summary) in _COMMANDS.items()])

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in _COMMANDS:
            return None
        open_rooms()
        if cmd_name not in _MEASURING:
            # Imports and a run make many objects that live for a moment, and few that are garbage in circles: looking
            # for those after 200,000 new objects instead of 700 saves a tenth of the processor time.
            gc.set_threshold(200_000, 50)
        if lack := import_module("conformance.commandline.guard").lacks_addresses(cmd_name):
            click.echo(f"error: {lack}", err=True)
            ctx.exit(_INCONCLUSIVE)
        if cmd_name in _EXTRAS:
            extras = import_module("conformance.commandline.extras")
            problem = extras.lacking(cmd_name, f"'roaas {cmd_name}'")
            if problem:
                raise click.UsageError(problem, ctx)
        module, _ = _COMMANDS[cmd_name]
        command = getattr(import_module(module), cmd_name)
        if not isinstance(command, click.Command):
            raise TypeError(f"{module}.{cmd_name} is not a command")
        return command

    def main(self, *args: Any, **options: Any) -> Any:
        """Run a command and end the process with its exit code."""
        run: Callable[..., Any] = super().main
        if not options.get("standalone_mode", True):
            return run(*args, **options)
        sys.exit(_exit_code(lambda: run(*args, **{**options, "standalone_mode": False})))

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command; name the extra that it lacks, if it turns out to need one, as the report of a load test.

        Whatever else goes wrong is told in one sentence, and never ends with an exit code that is a verdict.
        """
        open_rooms()
        guard = import_module("conformance.commandline.guard")
        guard.make_streams_lenient()
        try:
            return super().invoke(ctx)
        except click.ClickException as error:
            error.message = guard.inert_lines(error.message)  # type: ignore[misc] # it may quote a file or a device
            raise
        except click.exceptions.Exit:
            raise
        except (KeyboardInterrupt, click.Abort):
            ctx.exit(_INTERRUPTED)
        except ModuleNotFoundError as missing:
            extras = import_module("conformance.commandline.extras")
            problem = extras.missing_extra(missing.name, f"'roaas {ctx.invoked_subcommand}'")
            if problem is None:
                ctx.exit(guard.report_failure(missing))
            raise click.UsageError(problem) from missing
        except Exception as error:  # noqa: BLE001 - a traceback would end with 1, which means "not conformant"
            ctx.exit(guard.report_failure(error))


def _exit_code(run: Callable[[], Any]) -> int:
    """Run what returns an exit code or nothing, and return the exit code. It is 1 only if ``run`` returns 1.

    Click and Python end with 1 whatever they have no other code for: an exception, an interrupted prompt, a closed
    pipe.
    """
    open_rooms()
    guard = import_module("conformance.commandline.guard")
    guard.make_streams_lenient()
    import_module("conformance.commandline.secrecy").SECRETS.keep_userinfo(" ".join(sys.argv))
    secret_file = import_module("conformance.commandline.secret_file")
    if secret_file.names_user(sys.argv[1:]):
        click.echo(f"Error: {secret_file.IN_URL}", err=True)
        return _USAGE
    try:
        code = run()
    except click.ClickException as error:
        error.show()
        return _USAGE if error.exit_code == click.ClickException.exit_code else error.exit_code
    except (KeyboardInterrupt, click.Abort):
        return _INTERRUPTED
    except Exception as error:  # noqa: BLE001 - as in _Rooms.invoke()
        return int(guard.report_failure(error))
    return code if isinstance(code, int) else 0


class FrontDoor:
    """Functions through which one package uses another without importing it.

    Commands get an instance as click's context object.
    """

    @staticmethod
    def notary(key: Path, pack: str | None = None) -> Any:
        """Return a signer that holds the private key in a file, read before the run whose results it will sign."""
        try:
            return import_module("reports.attestation.signing").Notary(key, lambda: FrontDoor.known(pack))
        except import_module("reports.errors").ReportError as error:
            raise click.UsageError(str(error)) from error

    @staticmethod
    def prepare() -> None:
        """Load what render() needs, which takes a sixth of a second, while the run waits for the device anyway."""
        import_module("reports.rendering")

    @staticmethod
    def render(written: Path, notary: Any = None) -> list[Path]:
        """Write the reports for a result file, sign it if there is a notary, and return the paths of the reports."""
        reports: list[Path] = import_module("reports.rendering").render(written.parent, notary)
        return reports

    @staticmethod
    def compare(old: Path, new: Path, threshold: float) -> int:
        """Print what changed between two latency result files; return the exit code."""
        pages = import_module("reports.cli.results")
        try:
            code: int = pages.tell_change(old, new, threshold)
        except import_module("reports.errors").ReportError as error:
            click.echo(f"not compared: {error.format_message()}", err=True)
            return int(pages.EXIT_INVALID)
        return code

    @staticmethod
    def description_changes(old: str, new: str, *, allow_files: bool = False) -> list[tuple[bool | None, str, str]]:
        """Return what changed: whether it breaks clients (None if that is not known), the operation, and what it is."""
        comparing = import_module("conformance.engine.comparing")
        refused = import_module("conformance.documents.description").DescriptionError
        unreachable = import_module("conformance.transport.reach").UnreachableError
        try:
            found = comparing.compare(old, new, allow_files=allow_files)
            return [(one.breaking, one.operation, one.text) for one in found]
        except (refused, unreachable) as error:
            raise click.UsageError(str(error)) from error

    @staticmethod
    def mutants_of(contract: Any) -> tuple[Any, ...]:
        """Return the hand-written mutants of a contract pack."""
        mutants: tuple[Any, ...] = import_module("proof.mutation.self_test").self_test_of(contract).mutants
        return mutants

    @staticmethod
    def coverage(contract: Any) -> tuple[str, list[str]]:
        """Return the coverage page of a contract pack, and where its ledger, checks and mutants disagree."""
        coverage = import_module("proof.selftest.coverage")
        return coverage.page(contract), coverage.disagreements(contract)

    @staticmethod
    def is_installed(pack: str) -> bool:
        """Return whether a name is that of a contract pack that comes with the suite or that a package installed."""
        found: bool = import_module("conformance.contract.locating").is_installed(pack)
        return found

    @staticmethod
    def known(pack: str | None) -> dict[str, Any]:
        """Return what the installed suite contains for a contract pack: digest, requirement sets, profiles."""
        try:
            known: dict[str, Any] = import_module("conformance.engine.suite").suite_facts(pack)
        except import_module("conformance.contract.locating").ContractError as error:
            raise click.UsageError(str(error)) from error
        return known


# All commands inherit how help is asked for, that it shows the defaults and is as wide as the terminal, and whether
# there are colours (no-color.org).
_SETTINGS = {
    "help_option_names": ["-h", "--help"],
    "show_default": True,
    "obj": FrontDoor(),
    "max_content_width": 200,
    "color": False if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" else None,
}


@click.command(cls=_Rooms, context_settings=_SETTINGS)
@click.version_option(package_name="roaas", prog_name="roaas")
def main() -> None:
    """Conformance and load tests for robots that are web services."""
    # A closed terminal, and SIGTERM of containers and CI jobs, clean up like Ctrl-C; some commands have own handlers.
    import_module("conformance.commandline.endings").end_like_ctrl_c()


def load_node() -> None:
    """Run the command ``roaas-load-node``: the master or a worker of a load test that is spread over machines."""
    sys.exit(_exit_code(lambda: import_module("loadtests.node").main(sys.argv[1:])))


if __name__ == "__main__":
    main()

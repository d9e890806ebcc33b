"""`roaas load`: the options, and the process that does the measuring."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from typing import IO, TYPE_CHECKING, Any, Self

import click

from conformance.commandline.device_options import credential_options, description_options
from conformance.commandline.endings import as_parent, end_like_ctrl_c, end_with_parent, ending_signals, ignore_signals
from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.help_pages import Group, inert, options_of, say
from conformance.commandline.out_folder import FolderError, command_without_folders, hold
from conformance.commandline.result_command import CommandResult, ResultCommand
from conformance.contract.toml_file import TomlFileError
from conformance.papers_robot.statement import RobotStatement, load_robot_statement
from conformance.statement.endpoints import Endpoints
from loadtests.clients.failures import CallError
from loadtests.clients.payloads import CLIENTS, INTERFACES, MOVES
from loadtests.described.device import DESCRIBED_ONLY, Named
from loadtests.result.files import FOLDER, BaselineError, folder_of, newest, stops_lines, store, with_unstopped
from loadtests.settings.settings import KNEE_SEARCHES, SHARE, STAGES, STEP_S, CliOptions, Settings, SettingsError
from loadtests.settings.settle import (
    AGAINST_LOOKS,
    DEFAULT_AGAINST_S,
    DEFAULT_DURATION_S,
    DEFAULT_RATE,
    DEFAULT_WARMUP_S,
    settle,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from types import FrameType

    from loadtests.described.operators import Stopping
    from loadtests.described.run import Described

DEFAULT_OUT = "out"  # as `roaas certify` does
#: Threads of NumPy's linear algebra wait for one another by spinning, ten times as long on a busy machine.
_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
_FILE = click.Path(path_type=Path)
_GIVEN = click.Path(exists=True, dir_okay=False)
_START = """\
Measure how fast an operation of a device answers:
  roaas load http://robot:8000/openapi.json --operation 'GET /state' --rate 50

Find the highest rate that the device manages:
  roaas load http://robot:8000/openapi.json --operation 'GET /state' --knee

Compare it with another device, or with another version:
  roaas load http://robot:8000/openapi.json --operation 'GET /state' --against http://old:8000"""
# How often signals are looked for while a load test runs, s.
_LOOKS_S = 0.2


def _run_load(settings: Settings, written: Path, summary: IO[str], stopping: Iterable[Stopping]) -> CommandResult:
    """Run a load test in its own process, which writes the path of its result into the file `written`.

    Its summary goes into another file, as it is printed once the robot has been stopped.

    The process has its own session, so that Ctrl-C reaches it only through this process: it then writes a partial
    result.
    """
    guards = [descriptor for each in stopping if (descriptor := each.start_guard()) is not None]
    child = subprocess.Popen(
        [sys.executable, "-P", "-m", "loadtests"],
        stdin=subprocess.PIPE,
        stdout=summary,
        text=True,
        start_new_session=True,
        env=as_parent(os.environ | _ONE_THREAD),
        pass_fds=guards,
    )

    def forward(number: int, _: FrameType | None) -> None:
        child.send_signal(number)

    earlier = {number: signal.signal(number, forward) for number in ending_signals()}
    try:
        if child.stdin is not None:
            with suppress(BrokenPipeError):  # the worker ended before it read them
                child.stdin.write(f"{written}\n{settings.to_json()}")
                child.stdin.close()
        # If two signals come at once, a library's thread may take both, and they would not interrupt an endless wait.
        while child.poll() is None:
            with suppress(subprocess.TimeoutExpired):
                child.wait(_LOOKS_S)
        code = child.returncode
    finally:
        for number, handler in earlier.items():
            signal.signal(number, handler)
    if code < 0:  # ended by a signal: before it handled Ctrl-C itself, or killed
        click.echo(f"roaas load: the process that measures was ended by {signal.Signals(-code).name}", err=True)
        code = ExitCode.INTERRUPTED if -code in earlier else ExitCode.INCONCLUSIVE
    path = Path(written.read_text(encoding="utf-8")) if written.exists() else None
    if code == ExitCode.FAILED and path is None:  # Python's own exit code, such as for a module that cannot be loaded
        code = ExitCode.INCONCLUSIVE
    return CommandResult(code, path)


def _other_robot(given: dict[str, Any], own: RobotStatement) -> RobotStatement | None:
    """Return the statement of the robot to compare with; without a file, one with this robot's credentials.

    Raises:
        TomlFileError: the other robot's statement cannot be used.
    """
    where = given.pop("against")
    if where is None:
        return None
    if "://" not in where:
        return load_robot_statement(Path(where))
    shared = {name: given[name] or getattr(own.endpoints, name) for name in ("token_file", "ca_file", "timeout_s")}
    return RobotStatement(endpoints=Endpoints(rest=where, **shared))


@click.command(cls=ResultCommand, start=_START)
@click.argument("targets", nargs=-1, metavar="[DESCRIPTION] [STATEMENT]")
@options_of(Group.DEVICE, rare=True)
@click.option("--rest", metavar="URL", help="Base URL of the REST interface.")
@description_options
@options_of(Group.DEVICE, rare=True)
@click.option("--publishers-wsdl", metavar="URL|FILE", help="WSDL of the publishers service, which takes deliveries.")
@click.option("--subscribers-wsdl", metavar="URL|FILE", help="WSDL of the subscribers service, which returns the pose.")
@click.option("--publishers-endpoint", metavar="URL", help="Address of the publishers service, if not its WSDL's.")
@click.option("--subscribers-endpoint", metavar="URL", help="Address of the subscribers service, if not its WSDL's.")
@click.option("--rosbridge", metavar="URL", help="Measure this rosbridge to the robot as well.")
@options_of(Group.MEASURED)
@click.option(
    "--operation",
    "operations",
    multiple=True,
    metavar="NAME[=WEIGHT]",
    help="Call this operation: 'GET /state' or GetPose of a description, or delivery, coffee or pose; repeatable.",
)
@click.option(
    "--scenario", type=click.Path(exists=True, dir_okay=False), help="Locust file with what the users (--users) do."
)
@options_of(Group.MEASURED, rare=True)
@click.option("--interface", "interfaces", multiple=True, type=click.Choice(INTERFACES), help="Only this interface.")
@click.option("--client", "clients", multiple=True, type=click.Choice(CLIENTS), help="Only this client.")
@options_of(Group.EFFORT)
@click.option("--rate", type=float, help=f"Open model: requests per second (default {DEFAULT_RATE:g}).")
@click.option(
    "--stages",
    callback=STAGES,
    metavar="R:S,…",
    help="Open model: change to the rate R in S, as in 10:30s,100:1m,100:5m,10:0s; the first stage begins at 0.",
)
@click.option("--users", type=int, help="Closed model: users, each of which waits for its response.")
@options_of(Group.EFFORT, rare=True)
@click.option(
    "--arrivals",
    type=click.Choice(["constant", "poisson"]),
    default="constant",
    help="Open model: how requests are spaced.",
)
@options_of(Group.EFFORT)
@click.option(
    "--duration",
    "duration_s",
    type=float,
    help=f"Seconds to measure (default {DEFAULT_DURATION_S:g}; with --against {DEFAULT_AGAINST_S:g}, up to "
    f"{AGAINST_LOOKS[-1]} times as long while it is inconclusive).",
)
@click.option(
    "--warmup", "warmup_s", type=float, help=f"Seconds of load beforehand, not counted (default {DEFAULT_WARMUP_S:g})."
)
@options_of(Group.EFFORT, rare=True)
@click.option("--timeout", "timeout_s", type=float, help="Deadline of one request, in seconds.")
@click.option("--seed", type=click.IntRange(min=0), default=0, help="Seed of schedule, payloads and intervals.")
@click.option(
    "--repeat",
    type=click.IntRange(1, 100),
    default=1,
    help="Repeat the duel N times over new connections; from 4 on, the intervals show how runs differ.",
    metavar="N",
)
@click.option(
    "--restart-command", metavar="CMD", help="Restart the robot with this command before each repeat (no shell)."
)
@options_of(Group.MACHINES, rare=True)
@click.option("--processes", type=click.IntRange(0, 256), default=1, help="Workers on this machine.")
@click.option(
    "--expect-workers", "expect", type=click.IntRange(0, 1000), default=0, help="Workers in total, on all machines."
)
@click.option("--master-host", default="127.0.0.1", help="Address on which the master listens for workers.")
@click.option("--master-port", type=click.IntRange(0, 65535), default=0, help="Port of the master; 0 picks a free one.")
@click.option("--web-port", type=click.IntRange(1, 65535), help="Show Locust's web UI on this port.")
@click.option("--web-host", default="127.0.0.1", help="Address on which the web UI listens.")
@options_of(Group.EFFORT)
@click.option("--knee", is_flag=True, help="Find the highest rate of REST, SOAP and both together, by bisection.")
@options_of(Group.EFFORT, rare=True)
@click.option("--knee-searches", type=click.IntRange(1, 50), default=KNEE_SEARCHES, help="How often to search for it.")
@click.option("--step-duration", "step_s", type=float, default=STEP_S, help="Seconds of each step, for each interface.")
@options_of(Group.MEASURED)
@click.option(
    "--stream",
    "streams",
    multiple=True,
    metavar="NAME|URL",
    help="Also listen to this stream: an operation that sends events, a WebSocket (ws://…), or a topic of a rosbridge "
    "(ws://…#/odom); repeatable.",
)
@options_of(Group.MEASURED, rare=True)
@click.option("--stamp-field", metavar="POINTER", help="Place of the time in a message, such as /header/stamp.")
@click.option("--clock-field", metavar="POINTER", help="Place of the robot's time in the polled response: /now.")
@options_of(Group.OUTPUT)
@options_of(Group.CREDENTIALS)
@click.option("--token-file", type=_GIVEN, help="File with the robot's bearer token.")
@click.option("--ca-file", type=_GIVEN, help="Certificate authorities to trust.")
@credential_options
@options_of(Group.COMPARED)
@click.option("--against", metavar="URL|STATEMENT", help="Compare with another robot or version; the two take turns.")
@click.option(
    "--tolerance", callback=SHARE, default="5%", help="How much slower than the other, or the baseline, it may be."
)
@options_of(Group.MEASURED)
@click.option(
    "--operators",
    type=click.IntRange(2, 64),
    metavar="N",
    help="Also see how late a stop takes effect while N operators read the state; one of them drives, by the motion "
    "map.",
)
@options_of(Group.CALLS)
@click.option("--allow-motion", is_flag=True, help="Allow the load test to move the robot: measure deliveries too.")
@options_of(Group.COMPARED)
@click.option("--save", metavar="NAME", help="Store the result as a baseline of this name.")
@click.option("--baseline", metavar="NAME", help="Compare with the latest result stored under this name.")
@options_of(Group.COMPARED, rare=True)
@click.option("--baselines", type=_FILE, metavar="DIR", default=FOLDER, help="Folder of baselines.")
@options_of(Group.OUTPUT)
@click.option("--out", metavar="DIR", default=DEFAULT_OUT, help="Folder for the results.")
@click.option("--json", "as_json", is_flag=True, help="Print latency.json to stdout in place of the summary.")
@click.option("--quiet", "-q", "progress", flag_value="none", help="Write no progress; the same as --progress none.")
@options_of(Group.OUTPUT, rare=True)
@click.option(
    "--progress",
    type=click.Choice(["auto", "lines", "none"]),
    default="auto",
    help="What is written to stderr: auto is one line that is renewed on a terminal, and a line in ten seconds "
    "elsewhere; lines is one each second.",
)
def load(targets: tuple[str, ...], **options: Any) -> CommandResult:
    """Measure how fast a robot responds, and compare SOAP with REST.

    DESCRIPTION is the URL or file of an OpenAPI or Swagger description, or of a WSDL: the operations that --operation
    names are measured, or those that a --scenario calls. Only those that read are called, unless --call allows more.

    With --against, two robots take turns, and the result says whether this one is slower than the other.

    Exit codes: 0 service levels kept, and not slower; 1 one of them broken, or slower; 2 usage error; 3 robot not
    reachable; 4 measurement not valid or inconclusive; 130 interrupted.
    """
    end_like_ctrl_c()
    end_with_parent()
    device: Described | None = None
    as_json = bool(options.pop("as_json"))
    stopping: list[Stopping] = []
    context = click.get_current_context()
    summary = context.with_resource(TemporaryFile("w+", encoding="utf-8"))  # noqa: SIM115 - click closes it
    try:
        _hold_folder(context, Path(options["out"]))
        named = Named.of(targets, options)
        kept = _Baselines.of(options.pop("baselines"), options.pop("save"), options.pop("baseline"), as_json=as_json)
        tolerance = options["tolerance"]
        if named.source is None:
            settings = _papers_robot(named.statement, options)
            stopping += _stopping_of(settings)
        else:
            from loadtests.described.run import Described  # noqa: PLC0415 -- the paper's robot need not pay 0.3 s for it

            device = Described.of(named, options)
            settings = device.settings(_command_line())
        with TemporaryDirectory(prefix="roaas-load-") as folder:
            result = _run_load(settings, Path(folder, "written"), summary, device.stopping if device else stopping)
            result = device.beside_operators(result) if device else result
    except (TomlFileError, SettingsError, BaselineError) as error:
        click.echo(f"roaas load: {inert(str(error))}", err=True)
        return CommandResult(ExitCode.USAGE)
    except CallError as error:
        click.echo(f"roaas load: the robot cannot be reached: {inert(str(error))}", err=True)
        return CommandResult(ExitCode.UNREACHABLE)
    except KeyboardInterrupt:
        return CommandResult(ExitCode.INTERRUPTED)
    finally:
        with ignore_signals():
            unstopped = "; ".join(filter(None, (each.stop() for each in (device.stopping if device else stopping))))
        if unstopped:
            click.secho(f"WARNING: {inert(unstopped)}", fg="red", err=as_json)
    result = with_unstopped(result, unstopped) if unstopped else result
    if as_json and result.file is not None:
        click.echo(result.file.read_text(encoding="utf-8"), nl=False)
    elif not as_json:
        for line in stops_lines(result.file):
            say(line)
        summary.seek(0)
        if text := summary.read().rstrip("\n"):
            say(text)
    return kept.after(result, tolerance, context.obj)._replace(tell=not as_json)


def _stopping_of(settings: Settings) -> Iterator[Stopping]:
    """Yield the stops for robots with the paper's interface over REST, if the run makes them drive."""
    others = () if settings.against is None else (settings.against.robot,)
    moved = [] if MOVES.isdisjoint(settings.selection.operations) else [settings.robot, *others]
    for robot in moved:
        if robot.rest:
            from loadtests.described.operators import Stopping  # noqa: PLC0415 -- it takes 0.3 s

            yield Stopping.of_papers_robot(robot)


def _papers_robot(statement: Path | None, options: dict[str, Any]) -> Settings:
    """Return the settings of a run on the paper's robot.

    Raises:
        TomlFileError: a file cannot be used.
        SettingsError: the options do not make a run.
    """
    given = [name for name in DESCRIBED_ONLY if options.pop(name)]
    if given:
        option = given[0].removesuffix("s" if given[0] in {"overlays", "streams"} else "").replace("_", "-")
        raise SettingsError(
            f"--{'call' if option == 'allow' else option} is for a device with a description: name that as well, as in "
            "roaas load http://robot:8000/openapi.json"
        )
    said = load_robot_statement(statement) if statement is not None else RobotStatement()
    other = _other_robot(options, said)
    return settle(CliOptions.of(**options, against=other, command=_command_line()), said)


@dataclass(frozen=True)
class _Baselines:
    """The stored results that a run needs: the folder to store its result in, and the result to compare it with."""

    store_in: Path | None
    old: Path | None

    @classmethod
    def of(cls, baselines: Path, save: str | None, baseline: str | None, *, as_json: bool) -> Self:
        """Check the options before the run.

        Raises:
            BaselineError: a name is not allowed, there is nothing to compare with, or the output is for programs.
        """
        if as_json and (save or baseline):
            raise BaselineError("--json prints one document; --save and --baseline print for people: leave one out")
        old = newest(folder_of(baselines, baseline)) if baseline is not None else None
        return cls(folder_of(baselines, save) if save is not None else None, old)

    def after(self, result: CommandResult, tolerance: float, door: Any) -> CommandResult:
        """Compare and store a run's result; where the run itself passed, the comparison decides the exit code."""
        code = result.exit_code
        if result.file is None:
            return result
        if self.old is not None and door is not None:
            compared = door.compare(self.old, result.file, tolerance)
            code = compared if code == ExitCode.PASSED else code
        if self.store_in is not None:
            try:
                stored = store(result.file, self.store_in)
            except BaselineError as error:
                click.echo(f"roaas load: {inert(str(error))}", err=True)
                return CommandResult(ExitCode.USAGE, result.file)
            click.echo(f"stored: {stored}" if stored else "not stored: the measurement is not valid", err=True)
        return CommandResult(code, result.file)


def _command_line() -> str:
    """Return the command line without the folders of this machine."""
    return command_without_folders(
        sys.argv[1:], ("--operation", "--call", "--never", "--stream", "--stamp-field", "--clock-field")
    )


def _hold_folder(context: click.Context, folder: Path) -> None:
    """Make the folder for the result, and lock it against other runs before the run starts."""
    try:
        context.with_resource(hold(folder))
    except FolderError as error:
        raise SettingsError(f"--out {str(folder)!r}: {error}") from None

"""`roaas load`: options, and the process that does the measuring."""

import os
import shlex
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Any, Self

import click

from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.result_command import CommandResult, ResultCommand
from conformance.contract.toml_file import TomlFileError
from conformance.packs.table1.statement import Statement, load_robot_statement
from conformance.packs.table1.thresholds import load_thresholds
from conformance.statement.statement import Endpoints
from loadtests.measuring.command_line import without_folders
from loadtests.result.baselines import FOLDER, BaselineError, folder_of, newest, store
from loadtests.schedule.plan import CLIENTS, INTERFACES, OPERATIONS
from loadtests.settings.cli_options import KNEE_SEARCHES, CliOptions
from loadtests.settings.settings import STEP_S, Settings
from loadtests.settings.settle import DEFAULT_DURATION_S, DEFAULT_RATE, DEFAULT_WARMUP_S, SettingsError, settle

DEFAULT_OUT = "out"  # as `roaas certify` does
#: NumPy's linear algebra: its threads wait for one another by spinning, ten times as long on a busy machine.
_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
_FILE = click.Path(path_type=Path)
_DESCRIPTIONS = ("publishers_wsdl", "subscribers_wsdl", "publishers_endpoint", "subscribers_endpoint")


def _run_load(settings: Settings, written: Path) -> CommandResult:
    """Carry out a run in a process of its own, which says by a file of ours what it wrote.

    The process has its own session, so that Ctrl-C comes to it through us, once: it then writes what it has.
    """
    child = subprocess.Popen(
        [sys.executable, "-m", "loadtests"],
        stdin=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | _ONE_THREAD,
    )

    def forward(number: int, _: FrameType | None) -> None:
        child.send_signal(number)

    earlier = {number: signal.signal(number, forward) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        if child.stdin is not None:
            child.stdin.write(f"{written}\n{settings.to_json()}")
            child.stdin.close()
        code = child.wait()
    finally:
        for number, handler in earlier.items():
            signal.signal(number, handler)
    if code < 0:  # ended by a signal: before it could take Ctrl-C as a wish, or by force
        code = ExitCode.INTERRUPTED if -code in earlier else ExitCode.INCONCLUSIVE
    return CommandResult(code, Path(written.read_text(encoding="utf-8")) if written.exists() else None)


def _rates(_: click.Context, __: click.Parameter, value: str | None) -> tuple[float, ...]:
    if not value:
        return ()
    try:
        return tuple(float(part) for part in value.split(","))
    except ValueError:
        raise click.BadParameter(f"{value!r} is no list of rates such as 100,200,400") from None


def _counts(_: click.Context, __: click.Parameter, value: str | None) -> tuple[int, ...]:
    try:
        return tuple(sorted({int(part) for part in value.split(",")})) if value else ()
    except ValueError:
        raise click.BadParameter(f"{value!r} is no list of numbers such as 1,8,32,128,512") from None


def _share(_: click.Context, __: click.Parameter, value: str) -> float:
    try:
        return float(value.removesuffix("%")) / 100
    except ValueError:
        raise click.BadParameter(f"{value!r} is no percentage such as 5%") from None


def _other_robot(given: dict[str, Any], own: Statement) -> Statement | None:
    """What the options say of the robot to compare with; without a statement it takes this robot's credentials.

    Raises:
        TomlFileError: its statement cannot be used.
    """
    where = given.pop("against")
    described = {name: given.pop(f"against_{name}") for name in _DESCRIPTIONS}
    if where is not None and "://" not in where:
        return load_robot_statement(Path(where))
    if where is None and not any(described.values()):
        return None
    shared = {name: given[name] or getattr(own.endpoints, name) for name in ("token_file", "ca_file", "timeout_s")}
    return Statement(endpoints=Endpoints(rest=where, **described, **shared))


@click.command(cls=ResultCommand)
@click.argument("statement", required=False, type=_FILE)
@click.option("--rest", metavar="URL", help="The REST interface's base URL.")
@click.option("--publishers-wsdl", metavar="URL|FILE", help="WSDL of the service that takes deliveries.")
@click.option("--subscribers-wsdl", metavar="URL|FILE", help="WSDL of the service that tells the pose.")
@click.option("--publishers-endpoint", metavar="URL", help="Where that service is, when its WSDL does not say.")
@click.option("--subscribers-endpoint", metavar="URL", help="Likewise for the subscribers' service.")
@click.option("--rosbridge", metavar="URL", help="A rosbridge to the robot, to measure as well.")
@click.option(
    "--operation", "operations", multiple=True, type=click.Choice(OPERATIONS), help="What to call (repeatable)."
)
@click.option("--interface", "interfaces", multiple=True, type=click.Choice(INTERFACES), help="Only this interface.")
@click.option("--client", "clients", multiple=True, type=click.Choice(CLIENTS), help="Only this client.")
@click.option("--rate", type=float, help=f"Open model: requests per second (default {DEFAULT_RATE:g}).")
@click.option("--users", type=int, help="Closed model: users that each wait for their answer.")
@click.option("--arrivals", type=click.Choice(["constant", "poisson"]), default="constant", show_default=True)
@click.option("--duration", "duration_s", type=float, help=f"Seconds to measure (default {DEFAULT_DURATION_S:g}).")
@click.option(
    "--warmup", "warmup_s", type=float, help=f"Seconds of load before, not counted (default {DEFAULT_WARMUP_S:g})."
)
@click.option("--timeout", "timeout_s", type=float, help="Deadline of a request in seconds.")
@click.option("--seed", type=int, default=1, show_default=True, help="Fixes schedule, payloads and intervals.")
@click.option(
    "--repeat",
    type=click.IntRange(1, 100),
    default=1,
    show_default=True,
    help="Run the duel so often, each time over new connections; intervals then hold for another run as well.",
)
@click.option(
    "--restart-command", metavar="CMD", help="Start the robot anew before each repeat by this command (no shell)."
)
@click.option("--processes", type=click.IntRange(0, 256), default=1, show_default=True, help="Workers on this machine.")
@click.option(
    "--expect-workers", "expect", type=click.IntRange(0, 1000), default=0, help="Workers in all, on other machines too."
)
@click.option("--master-host", default="127.0.0.1", show_default=True, help="Where the master listens for workers.")
@click.option("--master-port", type=click.IntRange(0, 65535), default=0, help="Its port; 0 picks a free one.")
@click.option("--web-port", type=click.IntRange(1, 65535), help="Show Locust's web UI on this port.")
@click.option("--web-host", default="127.0.0.1", show_default=True, help="Where the web UI and the metrics listen.")
@click.option("--metrics-port", type=click.IntRange(1, 65535), help="Serve the histograms to Prometheus on this port.")
@click.option("--steps", is_flag=True, help="Then step the load up to find where the robot gives way.")
@click.option("--step-rates", callback=_rates, metavar="R,R,…", help="The rates to step through.")
@click.option("--knee", is_flag=True, help="Search by bisection where REST, SOAP and both at once give way.")
@click.option(
    "--knee-searches", type=click.IntRange(1, 50), default=KNEE_SEARCHES, show_default=True, help="How often to search."
)
@click.option("--connections", callback=_counts, metavar="N,N,…", help="Then keep so many connections busy.")
@click.option(
    "--step-duration",
    "step_s",
    type=float,
    default=STEP_S,
    show_default=True,
    help="Seconds for each step and interface.",
)
@click.option("--end-to-end", is_flag=True, help="Also time deliveries until the application has them.")
@click.option("--ros-domain-id", type=click.IntRange(0, 232), help="The robot's ROS domain, for --end-to-end.")
@click.option("--thresholds", type=_FILE, help="TOML file of [[threshold]] tables.")
@click.option("--token-file", metavar="FILE", help="Holds the robot's bearer token.")
@click.option("--ca-file", metavar="FILE", help="Certificate authorities to trust.")
@click.option("--against", metavar="URL|STATEMENT", help="Another robot, or version, to take turns with and compare.")
@click.option("--against-publishers-wsdl", metavar="URL|FILE", help="That robot's WSDLs.")
@click.option("--against-subscribers-wsdl", metavar="URL|FILE", help="Likewise.")
@click.option("--against-publishers-endpoint", metavar="URL", help="Where its services are, when no WSDL says.")
@click.option("--against-subscribers-endpoint", metavar="URL", help="Likewise.")
@click.option(
    "--tolerance", callback=_share, default="5%", show_default=True, help="By how much it may be slower than that."
)
@click.option("--allow-motion", is_flag=True, help="The robot may drive: measure deliveries too.")
@click.option("--save", metavar="NAME", help="Store the result as a baseline of that name.")
@click.option("--baseline", metavar="NAME", help="Compare with the result that was stored last under that name.")
@click.option("--baselines", type=_FILE, metavar="DIR", default=FOLDER, show_default=True, help="Where they are.")
@click.option("--out", metavar="DIR", default=DEFAULT_OUT, show_default=True, help="Where the result goes.")
def load(statement: Path | None, **options: Any) -> CommandResult:
    """Measure how fast a robot answers, SOAP against REST.

    With --against two robots take turns, and what counts is whether this one is slower than that.

    Exit codes: 0 thresholds met, not slower; 1 missed, slower; 2 usage; 3 robot not reachable; 4 measurement not valid,
    or it cannot be told; 130 interrupted.
    """
    try:
        said = load_robot_statement(statement) if statement is not None else Statement()
        kept = _Baselines.of(options.pop("baselines"), options.pop("save"), options.pop("baseline"))
        limits = load_thresholds(options.pop("thresholds")) if options["thresholds"] else ()
        options.pop("thresholds", None)
        other, tolerance = _other_robot(options, said), options["tolerance"]
        settings = settle(CliOptions.of(**options, against=other, thresholds=limits, command=_command_line()), said)
        _check_folder(Path(settings.output.folder))
    except (TomlFileError, SettingsError, BaselineError) as error:
        click.echo(f"roaas load: {error}", err=True)
        return CommandResult(ExitCode.USAGE)
    with TemporaryDirectory(prefix="roaas-load-") as folder:
        result = _run_load(settings, Path(folder, "written"))
    return kept.after(result, tolerance, click.get_current_context().obj)


@dataclass(frozen=True)
class _Baselines:
    """What a run has to do with stored results: the folder to store it in, and the result to compare it with."""

    store_in: Path | None
    old: Path | None

    @classmethod
    def of(cls, baselines: Path, save: str | None, baseline: str | None) -> Self:
        """Look before the run whether all is there.

        Raises:
            BaselineError: a name is none, or there is nothing to compare with.
        """
        old = newest(folder_of(baselines, baseline)) if baseline is not None else None
        return cls(folder_of(baselines, save) if save is not None else None, old)

    def after(self, result: CommandResult, tolerance: float, door: Any) -> CommandResult:
        """Compare and store a run's result; a run that missed nothing else has the comparison's exit code."""
        code = result.exit_code
        if result.file is None:
            return result
        if self.old is not None and door is not None:
            told = door.compare(self.old, result.file, tolerance)
            code = told if code == ExitCode.PASSED else code
        if self.store_in is not None:
            try:
                stored = store(result.file, self.store_in)
            except BaselineError as error:
                click.echo(f"roaas load: {error}", err=True)
                return CommandResult(ExitCode.USAGE, result.file)
            click.echo(f"stored: {stored}" if stored else "not stored: the measurement is not valid", err=True)
            if stored is not None and door is not None:
                door.history(self.store_in)
        return CommandResult(code, result.file)


def _command_line() -> str:
    """As it was given, without the folders of this machine."""
    return shlex.join(["roaas", *map(without_folders, sys.argv[1:])])


def _check_folder(folder: Path) -> None:
    """Fail now rather than after the run."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SettingsError(f"--out {str(folder)!r}: {error.strerror or error}") from None

"""Run other tools, with the same OpenAPI file, against the REST mutants, for comparison.

They are the plain Schemathesis command line, and Specmatic where it is installed. Each run is bounded in time, as our
runs are. A tool kills a mutant when it reports something that it does not report of the good device behind the same
proxy.
"""

import importlib.util
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

from lxml import etree

from proof.mutation.table import Mutant
from proof.selftest.at_once import each_at_once, run_program
from proof.selftest.mutant_run import Pool, become

EXAMPLES, LIMIT_S = 3, 40.0
# Examples of a trial run, which shows how long one takes; fewest and most examples of the run itself.
_TRIED, _FEWEST_EXAMPLES, _MOST_EXAMPLES = 20, 10, 500
# Operation and code of each finding.
Findings = frozenset[tuple[str, str]]


@dataclass(frozen=True)
class Settings:
    """How Schemathesis is run; of these, Specmatic takes the limit of time alone.

    Attributes:
        examples: examples of each operation and phase.
        phases: comma-separated.
        limit_s: time after which a run is ended, s.
        operations: method and path of each operation to call; empty means all.
    """

    examples: int = EXAMPLES
    phases: str = "examples,coverage,fuzzing"
    limit_s: float = LIMIT_S
    operations: tuple[str, ...] = ()


@dataclass(frozen=True)
class Tool:
    """A tool that judges a device by its OpenAPI file, and writes a JUnit file.

    Attributes:
        name: its name, as people know it.
        command: the words that start it.
        arguments: returns the rest: of the description, the device's URL, the folder for the JUnit file, the settings,
            and a bearer token or "".
        finding: matches the code of each finding in the text of a failure.
    """

    name: str
    command: tuple[str, ...]
    arguments: Callable[[str, str, str, Settings, str], list[str]]
    finding: re.Pattern[str]


@dataclass(frozen=True)
class ToolResult:
    """A tool's report on one mutant.

    Attributes:
        mutant: the mutant's name.
        killed: whether the tool reports anything that it does not report of the good device.
        findings: these additional reports, each as "OPERATION CODE".
    """

    mutant: str
    killed: bool
    findings: tuple[str, ...]


@dataclass
class Comparison:
    """A tool's report on all mutants.

    Attributes:
        tool: its name.
        good: its findings on the good device.
        results: results of each mutant.
    """

    tool: str
    good: tuple[str, ...] = ()
    results: list[ToolResult] = field(default_factory=list)

    @property
    def tried(self) -> set[str]:
        """Return the names of the mutants that the tool was run against."""
        return {result.mutant for result in self.results}

    @property
    def killed(self) -> dict[str, tuple[str, ...]]:
        """Return the findings on each mutant that the tool kills, by its name."""
        return {result.mutant: result.findings for result in self.results if result.killed}


def schemathesis() -> Tool | None:
    """Return the Schemathesis command of this environment, or None where it is not installed."""
    beside = Path(sys.executable).with_name("st")
    command = str(beside) if beside.exists() else shutil.which("st")
    if command is None:
        return None
    return Tool("plain Schemathesis", (command,), _of_schemathesis, re.compile(r"^- (ST\d+)", re.MULTILINE))


def specmatic() -> Tool | None:
    """Return Specmatic (its command, or the PyPI package and a Java), or None if it is not installed."""
    package, java, command = importlib.util.find_spec("specmatic"), shutil.which("java"), shutil.which("specmatic")
    if command:
        words: tuple[str, ...] = (command,)
    elif java and package and package.origin:
        words = (java, "-jar", str(Path(package.origin).parent / "core" / "specmatic.jar"))
    else:
        return None
    return Tool("Specmatic", words, _of_specmatic, re.compile(r"^\s+(R\d{4}):", re.MULTILINE))


def best_settings(pool: Pool, tool: Tool, operations: tuple[str, ...], seconds: float) -> Settings:
    """Return settings with all phases, with which a run on the good device takes as long as ours, ``seconds``."""
    tried = Settings(_TRIED, "examples,coverage,fuzzing,stateful", 4 * seconds + 60, operations)
    robot, proxy = pool.take()
    started = time.monotonic()
    try:
        if pool.contract.openapi_path is not None:
            _findings(tool, pool.contract.openapi_path, proxy.before(robot).rest, tried)
    finally:
        pool.give(robot, proxy)
    fitting = int(_TRIED * seconds / (time.monotonic() - started))
    return replace(tried, examples=max(_FEWEST_EXAMPLES, min(fitting, _MOST_EXAMPLES)))


def compare(
    pool: Pool, mutants: Iterable[Mutant], tool: Tool, settings: Settings, tell: Callable[[ToolResult], None]
) -> tuple[str, ...]:
    """Run a tool against every REST mutant that needs no ROS probe; return its findings on the good device."""
    description = pool.contract.openapi_path
    if description is None:
        return ()
    robot, proxy = pool.take()
    try:
        good = _findings(tool, description, proxy.before(robot).rest, settings)
    finally:
        pool.give(robot, proxy)

    def one(mutant: Mutant) -> ToolResult:
        robot, proxy = pool.take()
        try:
            become(proxy, mutant)
            beyond = _findings(tool, description, proxy.before(robot).rest, settings, mutant.token) - good
        finally:
            pool.give(robot, proxy)
        return ToolResult(mutant.name, bool(beyond), _codes(beyond))

    tried = [mutant for mutant in mutants if mutant.interface == "rest" and not mutant.probe]
    each_at_once(one, tried, pool.size, tell)
    return _codes(good)


def _codes(findings: Findings) -> tuple[str, ...]:
    return tuple(sorted(f"{operation} {code}" for operation, code in findings))


def _findings(tool: Tool, description: Path, url: str, settings: Settings, token: str = "") -> Findings:
    """Run a tool through the proxy and return the failures in its JUnit file."""
    with tempfile.TemporaryDirectory() as folder:
        words = [*tool.command, *tool.arguments(str(description), url, folder, settings, token)]
        try:
            run_program(words, folder, settings.limit_s)
        except subprocess.TimeoutExpired:
            return frozenset({("every operation", "no end within the limit")})
        return frozenset(
            (str(case.get("name")).rpartition(" > ")[2], code)
            for report in Path(folder).glob("*.xml")
            for case in etree.fromstring(report.read_bytes()).iter("testcase")
            for problem in case
            if problem.tag in {"failure", "error"}
            for code in tool.finding.findall(problem.text or "") or ["error"]
        )


def _of_schemathesis(description: str, url: str, folder: str, settings: Settings, token: str) -> list[str]:
    words = ["run", description, "--url", url, "--seed", "1"]
    words += ["--max-examples", str(settings.examples), "--phases", settings.phases, "--continue-on-failure"]
    words += ["--request-timeout", "5", "--generation-database", "none", "--no-color"]
    words += ["--report", "junit", "--report-junit-path", f"{folder}/junit.xml"]
    for operation in settings.operations:
        words += ["--include-name", operation]
    return [*words, "-H", f"Authorization: Bearer {token}"] if token else words


def _of_specmatic(description: str, url: str, folder: str, settings: Settings, token: str) -> list[str]:
    """Its tests are as many as its own rules give; it takes a token from its own file alone."""
    del settings, token
    return ["test", description, "--testBaseURL", url, "--timeout-in-ms", "5000", "--junitReportDir", folder]

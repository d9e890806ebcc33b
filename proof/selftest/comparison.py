"""Run other tools, with the same OpenAPI file, against the REST mutants, for comparison.

They are the plain Schemathesis command line, and Specmatic where it is installed. Each run is bounded in time, as our
runs are. A tool kills a mutant when it reports something that it does not report of the good device behind the same
proxy.

Compare a self-test with earlier ones: what notices each mutant, and which good devices are blamed.

Several earlier runs give each kill a probability. A mutant is lost if all of them killed it and a later one did not; if
some of them did, and now fewer than chance leaves; or if a requirement that noticed it in all of them, or one that it
has been merged into, does no longer. What a later run did not try is not compared.
"""

import gzip
import importlib.util
import json
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from math import comb
from pathlib import Path
from typing import Any, Final

from lxml import etree

from conformance.commandline.given_files import read_json, read_octets, unzipped
from proof.mutation.table import Mutant
from proof.selftest.at_once import each_at_once, run_program
from proof.selftest.mutant_run import Pool, become

EXAMPLES, LIMIT_S = 3, 40.0
# Examples of a trial run, which shows the time of one; fewest and most examples that follow from it.
_TRIED, _FEWEST_EXAMPLES, _MOST_EXAMPLES = 20, 10, 500
# Operation and code of each finding.
Findings = frozenset[tuple[str, str]]


@dataclass(frozen=True)
class Settings:
    """How Schemathesis is run; of these, Specmatic takes the limit of time alone.

    Attributes:
        examples: of each operation and phase.
        phases: comma-separated.
        limit_s: time after which a run is ended, s.
        operations: method and path of each operation to call; empty: all.
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
    """What a tool reports of one mutant.

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
    """What one tool reports of all mutants.

    Attributes:
        tool: its name.
        good: its findings on the good device.
        results: of each mutant.
    """

    tool: str
    good: tuple[str, ...] = ()
    results: list[ToolResult] = field(default_factory=list)

    @property
    def tried(self) -> set[str]:
        """Return the names of the mutants that the tool was run against."""
        return {one.mutant for one in self.results}

    @property
    def killed(self) -> dict[str, tuple[str, ...]]:
        """Return the findings on each mutant that the tool kills, by its name."""
        return {one.mutant: one.findings for one in self.results if one.killed}


def schemathesis() -> Tool | None:
    """Return the Schemathesis command of this environment, or None where it is not installed."""
    beside = Path(sys.executable).with_name("st")
    command = str(beside) if beside.exists() else shutil.which("st")
    if command is None:
        return None
    return Tool("plain Schemathesis", (command,), _of_schemathesis, re.compile(r"^- (ST\d+)", re.MULTILINE))


def specmatic() -> Tool | None:
    """Return Specmatic (its command, or the package from PyPI and a Java to run it), or None where it is not there."""
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
        return ToolResult(mutant.name, bool(beyond), _said(beyond))

    tried = [mutant for mutant in mutants if mutant.interface == "rest" and not mutant.probe]
    each_at_once(one, tried, pool.size, tell)
    return _said(good)


def _said(findings: Findings) -> tuple[str, ...]:
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


_FORMAT: Final = "roaas-yardstick/1"
# Probability below which chance is no explanation.
_NO_CHANCE: Final = 0.05
# By mutant or good device: in how many runs it was seen, and in how many each requirement failed or warned.
Table = dict[str, tuple[int, dict[str, int]]]


def gathered(runs: Iterable[Mapping[str, Any]]) -> dict[str, Table]:
    """Return how often each requirement noticed each mutant and blamed each good device, of the runs of a self-test."""
    seen: dict[str, Counter[str]] = defaultdict(Counter)
    by: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    for run in runs:
        rows = [("mutants", one["name"], one["caught"]) for one in run["faults"] if not one["not_tried"]]
        rows += [
            ("by_rule", one["name"], one["by"])
            for one in run.get("generated", {}).get("mutants", ())
            if one["outcome"] in {"caught", "survived"}
        ]
        rows += [
            ("good", " ".join(filter(None, (one["robot"], one["variant"]))), one["blamed"])
            for one in run["good_robots"]
            if not one["not_tried"]
        ]
        for table, name, ids in rows:
            seen[table][name] += 1
            by[table, name].update(set(ids))
    return {
        table: {name: (count, dict(sorted(by[table, name].items()))) for name, count in sorted(names.items())}
        for table, names in sorted(seen.items())
    }


def lost(before: Mapping[str, Table], after: Mapping[str, Table], names: Mapping[str, str]) -> list[str]:
    """Return a sentence on each mutant that is no longer noticed as surely, and on each good device newly blamed.

    Args:
        before: the yardstick.
        after: later runs; what they did not try is not compared.
        names: the present id of each requirement that was renamed or merged.
    """
    said = []
    for table in ("mutants", "by_rule"):
        for name, (runs, by) in before.get(table, {}).items():
            later, found = after.get(table, {}).get(name, (0, {}))
            now = {names.get(id_, id_): count for id_, count in found.items()}
            if not later:
                continue
            surely = {names.get(id_, id_) for id_, count in by.items() if count == runs}
            gone = sorted(id_ for id_ in surely if now.get(id_, 0) < later)
            ever, kills = max(by.values(), default=0), max(now.values(), default=0)
            if not surely and _chance(kills, later, ever / runs) < _NO_CHANCE:
                said.append(f"{name}: noticed in {kills} of {later} runs, and in {ever} of {runs} before")
            elif surely and kills < later:
                said.append(f"{name}: survived, which {', '.join(sorted(surely))} noticed in {runs} of {runs} runs")
            elif gone:
                said.append(f"{name}: no longer noticed by {', '.join(gone)}")
    for name, (_, by) in after.get("good", {}).items():
        known = {names.get(id_, id_) for id_ in before.get("good", {}).get(name, (0, {}))[1]}
        said += [f"{name}: newly blamed by {id_}" for id_ in sorted({names.get(id_, id_) for id_ in by} - known)]
    return said


def _chance(kills: int, runs: int, probability: float) -> float:
    """Return how likely at most so many kills are in so many runs."""
    rest = 1 - probability
    return sum(comb(runs, count) * probability**count * rest ** (runs - count) for count in range(kills + 1))


def read(paths: Iterable[Path]) -> dict[str, Table]:
    """Return what stored runs show: of one yardstick, or of the selftest.json of each run; either may be gzipped.

    Raises:
        OSError: a file cannot be read.
        ValueError: it is neither, or a yardstick among other files.
    """
    documents = []
    for path in paths:
        octets = read_octets(path)
        documents.append(read_json(unzipped(octets) if octets.startswith(b"\x1f\x8b") else octets))
    try:
        if len(documents) == 1 and documents[0].get("format") == _FORMAT:
            tables = {table: names for table, names in documents[0].items() if table != "format"}
            return {
                table: {name: (int(count), {**by}) for name, (count, by) in names.items()}
                for table, names in tables.items()
            }
        return gathered(documents)
    except (AttributeError, LookupError, TypeError) as error:
        raise ValueError(f"no results of a self-test: {error!r}") from error


def stored(tables: Mapping[str, Table]) -> bytes:
    """Return the content of a yardstick's file."""
    return gzip.compress(json.dumps({"format": _FORMAT, **tables}, indent=0, sort_keys=True).encode(), mtime=0)

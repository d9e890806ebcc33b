"""Run the plain Schemathesis command line, with the same OpenAPI file, against the REST mutants, for comparison.

Each run is bounded in time, as our runs are. Schemathesis kills a mutant when it reports something that it does not
report of the good device behind the same proxy.
"""

import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from lxml import etree

from conformance.mutation.mutant import Mutant
from conformance.selftest.at_once import each_at_once, run_program
from conformance.selftest.mutant_run import Pool, become

EXAMPLES, LIMIT_S = 3, 40.0
# Examples of the run that shows how long one takes, and the fewest and most that follow from that.
_TRIED, _FEWEST_EXAMPLES, _MOST_EXAMPLES = 20, 10, 500
_FINDING = re.compile(r"^- (ST\d+)", re.MULTILINE)
# Operation and code of each finding.
Findings = frozenset[tuple[str, str]]


@dataclass(frozen=True)
class Settings:
    """How Schemathesis is run.

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


def best_settings(pool: Pool, operations: tuple[str, ...], seconds: float) -> Settings:
    """Return settings with all phases, with which a run on the good device takes as long as ours, ``seconds``."""
    tried = Settings(_TRIED, "examples,coverage,fuzzing,stateful", 4 * seconds + 60, operations)
    robot, proxy = pool.take()
    started = time.monotonic()
    try:
        if pool.contract.openapi_path is not None:
            _findings(pool.contract.openapi_path, proxy.before(robot).rest, tried)
    finally:
        pool.give(robot, proxy)
    fitting = int(_TRIED * seconds / (time.monotonic() - started))
    return replace(tried, examples=max(_FEWEST_EXAMPLES, min(fitting, _MOST_EXAMPLES)))


@dataclass(frozen=True)
class SchemathesisResult:
    """What Schemathesis reports of one mutant.

    Attributes:
        mutant: the mutant's name.
        killed: whether Schemathesis reports anything that it does not report of the good device.
        findings: these additional reports, each as "OPERATION CODE".
    """

    mutant: str
    killed: bool
    findings: tuple[str, ...]


def command() -> str | None:
    """Return the path of the Schemathesis command in this environment, or None where it is not installed."""
    beside = Path(sys.executable).with_name("st")
    return str(beside) if beside.exists() else shutil.which("st")


def compare(
    pool: Pool,
    mutants: Iterable[Mutant],
    *,
    settings: Settings | None = None,
    tell: Callable[[SchemathesisResult], None],
) -> tuple[Findings, list[SchemathesisResult]]:
    """Run Schemathesis against the good device, and then against every REST mutant that needs no ROS probe."""
    description, settings = pool.contract.openapi_path, settings or Settings()
    if description is None:
        return frozenset(), []
    robot, proxy = pool.take()
    try:
        good = _findings(description, proxy.before(robot).rest, settings)
    finally:
        pool.give(robot, proxy)

    def one(mutant: Mutant) -> SchemathesisResult:
        robot, proxy = pool.take()
        try:
            become(proxy, mutant)
            beyond = _findings(description, proxy.before(robot).rest, settings, mutant.token) - good
        finally:
            pool.give(robot, proxy)
        return SchemathesisResult(
            mutant.name, bool(beyond), tuple(sorted(f"{operation} {code}" for operation, code in beyond))
        )

    tried = [mutant for mutant in mutants if mutant.interface == "rest" and not mutant.probe]
    return good, each_at_once(one, tried, pool.size, tell)


def _findings(description: Path, url: str, settings: Settings, token: str = "") -> Findings:
    """Run Schemathesis through the proxy and return the failures in its JUnit file."""
    schemathesis = command()
    if schemathesis is None:
        return frozenset()
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "junit.xml"
        words = [schemathesis, "run", str(description), "--url", url, "--seed", "1"]
        words += ["--max-examples", str(settings.examples), "--phases", settings.phases, "--continue-on-failure"]
        words += ["--request-timeout", "5", "--generation-database", "none", "--no-color"]
        words += ["--report", "junit", "--report-junit-path", str(report)]
        for operation in settings.operations:
            words += ["--include-name", operation]
        if token:
            words += ["-H", f"Authorization: Bearer {token}"]
        try:
            run_program(words, folder, settings.limit_s)
        except subprocess.TimeoutExpired:
            return frozenset({("every operation", "no end within the limit")})
        if not report.exists():
            return frozenset()
        root = etree.fromstring(report.read_bytes())
        return frozenset(
            (str(case.get("name")), code)
            for case in root.iter("testcase")
            for problem in case
            if problem.tag in {"failure", "error"}
            for code in _FINDING.findall(problem.text or "") or ["error"]
        )

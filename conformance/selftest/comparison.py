"""What the plain Schemathesis command line catches of the REST mutants, with the same OpenAPI file.

It is bounded in time, as our runs are. A mutant counts as caught when Schemathesis reports something that it does not
report of the good robot behind the same proxy: what it says of a good robot is no catch.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from conformance.mutation.messages import unchanged
from conformance.mutation.mutant import Mutant
from conformance.packs.table1.files import CONTRACT_DIR
from conformance.selftest.at_once import each_at_once
from conformance.selftest.mutant_run import RobotPool
from conformance.selftest.proxy import Proxy

EXAMPLES, LIMIT_S = 3, 40.0
_FINDING = re.compile(r"^- (ST\d+)", re.MULTILINE)
# Operation and code of each finding.
Findings = frozenset[tuple[str, str]]


@dataclass(frozen=True)
class SchemathesisResult:
    """What Schemathesis says of one mutant.

    Attributes:
        mutant: its name.
        caught: whether it reports something beyond what it reports of the good robot.
        findings: what is beyond, as "OPERATION CODE".
    """

    mutant: str
    caught: bool
    findings: tuple[str, ...]


def command() -> str | None:
    """The Schemathesis command of this environment, or None."""
    beside = Path(sys.executable).with_name("st")
    return str(beside) if beside.exists() else shutil.which("st")


def compare(
    pool: RobotPool, mutants: Iterable[Mutant], *, tell: Callable[[SchemathesisResult], None]
) -> tuple[Findings, list[SchemathesisResult]]:
    """Run Schemathesis against the good robot, and then against every REST mutant that no ROS probe is needed for."""
    robot, proxy = pool.take()
    try:
        good = _findings(proxy)
    finally:
        pool.give(robot, proxy)

    def one(mutant: Mutant) -> SchemathesisResult:
        robot, proxy = pool.take()
        try:
            proxy.change, proxy.serial = mutant.make(), mutant.serial
            proxy.incomplete_request = mutant.incomplete_request() if mutant.incomplete_request else None
            beyond = _findings(proxy, mutant.token) - good
        finally:
            proxy.change = unchanged
            pool.give(robot, proxy)
        return SchemathesisResult(
            mutant.name, bool(beyond), tuple(sorted(f"{operation} {code}" for operation, code in beyond))
        )

    tried = [mutant for mutant in mutants if mutant.interface == "rest" and not mutant.probe]
    return good, each_at_once(one, tried, pool.size, tell)


def _findings(proxy: Proxy, token: str = "") -> Findings:
    """What Schemathesis reports, by its JUnit file."""
    schemathesis = command()
    if schemathesis is None:
        return frozenset()
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "junit.xml"
        words = [schemathesis, "run", str(CONTRACT_DIR / "openapi.yaml"), "--url", proxy.rest, "--seed", "1"]
        words += ["--max-examples", str(EXAMPLES), "--phases", "examples,coverage,fuzzing", "--continue-on-failure"]
        words += ["--request-timeout", "5", "--generation-database", "none", "--no-color"]
        words += ["--report", "junit", "--report-junit-path", str(report)]
        if token:
            words += ["-H", f"Authorization: Bearer {token}"]
        try:
            subprocess.run(words, capture_output=True, timeout=LIMIT_S, cwd=folder, check=False)  # noqa: S603 - made above
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

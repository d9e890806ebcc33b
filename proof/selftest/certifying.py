"""Run one certification of a self-test in its own process, so that no state reaches the next one."""

import contextlib
import io
import multiprocessing
import os
import signal
import tempfile
import time
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection as Pipe
from pathlib import Path
from typing import Any

import msgspec

from conformance.contract.pack import Contract
from conformance.engine.certification import certify
from conformance.engine.robot_under_test import RobotUnderTest
from conformance.statement.statement import Statement, empty_statement, load_statement
from conformance.target.connecting import connection_of
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Judge
from conformance.verdict.run import Run
from proof.selftest.at_once import safe_path
from proof.selftest.robots import Robot

# Modules that every run imports: loaded once, and inherited by forked processes.
_PRELOADED = ["proof.selftest.preloaded"]
# Time to stop a mutant at the end of a run, s.
_STOP_S = 1.0
#: Names the folder of the pack that is loaded there as well.
PACK_VARIABLE = "ROAAS_SELFTEST_PACK"


@dataclass(frozen=True)
class Job:
    """One certification to run: the device, its statement and the options.

    Attributes:
        pack: folder of the contract pack.
        statement: file of the robot's statement; None if nothing is declared.
        rest: the REST base URL; may be empty.
        publishers: URL of the publishers' WSDL; may be empty, as may ``subscribers``.
        classes: conformance classes to claim instead of the statement's; empty means those of the statement.
        requirements: ids of the requirements to judge; only their checks run; empty means all of the claimed classes.
        effort: quick, standard or deep.
        seed: seed of everything random.
        domain_id: ROS domain of the probe, or None for no probe.
        endpoints: further endpoint options of the statement (ca_file, request_rate).
        secrets: contents of files that endpoint options of the statement name, by the option (token_file).
        timeout_s: time after which the run is killed, s.
        enough: requirements that end the run: after the first failure of one of them no further check starts.
        out: folder in which result.json is kept, or None.
    """

    pack: Path
    statement: Path | None
    rest: str
    publishers: str = ""
    subscribers: str = ""
    classes: tuple[str, ...] = ()
    requirements: tuple[str, ...] = ()
    effort: str = "quick"
    seed: int = 0
    domain_id: int | None = None
    endpoints: dict[str, Any] = field(default_factory=dict)
    secrets: dict[str, str] = field(default_factory=dict)
    timeout_s: float = 120.0
    enough: frozenset[str] = frozenset()
    out: Path | None = None


@dataclass(frozen=True)
class Outcome:
    """The result of one certification.

    Attributes:
        exit_code: exit code of roaas certify; -1 when the run was killed by its timeout.
        verdicts: verdict of each requirement.
        reasons: reason of each verdict other than pass.
        met: requirements whose checks met a failure that is reported under another requirement.
        requests: number of requests sent.
        seconds: duration of the run, s.
    """

    exit_code: int
    verdicts: dict[str, str]
    reasons: dict[str, str]
    requests: int
    seconds: float
    met: frozenset[str] = frozenset()

    @property
    def fails(self) -> frozenset[str]:
        """Return the requirements with the verdict fail."""
        return frozenset(id_ for id_, verdict in self.verdicts.items() if verdict == "fail")

    def not_passed(self) -> tuple[str, ...]:
        """Return the requirements that failed or warned, and those blocked by another requirement's failure."""
        return tuple(id_ for id_, verdict in self.verdicts.items() if verdict in {"fail", "warn"} or id_ in self.met)


def job_at(robot: Robot, **more: Any) -> Job:
    """Return a job that certifies a running device at its addresses."""
    return Job(robot.pack, robot.device.statement, robot.rest, robot.publishers, robot.subscribers, **more)


def run_job(job: Job) -> Outcome:
    """Run a certification and wait for its outcome; kill it when it exceeds the job's timeout."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_PRELOADED)
    os.environ.setdefault(PACK_VARIABLE, str(job.pack))
    ours, theirs = context.Pipe(duplex=False)
    started = time.monotonic()
    process = context.Process(target=_run, args=(job, theirs), daemon=True)
    # Block Ctrl-C: the fork server that may start here, and its children, must not receive it.
    heard = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with safe_path():
            process.start()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, heard)
    theirs.close()
    given_up = Outcome(-1, {}, {}, 0, job.timeout_s)
    try:
        if not ours.poll(job.timeout_s):
            return given_up
        found: dict[str, Any] = ours.recv()
    except EOFError:
        return given_up
    finally:
        process.join(0.5)
        if process.is_alive():
            process.kill()
            process.join()
        ours.close()
    return Outcome(**found, seconds=time.monotonic() - started)


def _run(job: Job, pipe: Pipe) -> None:
    """Certify in the child process and send the outcome through the pipe."""
    with tempfile.TemporaryDirectory() as folder, Path(os.devnull).open("w", encoding="utf-8") as nowhere:
        with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(io.StringIO()):
            certification = certify(robot_of(job, Path(folder)), job.out or Path(folder), progress=None)
        document = certification.document
        items = document["requirements"]
        pipe.send(
            {
                "exit_code": certification.exit_code,
                "verdicts": {item["id"]: item["verdict"] for item in items},
                "reasons": {item["id"]: item["reason"] for item in items if item["verdict"] != "pass"},
                "requests": document["requests"],
                # A requirement that was not tested because the run ended has no case.
                "met": frozenset(item["id"] for item in items if "because_of" in item and item["cases"]),
            }
        )


def statement_of(job: Job, contract: Contract) -> Statement:
    """Return the robot's statement with the addresses and the classes that a job names."""
    statement = load_statement(job.statement, contract) if job.statement else empty_statement(contract)
    wsdls = {"publishers_wsdl": job.publishers or None, "subscribers_wsdl": job.subscribers or None}
    where = msgspec.structs.replace(statement.endpoints, rest=job.rest or None, **wsdls, **job.endpoints)
    statement = msgspec.structs.replace(statement, endpoints=where, claims=job.classes or statement.claims)
    return statement if job.domain_id is None else statement.on_domain(job.domain_id)


def robot_of(job: Job, folder: Path) -> RobotUnderTest:
    """Return the robot and the run that a job describes; the job's secrets are written to files in ``folder``."""
    for option, secret in job.secrets.items():
        (folder / option).write_text(secret, encoding="utf-8")
    job = replace(job, endpoints={**job.endpoints, **{option: str(folder / option) for option in job.secrets}})
    contract = Contract.load(job.pack, only=job.requirements)
    statement = statement_of(job, contract)
    run = Run(
        statement=statement,
        contract=contract,
        claims=statement.claims_of(contract),
        # A described device may belong to somebody, so it is not moved.
        allow_motion=contract.is_claimed,
        seed=job.seed,
        effort=Effort(job.effort),
        # A mutant need not be stopped: nothing moves.
        stop_s=_STOP_S,
    )
    if job.enough:
        run.judge = _EnoughKnown(run, job.enough)
    return RobotUnderTest(run, connection_of(statement.endpoints))


class _EnoughKnown(Judge):
    """A judge that starts no further check once one of the job's ``enough`` requirements has failed."""

    def __init__(self, run: Run, enough: frozenset[str]) -> None:
        super().__init__(run.contract.ledger)
        self._run = run
        # A failure in a class that is not claimed is no verdict.
        claimed = set(map(str, run.claims))
        ledger = run.contract.ledger
        self._enough = frozenset(id_ for id_ in enough if id_ in ledger and ledger[id_].binds(claimed))

    def on_failure(self, requirement: str) -> None:
        """Note whether the run already knows enough."""
        if requirement in self._enough and not self._run.aborted:
            self._run.aborted = f"{requirement} has failed, which is enough to know"

"""A job becomes a run of its own; several at once, also when interrupted."""

import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from conformance.contract.locating import ContractError
from conformance.contract.pack import Contract
from proof.mutation.wire import IncompleteMessageError
from proof.selftest import at_once
from proof.selftest.at_once import each_at_once, run_program
from proof.selftest.certifying import Job, Outcome, robot_of, run_job
from proof.table1.mutants.crowd import later
from proof.table1.selftest import BAROQUE


def job(rest="http://127.0.0.1:9", **more):
    return Job(Contract.load().directory, BAROQUE.statement, rest, f"{rest}/p?wsdl", f"{rest}/s?wsdl", **more)


def test_a_job_says_where_the_robot_is_and_what_is_claimed(tmp_path):
    robot = robot_of(
        job(classes=("http",), secrets={"token_file": tmp_path.name}, endpoints={"request_rate": 5.0}, seed=7), tmp_path
    )
    where = robot.run.statement.endpoints
    told = (where.rest, where.publishers_wsdl, where.request_rate)
    assert told == ("http://127.0.0.1:9", "http://127.0.0.1:9/p?wsdl", 5.0)
    assert Path(where.token_file).read_text() == tmp_path.name
    assert (robot.run.claims, robot.run.seed, robot.run.statement.ros.domain_id) == (("http",), 7, None)


def test_a_job_judges_by_its_requirements_alone(tmp_path):
    assert list(robot_of(job(requirements=("http/date",)), tmp_path).run.contract.ledger) == ["http/date"]
    assert len(robot_of(job(), tmp_path).run.contract.ledger) > 200


def test_a_requirement_that_is_not_there_is_an_error():
    with pytest.raises(ContractError, match="http/no-such"):
        _ = Contract.load(only=("http/no-such",)).ledger


def test_a_run_that_takes_too_long_is_given_up_and_has_caught_nothing(listening):
    outcome = run_job(job(listening(lambda sock: sock.recv(1) and sock.recv(1)), timeout_s=0.2))
    assert (outcome.exit_code, outcome.not_passed()) == (-1, ())


def test_fail_and_warn_count_as_caught():
    verdicts = {"a": "pass", "b": "fail", "c": "warn", "d": "skip", "e": "error"}
    assert Outcome(1, verdicts, {}, 1, 1.0).not_passed() == ("b", "c")


def test_no_further_check_begins_once_enough_is_known(tmp_path):
    run = robot_of(job(enough=frozenset({"http/date"})), tmp_path).run
    run.judge.check("http/date", True, None, "a date")
    run.judge.check("http/head", False, None, "no content")
    assert not run.aborted
    run.judge.check("http/date", False, None, "a date")
    assert run.aborted.startswith("http/date has failed")
    assert run.judge.failure_counts() == {"http/head": 1, "http/date": 1}


def test_what_is_not_claimed_is_never_enough(tmp_path):
    run = robot_of(job(classes=("rest-delivery",), enough=frozenset({"http/date", "rest-delivery/put"})), tmp_path).run
    run.judge.check("http/date", False, None, "a date")
    assert not run.aborted
    run.judge.check("rest-delivery/put", False, None, "2xx")
    assert run.aborted


_WAITS = [sys.executable, "-c", "import time; time.sleep(60)"]


def test_an_interrupt_ends_a_program_that_runs(tmp_path):
    until = time.monotonic() + 30

    def judge(item):
        if item == "interrupt":
            while not at_once._PROGRAMS and time.monotonic() < until:  # noqa: SLF001 - nothing else shows that it runs
                time.sleep(0.01)
            raise KeyboardInterrupt
        run_program(_WAITS, str(tmp_path), 60.0)

    with pytest.raises(KeyboardInterrupt):
        each_at_once(judge, ["interrupt", "program"], 2, lambda _: None)
    assert time.monotonic() < until


def test_a_program_that_does_not_end_is_killed(tmp_path):
    with pytest.raises(subprocess.TimeoutExpired):
        run_program(_WAITS, str(tmp_path), 0.05)


def test_it_is_done_with_its_arguments():
    done, given = threading.Event(), []
    later(0.01, lambda *arguments: (given.extend(arguments), done.set()), 1, "b")
    assert done.wait(30)
    assert given == [1, "b"]


@pytest.mark.parametrize("error", [ConnectionRefusedError, IncompleteMessageError])
def test_a_run_that_is_over_is_nobodys_business(error, monkeypatch):
    told, raised = [], threading.Event()
    monkeypatch.setattr(threading, "excepthook", told.append)

    def act():
        raised.set()
        raise error

    before = set(threading.enumerate())
    later(0, act)
    assert raised.wait(30)
    for thread in set(threading.enumerate()) - before:
        thread.join(5)
    assert told == []

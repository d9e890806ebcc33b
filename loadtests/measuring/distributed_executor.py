"""An executor of worker processes, on this machine or on others, led by a Locust master."""

import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import gevent
import msgspec
from locust.exception import RPCError
from locust.runners import STATE_MISSING, STATE_RUNNING, MasterRunner

from loadtests.clients.payloads import LIBRARY
from loadtests.clients.robot import Robot, Secrets, without_secrets
from loadtests.clients.wire import now_ns
from loadtests.measuring.clocks import Clocks, WorkerClock, clock_id
from loadtests.measuring.errors import GeneratorError
from loadtests.measuring.executor import LEAD_S, LocalExecutor, Member, new_environment
from loadtests.schedule.arrivals import Schedule
from loadtests.schedule.plan import Plan
from loadtests.settings.settings import Generator, Scenario
from loadtests.statistics.recorder import Recorder

_NS = 1_000_000_000
_READY_S = 60.0
#: Beyond a plan's end and its requests' deadline: how long a worker may take to report for the last time.
_GRACE_S = 15.0


class _Master(MasterRunner):
    """A master that distributes the users once.

    Locust distributes them again whenever a worker comes, in mid-run: that kills users of other workers with their
    requests under way, which would not be counted.
    """

    def start(self, *args: Any, **kwargs: Any) -> None:
        """Start the workers' users, unless they are running."""
        if self.state != STATE_RUNNING:
            super().start(*args, **kwargs)


class DistributedExecutor:
    """Carries plans out with workers that a Locust master leads.

    Args:
        generator: where the master listens; how many workers to start here, and how many to wait for in all.
        folder: where workers of this machine store their records if the master dies.
        tell: writes progress to the terminal.
        stopped: returns whether to stop waiting for workers.
    """

    def __init__(
        self, generator: Generator, folder: str, tell: Callable[[str], None], stopped: Callable[[], bool]
    ) -> None:
        host, port = generator.master_host, generator.master_port
        self.environment = new_environment()
        try:
            self.runner = self.environment.runner = _Master(self.environment, host, port)
        except (SystemExit, RPCError) as error:
            raise GeneratorError(
                f"the master cannot listen on {host}:{port}: choose another --master-port ({error})"
            ) from None
        self.recorder = Recorder()
        self.members: list[Member] = []
        self.pacing = ""
        self.tell = tell
        self.stopped = stopped
        self._host, self._port = host, self.runner.server.port if port == 0 else port
        self._folder = folder
        self._processes = generator.processes
        self._expected = max(generator.expect, generator.processes)
        self._children: dict[int, subprocess.Popen[bytes]] = {}
        self._by_client: dict[str, Member] = {}
        self._listening: set[str] = set()
        self._refusals: list[str] = []
        self._prepared = 0
        self._dealt_out = False
        self._began = 0
        self.runner.register_message("roaas_listening", self._on_listening)
        self.runner.register_message("roaas_ready", self._on_ready)
        self.runner.register_message("roaas_done", self._on_done)
        self._clocks = Clocks(self.runner)
        self.environment.events.worker_report.add_listener(self._on_report)

    def prepare(self, robots: Sequence[Robot], plan: Plan, scenario: Scenario | None = None) -> None:
        """Start the workers of this machine, wait for all workers, and start their users.

        Raises:
            GeneratorError: a worker could not get ready.
        """
        here = "127.0.0.1" if self._host in {"*", "0.0.0.0"} else self._host  # noqa: S104 -- compared with, not bound to
        file = None if scenario is None else scenario.file
        for _ in range(self._processes):
            child = subprocess.Popen(  # noqa: S603 -- this very program
                [sys.executable, "-P", "-m", "loadtests.measuring.worker", here, str(self._port)], stdin=subprocess.PIPE
            )
            self._children[child.pid] = child
            if child.stdin is not None:
                told = {"secrets": [Secrets.of(robot) for robot in robots], "folder": self._folder, "scenario": file}
                child.stdin.write(msgspec.json.encode(told) + b"\n")
                child.stdin.close()
        if self._expected > self._processes:
            self.tell(
                f"master on {self._host}:{self._port}: waiting for {self._expected - self._processes} more workers"
            )
        self._wait(lambda: sum(map(self._is_there, self._listening)) >= self._expected, "workers connected")
        job = {
            # Secrets do not travel: each worker has its own.
            "robots": [msgspec.to_builtins(without_secrets(robot)) for robot in robots],
            "operations": list(plan.operations),
            "seed": plan.load.seed,
            "library": LIBRARY in plan.clients,
            "scenario": None if scenario is None else scenario.sha256,
            "credentials": [credential.variable for credential in robots[0].credentials],
        }
        self._dealt_out = True
        self.runner.send_message("roaas_prepare", job)
        self._wait(lambda: self._prepared >= self._expected or bool(self._refusals), "workers are ready")
        if self._refusals:
            raise GeneratorError(f"a worker cannot work: {self._refusals[0]}")
        self.runner.start(plan.connections, spawn_rate=plan.connections)

    def _wait(self, reached: Callable[[], bool], what: str) -> None:
        # Workers of other machines are started by hand; when all have come, no more may join.
        by_hand = self._expected > self._processes and not self._dealt_out
        deadline = time.monotonic() + (10 * _READY_S if by_hand else _READY_S)
        while not reached():
            gevent.sleep(0.02)
            if self.stopped():
                raise GeneratorError("interrupted while waiting for workers")
            dead = [child.returncode for child in self._children.values() if child.poll() is not None]
            if dead:
                raise GeneratorError(f"a worker process ended early, with exit code {dead[0]}")
            if time.monotonic() > deadline:
                raise GeneratorError(f"only {self.runner.worker_count} of {self._expected} {what} in time")

    def _is_there(self, client: str) -> bool:
        """Return whether a worker has not quit and still sends heartbeats."""
        node = self.runner.clients.get(client)
        return node is not None and node.state != STATE_MISSING

    def _on_listening(self, environment: Any, msg: Any) -> None:
        """Register an expected worker; dismiss a worker that connects after the users were distributed."""
        del environment
        if not self._dealt_out:
            self._listening.add(msg.node_id)
            return
        late = max(0.0, (now_ns() - self._began) / _NS) if self._began else 0.0
        member = self._new_member(msg.data, state="late", joined_at_s=late)
        self.tell(f"worker {member.id} ({member.host}) joined {late:.1f} s into the run, too late to take part")
        self.runner.send_message("roaas_late", None, msg.node_id)

    def _new_member(self, told: dict[str, Any], **known: Any) -> Member:
        """Give a worker its number."""
        member = Member(str(len(self.members) + 1), host=told["host"], pid=told["pid"], **known)
        self.members.append(member)
        return member

    def _on_ready(self, environment: Any, msg: Any) -> None:
        del environment
        if msg.data["error"]:
            self._refusals.append(msg.data["error"])
            return
        self._prepared += 1
        self.pacing = msg.data["pacing"]
        clock = WorkerClock(shared=bool(clock_id()) and msg.data["clock"] == clock_id())
        self._by_client[msg.node_id] = self._new_member(msg.data, clock=clock)

    def _on_report(self, client_id: str, data: dict[str, Any]) -> None:
        report, member = data.get("roaas"), self._by_client.get(client_id)
        if report is None or member is None:
            return
        for packed in report["recorded"]:
            part = Recorder.unpack(packed)
            self.recorder.merge(part)
            requests = sum(cell.service.total + cell.errors for cell in part.cells.values())
            member.requests += requests
            member.accounted += requests + sum(cell.dropped for cell in part.cells.values())
        member.cpu_share = report["cpu_share"]
        member.last_report_s = (now_ns() - self._began) / _NS

    def _on_done(self, environment: Any, msg: Any) -> None:
        del environment
        self._on_report(msg.node_id, msg.data)
        member = self._by_client.get(msg.node_id)
        if member is not None:  # a worker that was given up may still report: its report counts
            member.state, member.done, member.lost_at_s, member.share = "finished", True, None, None

    def run(self, plan: Plan, ceiling: float | None, watch: Callable[[float], bool]) -> None:
        """Carry out a plan with the workers that are still connected; return when they have reported."""
        present = [(client, member) for client, member in self._by_client.items() if member.state != "lost"]
        if not present:
            return
        plan = replace(plan, workers=len(present))
        self._read_clocks()
        origin = self._send_off(present, plan, ceiling)
        deadline = plan.length_s + 2 * plan.timeout_s + _GRACE_S
        stopped = False
        while any(not member.done for _, member in present):
            gevent.sleep(0.05)
            elapsed = (now_ns() - origin) / _NS
            self._look_for_lost(present, plan, overdue=elapsed > deadline)
            if not stopped and watch(elapsed):
                stopped = True
                deadline = elapsed + 2 * plan.timeout_s + _GRACE_S
                for client, member in present:
                    if member.state != "lost":
                        self.runner.send_message("roaas_stop", None, client)
        self._read_clocks()

    def _read_clocks(self) -> None:
        """Read the clocks of all connected workers, while no requests are sent."""
        there = [client for client, member in self._by_client.items() if member.state != "lost"]
        for client, reading in self._clocks.read(filter(self._is_there, there)).items():
            clock = self._by_client[client].clock
            if clock is not None:
                clock.add(reading)

    def _send_off(self, present: list[tuple[str, Member]], plan: Plan, ceiling: float | None) -> int:
        """Tell the workers to begin; returns the start, in ns of this clock."""
        clocks = [member.clock for _, member in present if member.clock is not None]
        lead_ns = int(LEAD_S * _NS) + 4 * max((clock.uncertainty_ns for clock in clocks), default=0)
        origin = now_ns() + lead_ns
        self._began = self._began or origin
        for number, (client, member) in enumerate(present):
            member.done, member.accounted = False, 0
            job = {
                "plan": plan.as_message(),
                "worker": number,
                "origin_ns": member.clock.of_master(origin) if member.clock is not None else None,
                "lead_ns": lead_ns,
                "ceiling": ceiling / len(present) if ceiling else None,
            }
            self.runner.send_message("roaas_begin", job, client)
        return origin

    def _look_for_lost(self, present: list[tuple[str, Member]], plan: Plan, *, overdue: bool) -> None:
        """Give up workers whose process has ended, whose heartbeat has stopped, or that are overdue.

        A worker whose heartbeat returns is no longer lost: a busy machine delays heartbeats of workers that still work.
        """
        for number, (client, member) in enumerate(present):
            child = self._children.get(member.pid)
            there = self._is_there(client) and (child is None or child.poll() is None)
            if member.state == "lost" and there and not overdue:
                member.state, member.done, member.lost_at_s, member.share = "finished", False, None, None
                self.tell(f"worker {member.id} ({member.host}) is back")
            elif not member.done and (overdue or not there):
                member.state, member.done, member.lost_at_s = "lost", True, (now_ns() - self._began) / _NS
                if plan.open_model:
                    schedule = Schedule(plan, number, len(present))
                    member.share = sum(schedule.share(index) for index in range(schedule.count()))
                self.tell(f"worker {member.id} ({member.host}) was lost {member.lost_at_s:.1f} s into the run")

    def close(self) -> None:
        """Stop the workers."""
        self.runner.quit()
        for child in self._children.values():
            try:
                child.wait(5)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()


#: Runs plans one after the other.
Executor = LocalExecutor | DistributedExecutor

"""A worker process: `python -m loadtests.measuring.worker HOST PORT`, with a JSON object on its standard input.

The object holds the robots' bearer tokens, `{"tokens": […]}`, which do not travel over the network with the rest.
"""

from __future__ import annotations

import json
import logging
import os
import platform
import signal
import sys
import time
from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

import gevent
import locust.runners

from loadtests.clients.robot import Robot
from loadtests.measuring.executor import REPORT_S, boot_id, new_environment, now_ns
from loadtests.measuring.user_session import Session
from loadtests.schedule.plan import Plan

_NS = 1_000_000_000


class Worker:
    """Carries out what the master says."""

    def __init__(self, environment: Any, host: str, port: int, tokens: Sequence[str | None]) -> None:
        locust.runners.WORKER_REPORT_INTERVAL = REPORT_S
        self.environment = environment
        self.tokens = tokens
        self.session: Session | None = None
        self._report: dict[str, Any] | None = None
        self._reported = 0.0
        environment.events.report_to_master.add_listener(self._on_report)
        self.runner = environment.create_worker_runner(host, port)
        self.runner.register_message("roaas_prepare", self._on_prepare, concurrent=True)
        self.runner.register_message("roaas_begin", self._on_begin, concurrent=True)
        self.runner.register_message("roaas_stop", self._on_stop)
        self.runner.send_message("roaas_listening")  # Locust has long said that we are here, and drops what we await

    def _on_prepare(self, environment: Any, msg: Any) -> None:
        job = msg.data
        error = ""
        try:
            robots = [
                Robot(**robot | {"token": token})
                for robot, token in zip_longest(job["robots"], self.tokens[: len(job["robots"])])
            ]
            self.session = Session(environment, robots, tuple(job["operations"]), job["seed"], library=job["library"])
            self.session.after_segment = self._pack
            environment.roaas_session = self.session
        except Exception as trouble:  # noqa: BLE001 -- whatever it is, the master has to hear of it
            error = f"{type(trouble).__name__}: {trouble}"
        pacing = self.session.pacer.pacing if self.session else ""
        ready = {"error": error, "pacing": pacing, "pid": os.getpid(), "host": platform.node()}
        self.runner.send_message("roaas_ready", ready)

    def _on_begin(self, environment: Any, msg: Any) -> None:
        del environment
        job, session = msg.data, self.session
        if session is None:
            return
        same_clock = job["boot"] and job["boot"] == boot_id()
        origin = job["origin_ns"] if same_clock else now_ns() + int(job["lead_s"] * _NS)
        session.run(Plan.from_message(job["plan"]), job["worker"], origin, job["ceiling"])
        self.runner.send_message("roaas_done", {"roaas": self._packed()})

    def _on_stop(self, environment: Any, msg: Any) -> None:
        del environment, msg
        if self.session is not None:
            self.session.stop()

    def _packed(self) -> dict[str, Any]:
        """Everything recorded since the last report, in parts."""
        session = self.session
        waiting, self._report = self._report, None
        parts = [session.recorder.take()] if session else []
        return {
            "recorded": (waiting["recorded"] if waiting else []) + parts,
            "cpu_share": session.cpu_share if session else None,
        }

    def _pack(self) -> None:
        """In a gap between blocks, where it delays no request: get the next report ready."""
        if self._report is None and time.monotonic() - self._reported >= REPORT_S * 0.5:
            self._report = self._packed()

    def _on_report(self, client_id: str, data: dict[str, Any]) -> None:
        del client_id
        if self._report is not None:
            data["roaas"], self._report = self._report, None
            self._reported = time.monotonic()


def serve(host: str, port: int, tokens: Sequence[str | None]) -> None:
    """Work until the master says quit, or is gone; a token for each robot."""
    logging.getLogger("locust").setLevel(logging.ERROR)
    Worker(new_environment(), host, port, tokens).runner.greenlet.join()


def _follow(parent: int) -> None:
    """End with the process that started us, however it ended."""
    while os.getppid() == parent:
        gevent.sleep(0.5)
    os._exit(1)


def main() -> None:
    """A worker of a master on this machine."""
    told = json.loads(sys.stdin.readline() or "{}")
    gevent.signal_handler(signal.SIGINT, lambda: None)  # the master says when to stop
    gevent.spawn(_follow, os.getppid())
    serve(sys.argv[1], int(sys.argv[2]), told.get("tokens", []))


if __name__ == "__main__":
    main()

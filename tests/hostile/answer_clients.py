"""Call each answer of a server by one client of the load tests; print what became of it, and the largest memory.

``python -m gevent.monkey answer_clients.py wire|library PORT COUNT`` changes the interpreter, as Locust does.
"""

import json
import resource
import sys
import time
from dataclasses import replace

import gevent

from loadtests.clients.endpoint import Endpoint
from loadtests.clients.failures import CallError
from loadtests.clients.library import LibraryRest, Sent
from loadtests.clients.robot import Robot
from loadtests.clients.wire import Connection, Request

_SECONDS = 2.0


def main(client: str, port: int, count: int) -> None:
    """Print an outcome for each answer as a line of JSON."""
    robot = Robot(rest=f"http://127.0.0.1:{port}", publishers=None, subscribers=None, ca_file=None, timeout_s=_SECONDS)
    for number in range(count):
        began, outcomes = time.monotonic(), []
        wire = Connection(Endpoint.parse(robot.rest or ""), _SECONDS)
        library = LibraryRest(replace(robot, rest=f"{robot.rest}/{number}?"), Sent())
        for _ in range(2):
            try:
                if client == "wire":
                    answer = wire.call(Request(f"GET /{number} HTTP/1.1\r\nHost: a\r\n\r\n".encode()))
                    outcomes.append(f"{answer.status} {answer.body[:9]!r}")
                else:
                    with gevent.Timeout(_SECONDS):
                        library.call("pose", {})
                    outcomes.append("200")
            except CallError as error:
                outcomes.append(f"{error.kind}: {error}"[:120])
            except gevent.Timeout:
                outcomes.append("timeout")
        wire.close()
        library.close()
        size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> (20 if sys.platform == "darwin" else 10)
        found = {"seconds": time.monotonic() - began, "outcomes": outcomes, "megabytes": size}
        sys.stdout.write(f"{json.dumps(found)}\n")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))

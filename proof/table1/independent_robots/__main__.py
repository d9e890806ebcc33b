"""Start one of the independent robots: ``python -m proof.table1.independent_robots NAME``."""

import argparse
import signal
import sys
import threading
from dataclasses import replace
from importlib import import_module

from proof.table1.faulty_bodies import FAULTY_BODIES

NAMES = ("plain", "baroque", "legacy", "flask", "aiohttp", "hypercorn")
_WITH_FAULTS = "baroque"


def main() -> int:
    """Serve until SIGTERM or SIGINT. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m proof.table1.independent_robots", description=__doc__)
    parser.add_argument("name", choices=NAMES)
    parser.add_argument("--rest-port", type=int, default=0, help="0: a free one")
    parser.add_argument("--soap-port", type=int, default=0, help="0: a free one")
    parser.add_argument("--fault", choices=FAULTY_BODIES, help="in its body; of the robot baroque only")
    parser.add_argument("--hold-s", type=float, help=f"how long a velocity holds, s; of the robot {_WITH_FAULTS} only")
    given = parser.parse_args()
    if (given.fault or given.hold_s) and given.name != _WITH_FAULTS:
        parser.error(f"--fault and --hold-s: only {_WITH_FAULTS} has other bodies")
    ended = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ended.set())
    module = import_module(f"proof.table1.independent_robots.{given.name}")
    options: dict[str, object] = {}
    if given.fault:
        options["kind"] = FAULTY_BODIES[given.fault]
    if given.hold_s:
        options["build"] = replace(module.BUILD, hold_s=given.hold_s)
    rest, soap, stop = module.serve(given.rest_port, given.soap_port, **options)
    sys.stdout.write(f"ready rest={rest} soap={soap}\n")
    sys.stdout.flush()
    ended.wait()
    stop()
    return 0


if __name__ == "__main__":
    sys.exit(main())

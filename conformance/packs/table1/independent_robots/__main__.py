"""Start one of the independent robots: ``python -m conformance.packs.table1.independent_robots NAME``."""

import argparse
import signal
import sys
import threading
from importlib import import_module

from conformance.packs.table1.faulty_bodies import FAULTY_BODIES

NAMES = ("plain", "baroque", "legacy", "flask", "aiohttp", "hypercorn")
_WITH_FAULTS = "baroque"


def main() -> int:
    """Serve until SIGTERM or SIGINT. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m conformance.packs.table1.independent_robots", description=__doc__)
    parser.add_argument("name", choices=NAMES)
    parser.add_argument("--rest-port", type=int, default=0, help="0: a free one")
    parser.add_argument("--soap-port", type=int, default=0, help="0: a free one")
    parser.add_argument("--fault", choices=FAULTY_BODIES, help="in its body; of the robot baroque only")
    given = parser.parse_args()
    if given.fault and given.name != _WITH_FAULTS:
        parser.error(f"--fault {given.fault}: only {_WITH_FAULTS} has bodies with faults")
    ended = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: ended.set())
    kind = (FAULTY_BODIES[given.fault],) if given.fault else ()
    rest, soap, stop = import_module(f"conformance.packs.table1.independent_robots.{given.name}").serve(
        given.rest_port, given.soap_port, *kind
    )
    sys.stdout.write(f"ready rest={rest} soap={soap}\n")
    sys.stdout.flush()
    ended.wait()
    stop()
    return 0


if __name__ == "__main__":
    sys.exit(main())

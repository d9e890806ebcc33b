"""``make demo``: start a robot, certify it, run a load test, and write the reports, all on this machine."""

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from conformance.commandline.exit_codes import ExitCode
from proof.selftest.robots import own_domain, stop_after

_ROAAS = (sys.executable, "-P", "-m", "roaas")
_START_S = 60
# One operation, and the client that needs the least processor time. So robot and load generator do not overload a
# shared machine, and the difference is significant after half a minute.
_MEASURED = ("--operation", "delivery", "--client", "wire", "--rate", "200", "--warmup", "1")
# What the summary says of each page.
_PAGES = {
    "certificate.html": "the verdict; below it, folded, each requirement and how it was judged",
    "latency.html": "how long SOAP and REST take, and how sure that is",
}
# Lines of a failed command that are shown.
_LAST = 8
_STATEMENT = Path(__file__).parent / "reference_robot" / "statement.toml"


def main() -> int:
    """Run the demo; return the exit code of the certification, or of the load test if the robot conforms.

    A load test without a significant result does not fail the demo; it only means that the machine is busy.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for results and reports [out]")
    parser.add_argument("--duration", type=float, default=25.0, help="seconds of load [25]")
    options = parser.parse_args()
    started = time.time()
    # SIGTERM, which ends a CI job, stops the robot too, like Ctrl-C.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        code = _run(options)
    except KeyboardInterrupt:
        code = int(ExitCode.INTERRUPTED)
    _summary(options.out, started, interrupted=code == ExitCode.INTERRUPTED)
    return code


def _run(options: argparse.Namespace) -> int:
    """Run both commands on a robot that runs until then; return the exit code.

    Raises:
        KeyboardInterrupt: a signal came; the robot is stopped, and the command has written what it had.
    """
    with own_domain(1) as domain, _robot(domain) as (rest, soap):
        endpoints = [str(_STATEMENT), "--rest", rest, "--publishers-wsdl", soap]
        endpoints += ["--subscribers-wsdl", soap.replace("publisher", "subscriber")]
        common = [*endpoints, "--allow-motion", "--out", str(options.out)]
        _say("2/3", f"certifying it: REST {rest}, SOAP {soap}")
        judged = ("--profile", "full", "--effort", "quick", "--ros-domain-id", str(domain))
        certified = _roaas(options.out, "certify", *common, *judged)
        _say("3/3", f"measuring SOAP against REST for {options.duration:g} s")
        loaded = _roaas(options.out, "load", *common, *_MEASURED, "--duration", f"{options.duration:g}")
    return certified or (0 if loaded == ExitCode.INCONCLUSIVE else loaded)


@contextmanager
def _robot(domain: int) -> Iterator[tuple[str, str]]:
    """Run the reference robot on free ports; yield the REST base URL and the WSDL URL of the publishers' service."""
    _say("1/3", f"starting the reference robot on ROS domain {domain}")
    command = [*_ROAAS, "robot", "--rest-port", "0", "--soap-port", "0", "--domain-id", str(domain)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)  # noqa: S603 - ours
    with stop_after(process):
        # Kill a robot that never gets ready, so that the demo does not wait for ever.
        watchdog = threading.Timer(_START_S, process.kill)
        watchdog.daemon = True
        watchdog.start()
        line = process.stdout.readline() if process.stdout else ""
        watchdog.cancel()
        ready = re.match(r"ready rest=(\S+) soap=(\S+)", line)
        if ready is None:
            raise SystemExit(f"the robot did not get ready within {_START_S} s (it printed {line!r})")
        yield ready[1], ready[2]


def _roaas(out: Path, *arguments: str) -> int:
    """Run a command; keep what it says of its progress in a file, and show the last line of it on a terminal."""
    # Each command starts with an environment without the robot's domain.
    environment = {key: value for key, value in os.environ.items() if key != "ROS_DOMAIN_ID"}
    out.mkdir(parents=True, exist_ok=True)
    log = out / f"demo-{arguments[0]}.log"
    shown = sys.stderr.isatty() and os.environ.get("TERM") != "dumb"
    # The results go to files, which the summary reads.
    command, streams = [*_ROAAS, *arguments], {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    with (
        log.open("w", encoding="utf-8") as kept,
        subprocess.Popen(command, env=environment, text=True, errors="replace", **streams) as process,  # noqa: S603 - ours
        _ending(process),
    ):
        for line in process.stderr or ():
            kept.write(line)
            if shown:
                width = shutil.get_terminal_size().columns - 1
                print(f"\r\x1b[K{line.rstrip()[:width]}", end="", file=sys.stderr, flush=True)  # noqa: T201 - it talks
    if shown:
        print("\r\x1b[K", end="", file=sys.stderr, flush=True)  # noqa: T201 - as above
    if process.returncode not in {ExitCode.PASSED, ExitCode.INCONCLUSIVE}:
        print("\n".join(log.read_text(encoding="utf-8").splitlines()[-_LAST:]), file=sys.stderr)  # noqa: T201 - as above
    return process.returncode


@contextmanager
def _ending(process: subprocess.Popen[str]) -> Iterator[None]:
    """After a signal, let a command write what it has; a second signal kills it."""
    try:
        yield
    except KeyboardInterrupt:
        process.terminate()
        try:
            process.communicate()
        except KeyboardInterrupt:
            process.kill()
        raise


def _say(step: str, text: str) -> None:
    print(f"\n== {step} {text}", flush=True)  # noqa: T201 - a demo talks


def _summary(out: Path, started: float, *, interrupted: bool) -> None:
    """Print the results that are not older than the start, and what to look at."""
    result, latency = (_read(out / name, started) for name in ("result.json", "latency.json"))
    seconds = time.time() - started
    lines = [f"== interrupted after {seconds:.0f} s; until then:" if interrupted else f"== done in {seconds:.0f} s"]
    if result:
        passed = sum(value == "pass" for value in result["classes"].values())
        lines.append(f"conformance: {result['verdict']}, {passed} of {len(result['classes'])} classes passed")
    if latency:
        lines.append(f"latency: {latency['headline']['sentence']}")
    pages = [(out / name, what) for name, what in _PAGES.items() if _is_new(out / name, started)]
    lines += ["", "Look at these in a browser:", *(f"  {path}   {what}" for path, what in pages)] if pages else []
    lines += ["", "Then judge a device of your own: roaas certify http://DEVICE/openapi.json"]
    print("\n" + "\n".join(lines))  # noqa: T201 - a demo talks


def _is_new(path: Path, started: float) -> bool:
    return path.exists() and path.stat().st_mtime >= started


def _read(path: Path, started: float) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if _is_new(path, started) else {}
    return document


if __name__ == "__main__":
    sys.exit(main())

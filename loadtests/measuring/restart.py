"""Restarting the robot between repeats, with a command of its owner."""

import shlex
import subprocess
import time
from collections.abc import Callable

import gevent

from loadtests.measuring.errors import GeneratorError
from loadtests.measuring.preflight import Findings

_COMMAND_S = 60.0
_READY_S = 60.0
_LOOK_S = 0.2
_SHOWN = 300


def start_anew(command: str, look: Callable[[], Findings], stopped: Callable[[], bool]) -> None:
    """Run the restart command, and wait until everything that `look` calls responds.

    Raises:
        GeneratorError: the robot did not come back; the message says why.
    """
    _run(command)
    _until_ready(look, stopped)


def _run(command: str) -> None:
    """Run a command without a shell, and wait until it ends."""
    words = shlex.split(command)
    try:
        done = subprocess.run(  # noqa: S603 -- the user's own command, given for this
            words,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            timeout=_COMMAND_S,
            check=False,
        )
    except OSError as error:
        raise GeneratorError(f"--restart-command {command!r}: {error.strerror or error}") from None
    except subprocess.TimeoutExpired:
        raise GeneratorError(
            f"--restart-command {command!r} did not end within {_COMMAND_S:g} s: it must leave the robot running "
            "in the background"
        ) from None
    if done.returncode:
        told = done.stderr.decode("utf-8", "replace").strip()[-_SHOWN:]
        raise GeneratorError(f"--restart-command {command!r} ended with exit code {done.returncode}: {told}")


def _until_ready(look: Callable[[], Findings], stopped: Callable[[], bool]) -> None:
    """Repeat the calls before a run until all of them succeed, or `stopped` returns True."""
    deadline = time.monotonic() + _READY_S
    while True:
        findings = look()
        if not findings.failures or stopped():
            return
        if time.monotonic() > deadline:
            raise GeneratorError(
                f"the robot did not come back within {_READY_S:g} s of its restart: {'; '.join(findings.messages())}"
            )
        gevent.sleep(_LOOK_S)

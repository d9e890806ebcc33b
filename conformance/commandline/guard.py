"""Keep a fault of the suite, a full disk or a closed terminal from looking like a verdict."""

import io
import os
import sys
import tempfile
import traceback
from pathlib import Path
from typing import Any, TextIO

import click

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.help_pages import inert
from conformance.commandline.secrecy import SECRETS

_SHOWN = 300
# Messages of Python and its module loader when memory is exhausted, in other exceptions than MemoryError.
_NO_MEMORY = ("failed to map segment", "cannot allocate memory", "can't start new thread", "out of memory")
# Address space that each command needs, MB. With less, libraries may end the process with exit code 1 or an abort
# instead of MemoryError.
_LEAST_MB = {"certify": 400, "replay": 400, "judge": 400, "explain": 120, "load": 1_200}
# Memory to free when none is left, so that the error can be reported.
_RESERVE = bytearray(1 << 20)


def lacks_addresses(command: str) -> str:
    """Return why a command cannot run within this process's limit of addresses (ulimit -v); empty if it can."""
    if resource is None or command not in _LEAST_MB:
        return ""
    given = resource.getrlimit(resource.RLIMIT_AS)[0]
    if given == resource.RLIM_INFINITY or given >= _LEAST_MB[command] << 20:
        return ""
    return (
        f"this process may use {given >> 20:,} MB of addresses (ulimit -v); {command} needs {_LEAST_MB[command]:,} MB"
    )


class _Lenient(io.FileIO):
    """A file descriptor whose reader may close, as `head` does: further output is then dropped."""

    def write(self, octets: Any, /) -> int:
        try:
            return super().write(octets) or 0
        except OSError:
            return memoryview(octets).nbytes


class _Masking(io.BufferedWriter):
    """A buffer that masks secrets. A text stream gives it each text whole, unless its own buffer is full before."""

    def write(self, octets: Any, /) -> int:
        super().write(SECRETS.masked_bytes(bytes(octets)))
        return memoryview(octets).nbytes


def make_streams_lenient() -> None:
    """Let the process end with the exit code of its verdict also where nobody reads its stdout or stderr any more.

    What it writes there shows no secret.
    """
    sys.stdout = _lenient(sys.stdout, sys.__stdout__)
    sys.stderr = _lenient(sys.stderr, sys.__stderr__)


def _lenient(stream: TextIO | None, own: TextIO | None) -> TextIO:
    """Return a stream that never fails; one that a test or a program put in place of the process's stays."""
    if stream is None:
        # The stream was closed before the process began; without this, a socket would get its number.
        return Path(os.devnull).open("w", encoding="utf-8")
    if stream is not own:
        return stream
    raw = _Lenient(stream.fileno(), "wb", closefd=False)
    return io.TextIOWrapper(_Masking(raw), stream.encoding, stream.errors, line_buffering=True)


def inert_lines(text: str) -> str:
    """Return a text whose lines control neither a terminal nor a CI job."""
    return "\n".join(map(inert, text.split("\n")))


def is_of_memory(error: BaseException) -> bool:
    """Return whether an exception means that the process gets no more memory or threads."""
    return isinstance(error, MemoryError) or any(said in str(error).lower() for said in _NO_MEMORY)


def report_failure(error: Exception) -> ExitCode:
    """Print one sentence on an exception that no command expects, and where the details are; return the exit code."""
    if is_of_memory(error):
        _RESERVE.clear()
        traceback.clear_frames(error.__traceback__)
        click.echo(
            "error: this process got no more memory or threads (ulimit -v, or a container's limit). Nothing was judged "
            "by this; a result that was begun is kept.",
            err=True,
        )
        return ExitCode.INCONCLUSIVE
    if isinstance(error, OSError) and error.errno is not None:
        said = f"error: {inert(str(error))[:_SHOWN]}. Nothing was judged by this."
        click.echo(said, err=True)
        return ExitCode.INCONCLUSIVE
    text = inert(f"{type(error).__name__}: {error}")[:_SHOWN]
    click.echo(
        f"error: the suite itself failed, and says nothing of the device: {text}. Please report this{_keep(error)}.",
        err=True,
    )
    return ExitCode.INCONCLUSIVE


def _keep(error: Exception) -> str:
    """Write the traceback to a file; return its path, as the end of a sentence, or an empty text."""
    try:
        descriptor, path = tempfile.mkstemp(prefix="roaas-error-", suffix=".txt")
        with os.fdopen(descriptor, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.write(SECRETS.masked("".join(traceback.format_exception(error))))
    except (OSError, RecursionError, MemoryError):
        return ""
    return f"; the details are in {path}"

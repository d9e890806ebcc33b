"""Judge several devices in parallel threads; each result is reported when it is ready, and Ctrl-C stops all of them."""

import multiprocessing
import subprocess
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import Final, TypeVar

import pytest

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
# Wait after a killed certification before the next try, s: a mutant may be tried several times.
_AGAIN_S: Final = 0.1
# Programs that are running.
_PROGRAMS: set[subprocess.Popen[bytes]] = set()
_STARTING = threading.Lock()


@contextmanager
def safe_path() -> Iterator[None]:
    """Let Python processes that multiprocessing starts here import no module from the working directory."""
    with _STARTING, pytest.MonkeyPatch.context() as environment:
        environment.setenv("PYTHONSAFEPATH", "1")
        yield


def run_program(words: Sequence[str], folder: str, limit_s: float) -> None:
    """Run a program in a folder until it ends; each_at_once() kills it when it is interrupted. Its output is discarded.

    Raises:
        subprocess.TimeoutExpired: it did not end within ``limit_s``, and was killed.
    """
    # The words are the caller's.
    with subprocess.Popen(words, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as program:  # noqa: S603
        _PROGRAMS.add(program)
        try:
            program.wait(limit_s)
        finally:
            _PROGRAMS.discard(program)
            program.kill()


def each_at_once(
    judge: Callable[[_Item], _Result], items: Iterable[_Item], at_once: int, tell: Callable[[_Result], None]
) -> list[_Result]:
    """Judge each item in a thread, ``at_once`` at a time; return the results in the items' order.

    Args:
        judge: certifies one item in a process of its own (certifying.run_job).
        items: the items to judge.
        at_once: number of items judged in parallel.
        tell: called with each result as soon as it is ready, never twice at a time and never after an interrupt.

    Raises:
        KeyboardInterrupt: after the running certifications and programs were killed and their robots stopped.
    """
    lock, interrupted = threading.Lock(), threading.Event()

    def judge_and_tell(item: _Item) -> _Result:
        result = judge(item)
        with lock:
            if not interrupted.is_set():
                tell(result)
        return result

    with ThreadPoolExecutor(at_once) as executor:
        judged = [executor.submit(judge_and_tell, item) for item in items]
        try:
            return [future.result() for future in judged]
        except BaseException:
            interrupted.set()
            executor.shutdown(wait=False, cancel_futures=True)
            running = [future for future in judged if not future.cancelled()]
            while wait(running, _AGAIN_S).not_done:
                for process in multiprocessing.active_children():
                    process.kill()
                for program in tuple(_PROGRAMS):
                    program.kill()
            raise

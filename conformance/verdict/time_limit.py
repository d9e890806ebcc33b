"""The time limit of a run (``--minutes``): requests within it, and requests left out."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Container, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

from conformance.transport.exchange import NotPermittedError
from conformance.verdict.finding import count_of, few_of


class TimeIsOverError(NotPermittedError):
    """Raised instead of sending a request after the time of the run is over."""


@dataclass
class TimeLimit:
    """The time that a run may take.

    Attributes:
        minutes: from the first request on, min; None means as long as it needs.
        shortened: operations that were not sent all requests.
        uncalled: operations that may be called, and were not; known at the end of the run.
        is_struck: whether anything was left out.
    """

    minutes: float | None = None
    shortened: set[str] = field(default_factory=set)
    uncalled: tuple[str, ...] = ()
    is_struck: bool = False
    _began: float = math.nan
    _lifted: bool = True

    def begin(self) -> None:
        """Begin to count the time."""
        self._began, self._lifted = time.monotonic(), False

    def end(self) -> None:
        """Allow requests again: the last ones stop the device and repeat failures."""
        self._lifted = True

    @property
    def has_limit(self) -> bool:
        """Whether the run has a limit."""
        return self.minutes is not None

    @property
    def reason(self) -> str:
        """Why something was not tested."""
        return f"the time of --minutes {self.minutes:g} was over" if self.minutes is not None else ""

    @property
    def over(self) -> bool:
        """Whether no further request may be sent."""
        return not self._lifted and self.is_past(1.0)

    def is_past(self, share: float) -> bool:
        """Return whether this share of the time is over, 0 to 1."""
        if self.minutes is None or not time.monotonic() - self._began > share * 60 * self.minutes:
            return False
        self.is_struck = True
        return True

    def check(self) -> None:
        """Raise TimeIsOverError when the time is over."""
        if self.over:
            raise TimeIsOverError(self.reason)

    def in_turns(self, steps: Mapping[str, Iterator[None]], share: float, behind: Container[str] = ()) -> bool:
        """Take all steps of each operation, one operation after the other; return whether all were taken.

        With a limit, each operation takes a step in turn, and after the first turn only until a share of the time is
        over: the first steps, which tell the most, are taken for all.

        Args:
            steps: for each operation, an iterator that sends the next requests.
            share: 0 to 1.
            behind: operations that begin a turn later.
        """
        if not self.has_limit:
            for step in steps.values():
                deque(step, maxlen=0)
        waiting, is_first = dict(steps) if self.has_limit else {}, True
        while waiting:
            for label, step in list(waiting.items()):
                if is_first and label in behind:
                    continue
                if not is_first and self.is_past(share):
                    self.shortened |= waiting.keys()
                    return False
                try:
                    is_done = next(step, self) is self
                except Exception:
                    # A step that the time limit interrupts ends the survey of all operations.
                    if self.over:
                        self.shortened |= waiting.keys()
                    raise
                if is_done:
                    del waiting[label]
            is_first = False
        return True

    @contextmanager
    def lift(self, *, when: bool = True) -> Iterator[None]:
        """Allow requests inside: a movement that was begun is ended, and a lost device is waited for."""
        before, self._lifted = self._lifted, self._lifted or when
        try:
            yield
        finally:
            self._lifted = before

    @property
    def fewer(self) -> list[str]:
        """The operations that were called, and not sent all requests."""
        return sorted(self.shortened.difference(self.uncalled))

    def left_out(self, operations: int, unjudged: list[str]) -> str:
        """Return what the limit left out, as a sentence.

        Args:
            operations: how many operations there are.
            unjudged: ids of requirements that were not judged.
        """
        uncalled, shortened = self.uncalled, self.fewer
        said = [
            f"{len(uncalled)} of {count_of(operations, 'operation')} not called: {few_of(uncalled)}"
            if uncalled
            else "",
            f"{count_of(len(shortened), 'operation')} got fewer requests: {few_of(shortened)}" if shortened else "",
            f"{count_of(len(unjudged), 'requirement')} not judged: {few_of(unjudged)}" if unjudged else "",
        ]
        said = list(filter(None, said)) or ["some requests were not sent"]
        return f"--minutes {self.minutes or 0:g}: {'; '.join(said)}"

"""Judge every exchange of a run by checkers, whichever check sent it."""

from collections.abc import Iterable
from contextlib import nullcontext
from typing import Final

from conformance.transport.exchange import Attempt, Exchange, Listener, Unanswered
from conformance.verdict.case import Checker
from conformance.verdict.evidence import Judge

_SHOWN: Final = 100


class Observers(Listener):
    """Calls checkers with every exchange. What they judge holds for every response, errors included.

    Args:
        judge: records their cases.
        checkers: the checkers.
        by_rule: whether a server error that they judge is a broken rule of its own (see Judge.by_rule).
    """

    def __init__(self, judge: Judge, checkers: Iterable[Checker], *, by_rule: bool = True) -> None:
        self._judge, self._by_rule = judge, by_rule
        self._checkers = tuple(checkers)

    def answered(self, exchange: Exchange) -> None:
        """Judge an exchange."""
        self._check(exchange)

    def unanswered(self, request: Unanswered) -> None:
        """Judge a request without a response."""
        self._check(request)

    def acted_by_hand(self, *, deletes: bool) -> None:
        """Tell the checkers that know what was written before."""
        for checker in self._checkers:
            if (forget := getattr(checker, "forget", None)) is not None:
                forget(deletes=deletes)

    def _check(self, attempt: Attempt) -> None:
        """Call each checker; what one cannot judge is no reason not to judge the rest of the run."""
        with self._judge.by_rule() if self._by_rule else nullcontext():
            for checker in self._checkers:
                try:
                    for case in checker(attempt):
                        self._judge.record(case)
                except Exception as error:  # noqa: BLE001 - whatever it is, it is told
                    request = attempt.request
                    self._judge.fault(f"{request.method} {request.target.partition('?')[0][:_SHOWN]}", error)

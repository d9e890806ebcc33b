"""Observers: judge every exchange of a run, whichever check sent it."""

from collections.abc import Callable, Iterable
from typing import Final, TypeVar

from conformance.transport.exchange import Attempt, Exchange, Listener, Unanswered
from conformance.verdict.evidence import Judge

_Attempt = TypeVar("_Attempt", bound=Attempt)
_SHOWN: Final = 100


class Observers(Listener):
    """Calls observers with every exchange. What they judge holds for every response, errors included.

    Args:
        judge: records their judgements.
        observers: the observers.
    """

    def __init__(self, judge: Judge, observers: Iterable[Listener]) -> None:
        self._judge = judge
        self._observers = tuple(observers)

    def answered(self, exchange: Exchange) -> None:
        """Call each observer with an exchange."""
        with self._judge.by_rule():
            for observer in self._observers:
                self._call(observer.answered, exchange)

    def unanswered(self, request: Unanswered) -> None:
        """Call each observer with a request without a response."""
        with self._judge.by_rule():
            for observer in self._observers:
                self._call(observer.unanswered, request)

    def _call(self, observe: Callable[[_Attempt], None], attempt: _Attempt) -> None:
        """Call an observer; what it cannot judge is no reason not to judge the rest of the run."""
        try:
            observe(attempt)
        except Exception as error:  # noqa: BLE001 - whatever it is, it is told
            request = attempt.request
            self._judge.fault(f"{request.method} {request.target.partition('?')[0][:_SHOWN]}", error)

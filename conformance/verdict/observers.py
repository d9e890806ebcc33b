"""Observers: judge every exchange of a run, whichever check sent it."""

from collections.abc import Iterable

from conformance.transport.exchange import Exchange, Listener, Unanswered
from conformance.verdict.evidence import Judge


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
                observer.answered(exchange)

    def unanswered(self, request: Unanswered) -> None:
        """Call each observer with a request without a response."""
        with self._judge.by_rule():
            for observer in self._observers:
                observer.unanswered(request)

"""Observers judge every exchange of a run, whatever check it belongs to."""

from __future__ import annotations

from typing import TYPE_CHECKING

from conformance.transport.exchange import Listener

if TYPE_CHECKING:
    from collections.abc import Iterable

    from conformance.transport.exchange import Exchange, Unanswered
    from conformance.verdict.evidence import Judge


class Observers(Listener):
    """Has observers judge every exchange; what they judge holds for every response, errors included.

    Args:
        judge: takes what they see.
        observers: each is shown every exchange.
    """

    def __init__(self, judge: Judge, observers: Iterable[Listener]) -> None:
        self._judge = judge
        self._observers = tuple(observers)

    def answered(self, exchange: Exchange) -> None:
        """Show an exchange to each observer."""
        with self._judge.by_rule():
            for observer in self._observers:
                observer.answered(exchange)

    def unanswered(self, request: Unanswered) -> None:
        """Show a request without a response to each observer."""
        with self._judge.by_rule():
            for observer in self._observers:
                observer.unanswered(request)

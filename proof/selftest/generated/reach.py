"""Which composed faults a run would meet at all: each is tried on the messages of a run of the good device.

A fault that alters none of them cannot be noticed, and a run that shows it takes as long as any.
"""

from collections.abc import Iterable
from typing import Final

from proof.mutation.messages import Forward, HangUpError, Request, Response
from proof.selftest.generated.mutant import GeneratedMutant, Tally
from proof.selftest.generated.places import Exchange

# Larger messages are attacks by their size, which no generated fault is about.
_LARGEST: Final = 100_000
# Conditions that the clock or other requests decide, which messages alone do not show.
_OF_TIME: Final = frozenset({"now-and-then", "after-pause", "together"})
Message = tuple[Request, Response]


class Recorder:
    """A change that changes nothing and keeps each exchange.

    Attributes:
        messages: requests and responses, in the order of the responses.
    """

    def __init__(self) -> None:
        self.messages: list[Message] = []

    def __call__(self, request: Request, forward: Forward) -> Response:
        """Forward the request, and keep it with its response."""
        response = forward(request)
        if len(request.body) + len(response.body) < _LARGEST:
            self.messages.append((request.copy(), response.copy()))
        return response


def unreached(mutants: Iterable[GeneratedMutant], messages: list[Message]) -> frozenset[str]:
    """Return the names of the faults that alter none of the messages, or would alter none without their condition."""
    mutants = [one for one in mutants if one.always is not None]
    exchanges = {one.exchange.name: one.exchange for one in mutants}
    by_operation = {name: _around(exchange, messages) for name, exchange in exchanges.items()}
    return frozenset(one.name for one in mutants if not _alters(_shown(one), by_operation[one.exchange.name]))


def _around(exchange: Exchange, messages: list[Message]) -> list[Message]:
    """Return the messages of an operation, each after the one before it, on which a condition may depend."""
    concerned = {number for number, (request, _) in enumerate(messages) if exchange.concerns(request)}
    return [message for number, message in enumerate(messages) if number in concerned or number + 1 in concerned]


def _shown(mutant: GeneratedMutant) -> GeneratedMutant:
    """Return what messages show of a fault: without its condition, where messages alone do not decide that."""
    _, _, condition = mutant.operator.partition("@")
    return mutant.always if mutant.always is not None and condition in _OF_TIME else mutant


def _alters(mutant: GeneratedMutant, messages: list[Message]) -> bool:
    tally = Tally()
    change = mutant.make(tally)
    for request, response in messages:

        def forward(_request: Request, response: Response = response) -> Response:
            return response.copy()

        try:
            change(request.copy(), forward)
        except HangUpError:
            return True
        if tally.altered:
            return True
    return False

"""How long the usual requests of a described API take when all other checks have run."""

from dataclasses import dataclass
from typing import Final

from conformance.api.rest.interface import RestInterface
from conformance.scenarios.scenario import NotPossibleError, scenario
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.transport.exchange import Exchange, NoAnswerError
from conformance.verdict.time_limit import TimeIsOverError

# Each is sent so often: the quickest of them waited for nobody else.
TIMED_AGAIN: Final = 5


@dataclass(frozen=True)
class TimedAgain:
    """One operation that reads.

    Attributes:
        operation: method and path template.
        first: the usual exchange at the beginning of the run.
        times: response times at its end, ms.
        last: the last of these exchanges.
    """

    operation: str
    first: Exchange
    times: tuple[float, ...]
    last: Exchange


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.LAST)
def timed_again(api: RestInterface) -> tuple[TimedAgain, ...]:
    """Send the usual requests that read once more, a few times each."""
    found = []
    for label, call in api.working.items():
        if not label.startswith("GET ") or label in api.streams:
            continue
        try:
            exchanges = [call.send(api) for _ in range(TIMED_AGAIN)]
        except (NoAnswerError, TimeIsOverError):
            continue  # what does not respond, other rules tell
        times = tuple(one.response.elapsed_ms for one in exchanges)
        found.append(TimedAgain(label, api.first[label], times, exchanges[-1]))
    if not found:
        raise NotPossibleError("no operation that only reads was answered 2xx")
    return tuple(found)

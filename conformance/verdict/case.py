"""One case: what a checker or a rule says of one exchange by one requirement."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from conformance.transport.exchange import Attempt
from conformance.verdict.finding import Showing


@dataclass(frozen=True, slots=True)
class Case:
    """One case of a requirement.

    Attributes:
        holds: whether the device meets the requirement in this case.
        exchange: the evidence, or None.
        expected: what the requirement demands here, as a noun phrase.
        observed: what was seen instead; empty: a description of the response.
        cause: failures of the same cause are one finding; empty: derived from the texts.
        subject: what was tested; empty: method and target of the request.
        operations: how each operation shows it, that of the exchange first, if not only that of the request.
        requirement: its id or an alias; empty where a rule is bound to one.
    """

    holds: bool
    exchange: Attempt | None
    expected: str
    observed: str = ""
    cause: str = ""
    subject: str = ""
    operations: tuple[Showing, ...] = ()
    requirement: str = ""


def case(
    requirement: str,
    holds: bool,  # noqa: FBT001 - reads as a sentence: case(id, answer.status == 200, ...)
    exchange: Attempt | None,
    expected: str,
    found: str = "",
    cause: str = "",
) -> Case:
    """Return a case of a requirement; the arguments are as in Case."""
    return Case(holds, exchange, expected, found, cause, requirement=requirement)


#: Judges the exchanges of a run one after another, in the order in which they ended.
Checker = Callable[[Attempt], Iterator[Case]]

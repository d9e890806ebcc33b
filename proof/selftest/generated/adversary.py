"""Composed faults (an effect, a place, and a time, client or value), and samples of generated mutants.

Effects and places are those of the mutants by rule that work always; so each composed fault breaks a clause as they do,
if less often. Each is first tried on the messages of a run of the good device: a run takes as long as any to show a
fault that alters none of them, and so cannot be noticed.
"""

import math
import random
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

from conformance.contract.pack import Contract
from conformance.documents.openapi import operations_of
from proof.mutation.messages import Change, Forward, HangUpError, Request, Response
from proof.selftest.generated.judging import KILLED, NOT_REACHED, SURVIVED, GeneratedResult
from proof.selftest.generated.mutant import (
    OF_FORMATS,
    OF_NUMBERS,
    OF_TEXTS,
    TIMES,
    GeneratedMutant,
    Tally,
    When,
    striking,
)
from proof.selftest.generated.places import Exchange, places

# Standard deviations of the normal distribution that contain 95 %.
_Z: Final = 1.959964


def sample(mutants: Iterable[GeneratedMutant], number: int, seed: int) -> list[GeneratedMutant]:
    """Return ``number`` mutants (or all, if there are fewer), taking one of each stratum (operator, class) in turn.

    The strata are in random order, so that small samples with different seeds leave out different strata.
    """
    dice = random.Random(seed)  # noqa: S311 - a sample that can be drawn again, nothing secret
    strata: dict[tuple[str, str], list[GeneratedMutant]] = defaultdict(list)
    for mutant in mutants:
        strata[mutant.operator, mutant.exchange.class_].append(mutant)
    for group in strata.values():
        dice.shuffle(group)
    order = list(strata)
    dice.shuffle(order)
    chosen: list[GeneratedMutant] = []
    while order and len(chosen) < number:
        chosen += [strata[stratum].pop() for stratum in order][: number - len(chosen)]
        order = [stratum for stratum in order if strata[stratum]]
    return chosen


@dataclass(frozen=True)
class Rate:
    """The kill rate of those mutants that altered at least one message.

    Attributes:
        killed: number of mutants killed.
        survived: number of mutants that survived.
        not_reached: number of mutants that altered no message; they do not count.
    """

    killed: int
    survived: int
    not_reached: int

    @property
    def share(self) -> float:
        """Return killed / (killed + survived); 1 where both are zero."""
        return self.killed / self.reached if self.reached else 1.0

    @property
    def reached(self) -> int:
        """Return the number of mutants that altered at least one message."""
        return self.killed + self.survived

    @property
    def bound(self) -> float:
        """Return the lower bound of Wilson's 95 % interval for the share (E. B. Wilson, JASA 22, 1927)."""
        return self._wilson(-1) if self.reached else 0.0

    @property
    def top(self) -> float:
        """Return the upper bound of the same interval."""
        return min(1.0, self._wilson(1)) if self.reached else 1.0

    def _wilson(self, side: int) -> float:
        n, p = self.reached, self.share
        centre = p + _Z**2 / (2 * n)
        return (centre + side * _Z * math.sqrt(p * (1 - p) / n + _Z**2 / (4 * n**2))) / (1 + _Z**2 / n)

    def words(self) -> str:
        """Return the rate as a phrase for people."""
        reached = f"{self.killed} of {self.reached} ({self.share:.1%}, at least {self.bound:.1%})"
        return f"{reached}, {self.not_reached} not reached" if self.not_reached else reached


def rate_of(results: Iterable[GeneratedResult]) -> Rate:
    """Return the kill rate of some results."""
    outcomes = [result.outcome for result in results]
    return Rate(outcomes.count(KILLED), outcomes.count(SURVIVED), outcomes.count(NOT_REACHED))


def rates_by(results: Iterable[GeneratedResult], key: str) -> dict[str, Rate]:
    """Return kill rates grouped by a key of group_of()."""
    groups: dict[str, list[GeneratedResult]] = defaultdict(list)
    for result in results:
        groups[group_of(result, key)].append(result)
    return {name: rate_of(group) for name, group in sorted(groups.items())}


def group_of(result: GeneratedResult, key: str) -> str:
    """Return the group in which a result is counted.

    Args:
        result: the result.
        key: ``operator``, ``when`` it strikes, ``class``, ``clause`` of the contract, ``operation``, or ``effort`` of
            the last run.
    """
    mutant = result.mutant
    operator, _, when = mutant.operator.partition("@")
    return {
        "operator": operator,
        "when": when or "always",
        "class": mutant.exchange.class_,
        "clause": _clause(mutant),
        "operation": mutant.exchange.name,
        "effort": result.effort,
    }[key]


def _clause(mutant: GeneratedMutant) -> str:
    """Return the clause of the contract that a mutant breaks: that of headers or formats, or of its operation."""
    exchange = mutant.exchange
    if exchange.clause and mutant.operator.startswith("header-"):
        return "HTTP"
    if exchange.clause and exchange.side == "rest" and mutant.name.endswith((":xml", ":text")):
        return "Formats"
    return exchange.clause or exchange.class_


_NUMBERS = frozenset({"number", "integer"})
# Effects that last or grow by themselves.
_LASTING = frozenset({"hang", "slower"})
# Effects that repeat an earlier message: there is none the first time.
_REPEATING = frozenset({"freeze", "delay", "ignore", "lag", "crossed"})
# Larger messages are attacks by their size, and no generated fault concerns size.
_LARGEST: Final = 100_000
# Conditions that depend on the clock or on other requests, not on one message.
_OF_TIME: Final = frozenset({"now-and-then", "after-pause", "together"})
Message = tuple[Request, Response]


def kinds_in_requests(contract: Contract) -> Mapping[str, frozenset[str]]:
    """Return by operation the kinds of values that its requests may have."""
    found: dict[str, frozenset[str]] = defaultdict(frozenset)
    if not contract.is_claimed:
        for operation in operations_of(contract):
            schemas = [parameter.schema for parameter in operation.parameters]
            schemas += [body.schema for body in operation.bodies.values()]
            found[operation.label] = frozenset(re.findall(r"'type': '(\w+)'", repr(schemas)))
        return found
    for place in places(contract):
        if place.part == "request":
            found[place.exchange.name] |= {place.kind}
    return found


def compose(mutants: tuple[GeneratedMutant, ...], kinds: Mapping[str, frozenset[str]]) -> tuple[GeneratedMutant, ...]:
    """Return each mutant that works always, and its composition with each condition that its operation can meet.

    Args:
        mutants: mutants by rule.
        kinds: the kinds of values in the requests of each operation.
    """
    always = [mutant for mutant in mutants if "@" not in mutant.operator]
    return tuple(one for mutant in always for one in _compositions(mutant, kinds[mutant.exchange.name]))


def _compositions(mutant: GeneratedMutant, kinds: frozenset[str]) -> Iterator[GeneratedMutant]:
    yield mutant
    if mutant.operator in _LASTING:
        return
    conditions = dict(TIMES)
    if kinds & _NUMBERS:
        conditions.update(OF_NUMBERS)
    if "string" in kinds:
        conditions.update(OF_TEXTS)
    if len(mutant.exchange.formats) > 1 and not mutant.name.endswith((":xml", ":json")):
        conditions.update(OF_FORMATS)
    if mutant.operator in _REPEATING:
        del conditions["first"]
    for name, (phrase, when) in conditions.items():
        yield replace(
            mutant,
            name=f"{mutant.operator}@{name}{mutant.name.removeprefix(mutant.operator)}",
            says=f"{mutant.says.removesuffix('.').removesuffix(', every time')}, {phrase}.",
            operator=f"{mutant.operator}@{name}",
            make=partial(_make, mutant, when),
            always=mutant,
        )


def _make(mutant: GeneratedMutant, when: When, tally: Tally) -> Change:
    return striking(partial(mutant.make, tally), mutant.exchange, when)


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


def unreached_names(mutants: Iterable[GeneratedMutant], messages: list[Message]) -> frozenset[str]:
    """Return the names of the faults that alter none of the messages, or would alter none without their condition."""
    mutants = [mutant for mutant in mutants if mutant.always is not None]
    exchanges = {mutant.exchange.name: mutant.exchange for mutant in mutants}
    by_operation = {name: _around(exchange, messages) for name, exchange in exchanges.items()}
    return frozenset(
        mutant.name for mutant in mutants if not _alters(_without_condition(mutant), by_operation[mutant.exchange.name])
    )


def _around(exchange: Exchange, messages: list[Message]) -> list[Message]:
    """Return an operation's messages, each after the message on which a condition may depend."""
    concerned = {number for number, (request, _) in enumerate(messages) if exchange.concerns(request)}
    return [message for number, message in enumerate(messages) if number in concerned or number + 1 in concerned]


def _without_condition(mutant: GeneratedMutant) -> GeneratedMutant:
    """Return a fault without its condition, if messages alone do not decide whether the condition holds."""
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

"""Faults that are composed: an effect, a place where it works, and a time, client or value for which it does.

Effects and places are those of the mutants by rule that work always; so each composed fault breaks a clause as they do,
if less often.
"""

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

from conformance.contract.pack import Contract
from conformance.documents.openapi import operations_of
from proof.mutation.messages import Change
from proof.selftest.generated.mutant import GeneratedMutant, Tally
from proof.selftest.generated.places import places
from proof.selftest.generated.whens import OF_FORMATS, OF_NUMBERS, OF_TEXTS, TIMES, When, striking

_NUMBERS = frozenset({"number", "integer"})
# Effects that last or grow by themselves.
_LASTING = frozenset({"hang", "slower"})
# Effects that repeat what came before: the first time there is nothing.
_REPEATING = frozenset({"freeze", "delay", "ignore", "lag", "crossed"})


def kinds_in_requests(contract: Contract) -> Mapping[str, frozenset[str]]:
    """Return by operation the kinds of values that its requests may have."""
    found: dict[str, frozenset[str]] = defaultdict(frozenset)
    if not contract.is_claimed:
        for operation in operations_of(contract):
            schemas = [one.schema for one in operation.parameters]
            schemas += [body.schema for body in operation.bodies.values()]
            found[operation.label] = frozenset(re.findall(r"'type': '(\w+)'", repr(schemas)))
        return found
    for place in places(contract):
        if place.part == "request":
            found[place.exchange.name] |= {place.kind}
    return found


def composed(mutants: tuple[GeneratedMutant, ...], kinds: Mapping[str, frozenset[str]]) -> tuple[GeneratedMutant, ...]:
    """Return each mutant that works always, and its composition with each condition that its operation can meet.

    Args:
        mutants: mutants by rule.
        kinds: the kinds of values in the requests of each operation.
    """
    always = [mutant for mutant in mutants if "@" not in mutant.operator]
    return tuple(one for mutant in always for one in _composed(mutant, kinds[mutant.exchange.name]))


def _composed(mutant: GeneratedMutant, kinds: frozenset[str]) -> Iterator[GeneratedMutant]:
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

"""Which of the many requests for an operation a run sends: values of several members together, and drawn ones."""

from collections.abc import Container, Iterator
from itertools import islice
from typing import Final

from conformance.api.rest.inputs import Inputs
from conformance.api.rest.invalid_variations import invalid_variations
from conformance.api.rest.values import Values
from conformance.api.rest.variations import Variation, odd_variations, together, unknown_variations, valid_variations
from conformance.documents.openapi import Operation
from conformance.verdict.effort import Effort

# At standard effort, for each operation: _CASES drawn, of which _MOST are sent by kind. Drawn, because schemas that
# refer to each other can make millions.
_CASES: Final = 400
_MOST: Final = {"valid": 60, "invalid": 60, "odd": 40}
_LEAST: Final = {"valid": 40, "invalid": 28, "odd": 12}
# Valid requests to an operation that changes something, because each leaves something behind.
_ACTING: Final = 12
#: An operation that once took longer than a second gets this fraction of the requests.
SLOW_SHARE: Final = 4


def draw_requests(
    operation: Operation, usual: Inputs, values: Values, effort: Effort, seed: int, slow: Container[str] = ()
) -> Iterator[list[Variation]]:
    """Yield the valid, the invalid and the odd requests that are sent to an operation.

    Operations whose labels are in ``slow`` when a group is drawn get fewer.
    """
    valid = list(islice(valid_variations(operation, usual, values), _CASES))
    if not operation.safe:
        valid = together(operation, usual, valid)
        whole = [variation for variation in valid if variation.parts or variation.place.startswith("body /")][:_ACTING]
        others = [variation for variation in valid if variation not in whole]
        valid = [*whole, *effort.draw(others, _ACTING, f"{seed}/valid {operation.label}")]
    groups = {
        "valid": [*valid, *unknown_variations(operation, usual)],
        "invalid": list(islice(invalid_variations(operation, usual), _CASES)),
        "odd": list(islice(odd_variations(operation, usual), _CASES)),
    }
    sent = set[str]()
    for name, variations in groups.items():
        standard = max(_MOST[name], round(_LEAST[name] / effort.factor))
        standard //= SLOW_SHARE if operation.label in slow else 1
        if name == "odd":
            # Some were sent already as valid or invalid values.
            variations = [variation for variation in variations if repr(variation.inputs) not in sent]  # noqa: PLW2901 - fewer of them
        own, common = (
            [variation for variation in variations if variation.is_common is is_common] for is_common in (False, True)
        )
        found = effort.draw_first(own, common, standard, f"{seed}/{name} {operation.label}")
        sent.update(repr(variation.inputs) for variation in found)
        yield found


def order_of(operation: Operation) -> tuple[int, int]:
    """Return the rank of an operation: lists come before operations that need their ids."""
    ranks = {"GET": 0, "HEAD": 0, "OPTIONS": 0, "POST": 2, "PUT": 3, "PATCH": 3}
    rank = ranks.get(operation.method, 4)
    return (rank + 1 if rank == 0 and operation.parameter("path") else rank), len(operation.parameter("path"))


def has_input(operation: Operation) -> bool:
    """Return whether an operation takes a query or a body."""
    return bool(operation.parameter("query") or operation.bodies)

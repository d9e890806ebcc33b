"""Operations by turns: each as often as its weight says, its calls spread evenly."""

import math
from collections.abc import Sequence

#: At most so many turns for each operation are waited for in a block: a rare operation is not called in every block.
_MOST_TURNS = 4


def rotation(offered: Sequence[int], weights: Sequence[int]) -> tuple[int, ...]:
    """Return the numbers of the operations in the order in which they are called (nginx's smooth weighted round robin).

    Args:
        offered: the numbers of the operations.
        weights: of all operations, by number; empty where they are called equally often.
    """
    if not weights or not offered:
        return tuple(offered)
    own = {number: weights[number] for number in offered}
    total, credit, made = sum(own.values()), dict.fromkeys(offered, 0), []
    for _ in range(total // math.gcd(*own.values())):
        for number, weight in own.items():
            credit[number] += weight
        chosen = max(offered, key=lambda number: credit[number])
        credit[chosen] -= total
        made.append(chosen)
    return tuple(made)


def share(number: int, weights: Sequence[int], operations: int) -> float:
    """Return the share of one operation in the requests for all `operations`."""
    return weights[number] / sum(weights) if weights else 1 / operations


def turns_of_all(weights: Sequence[int], operations: int) -> int:
    """Return how many requests it takes until each operation has been called, up to four for each operation."""
    if not weights:
        return operations
    return min(sum(weights) // math.gcd(*weights), _MOST_TURNS * operations)

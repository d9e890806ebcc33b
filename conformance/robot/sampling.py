"""Fewer of many fixed cases, where a robot takes its time to answer."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Sequence

    from conformance.verdict.effort import Effort

_T = TypeVar("_T")
_SLOW_MS = 50.0
_FEWEST = 8


def some(items: Sequence[_T], effort: Effort) -> list[_T]:
    """All items for a robot that answers quickly; for a slow one a few, spread over them, the first among them."""
    if effort.usual_ms < _SLOW_MS or len(items) <= _FEWEST:
        return list(items)
    return [items[index * len(items) // _FEWEST] for index in range(_FEWEST)]

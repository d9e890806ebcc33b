"""The topics of requirements, in the order in which pages and terminals show them."""

from collections.abc import Iterator, Sequence
from typing import Protocol, TypeVar

QUESTIONS = {
    "hurt": "Can it hurt?",
    "service": "Does it do what it says?",
    "clients": "Do stock clients work?",
    "hostile": "Does it withstand hostile input?",
    "hygiene": "Hygiene",
}
"""Topics by key, with the heading that readers see."""
FOLDED = "hygiene"
"""The topic that pages fold: good form, which seldom matters."""


class _HasTopic(Protocol):
    @property
    def topic(self) -> str: ...


_Item = TypeVar("_Item", bound=_HasTopic)


def by_topic(items: Sequence[_Item]) -> Iterator[tuple[str, list[_Item]]]:
    """Yield each topic that occurs with its items; those without a topic (before contract 1.2) come first."""
    for topic in ("", *QUESTIONS):
        found = [item for item in items if item.topic == topic]
        if found:
            yield topic, found

"""Describe the failures ("findings") of a conformance result in words, for all pages and CI formats alike.

Since version 1.2 a failure's `message` says what the suite sent, what it expected by which rule, and what it got.
Before 1.2 `message` held only what the suite got; then the text is composed here.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Protocol, TypeVar

# The end of a sentence before the next one.
_SENTENCE = re.compile(r"(?<=[.])\s+(?=[A-Z`])")
CAUSES = {
    "no-response": "No response",
    "hang": "No complete response in time",
    "server-error": "Server error",
    "unreadable": "Unreadable response",
    "rule": "Rule not met",
}
"""Kinds of causes, the most urgent first, with the heading that pages show."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One failure of a requirement.

    Attributes:
        requirement: the requirement's entry in result.json.
        failure: the failure's entry in result.json.
        blocks: ids of the requirements that the suite could not test because of this failure.
    """

    requirement: Mapping[str, Any]
    failure: Mapping[str, Any]
    blocks: tuple[str, ...] = ()

    @property
    def number(self) -> int | None:
        """Return the finding's number in the result (1 is the most urgent); None before version 1.2."""
        number: int | None = self.failure.get("number")
        return number

    @property
    def topic(self) -> str:
        """Return the key of the requirement's topic; empty before contract 1.2."""
        return str(self.requirement.get("topic", ""))

    @property
    def cause(self) -> str:
        """Return the key of the kind of cause in `CAUSES`, such as "server-error"; "rule" by default."""
        return str(self.failure.get("cause", "rule"))

    @property
    def subject(self) -> str:
        """Return method and path of the request, or the requirement's id if no single request shows the failure."""
        request = self.failure["request"]
        sent = f"{request['method']} {request['url']}" if request else str(self.requirement["id"])
        return str(self.failure.get("subject") or sent)

    @property
    def text(self) -> str:
        """Return the failure in words: what the suite sent, what it expected by which rule, and what it got."""
        if "observed" in self.failure:
            return str(self.failure["message"])
        sent = f"Sent `{self.subject}`. " if self.failure["request"] else ""
        rule = ", ".join(filter(None, (self.requirement["id"], self.requirement["source"])))
        expected, got = (self.failure[key].rstrip(". ") for key in ("expected", "message"))
        seen = f" Seen {self.failure['seen']:,} times." if self.failure["seen"] > 1 else ""
        return f"{sent}Expected {expected} ({rule}). Got {got}.{seen}"

    @property
    def rule(self) -> str:
        """Return the first sentence of the requirement."""
        return _SENTENCE.split(str(self.requirement["text"]), maxsplit=1)[0]

    @property
    def brief(self) -> str:
        """Return what was expected of the request and what it got, without the request's fields and body."""
        if "observed" not in self.failure:
            return self.text
        expected, got = (str(self.failure[key]).rstrip(". ") for key in ("expected", "observed"))
        doubt = self.failure.get("doubt")
        may = f" This is a warning, because a right device may do the same: {doubt}." if doubt else ""
        return f"`{self.subject}`: expected {expected}. Got {got}.{may}"


def findings(requirements: Sequence[Mapping[str, Any]], result: Mapping[str, Any]) -> list[Finding]:
    """Return the findings of some requirements, sorted so that a vendor should look at the first one first."""
    blocks = {cause["number"]: tuple(cause["blocks"]) for cause in result.get("causes", ())}
    found = [
        Finding(requirement, failure, blocks.get(failure.get("number"), ()))
        for requirement in requirements
        for failure in requirement["failures"]
    ]
    return sorted(found, key=lambda finding: finding.number or 0)


def by_requirement(found: Sequence[Finding]) -> Iterator[tuple[Mapping[str, Any], list[Finding]]]:
    """Yield each requirement with its findings; a requirement occurs again if other findings stand between its own."""
    for _, group in groupby(found, key=lambda finding: finding.requirement["id"]):
        own = list(group)
        yield own[0].requirement, own


def by_cause(found: Sequence[Finding]) -> Iterator[tuple[str, list[Finding]]]:
    """Yield the heading of each kind of cause with its findings, the most urgent kind first."""
    for cause in sorted({finding.cause for finding in found}, key=list(CAUSES).index):
        yield CAUSES[cause], [finding for finding in found if finding.cause == cause]


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

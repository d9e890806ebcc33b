"""Which operations of an API a run may call, and why not the others."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from fnmatch import fnmatchcase
from functools import lru_cache
from typing import TYPE_CHECKING, Final

from conformance.documents.openapi import Operation
from conformance.statement.motion_calls import named_by
from conformance.verdict.finding import count_of, few_of

if TYPE_CHECKING:
    from conformance.verdict.run import Run

#: Words in a path or operationId that say that a call may do harm, whatever its method.
HARMFUL: Final = frozenset(
    {
        "shutdown", "poweroff", "reboot", "restart", "delete", "erase", "wipe", "purge", "destroy", "format", "install",
        "uninstall", "firmware", "flash", "factory", "reset", "upgrade", "downgrade", "update", "upload", "shell",
        "script", "exec", "execute", "eval", "sudo", "kill", "terminate", "network", "wifi", "hotspot", "auth", "oauth",
        "login", "logout", "token", "password", "secret", "credentials",
    }
)  # fmt: skip
# Those of them that say so as a value too, such as one of the commands that a parameter has.
_AS_VALUES: Final = frozenset(
    {
        "shutdown",
        "poweroff",
        "reboot",
        "restart",
        "erase",
        "wipe",
        "destroy",
        "factory",
        "uninstall",
        "kill",
        "terminate",
    }
)
_SEVERAL: Final = frozenset(f"{word}s" for word in HARMFUL - {"format"})
# Things whose upload changes nothing else.
_RECORDS: Final = frozenset(
    f"{word}{end}"
    for word in ("media", "photo", "picture", "image", "video", "recording", "attachment", "document", "note")
    for end in ("", "s")
)
# An operationId often names what the operation does, as in `deleteMap`: such words count as the method's own.
_OF_METHODS: Final = {method: frozenset(words) for method, words in {
    "DELETE": ("delete", "deletes", "destroy", "destroys"), "PUT": ("update", "updates"), "PATCH": ("update", "updates")
}.items()}  # fmt: skip
_WORD: Final = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
_PARAMETER: Final = re.compile(r"\{[^{}]*\}")


class Reason(StrEnum):
    """Why an operation is called or not."""

    SAFE = "its method is safe"
    READS = "by its name it only reads"
    ALLOWED = "--call allows it"
    CHANGES = "it may change something: --call allows it"
    MAPPED = "the map in the statement names it"
    MOVES = "it moves the device: --allow-motion allows it"
    NEVER = "--never excludes it"
    EXCLUDED = "the description excludes it (x-roaas-never)"
    HARMFUL = "its name, or a value of it, warns of harm: --call with its full method and path allows it"

    @property
    def may(self) -> bool:
        """Whether the operation is called."""
        return self in {Reason.SAFE, Reason.READS, Reason.ALLOWED, Reason.MAPPED}


@dataclass(frozen=True)
class CallRules:
    """The user's rules on which operations may be called.

    Attributes:
        allow: patterns of operations that may be called although they are not safe.
        never: patterns of operations that must not be called.
        motion: whether the device may be moved.
        by_author: whether the author of a contract says what moves the device, and permits all else.
    """

    allow: tuple[str, ...] = ()
    never: tuple[str, ...] = ()
    motion: bool = False
    by_author: bool = False

    @classmethod
    def of(cls, run: Run) -> CallRules:
        """Return the rules of a run."""
        calls = run.statement.calls
        return cls(calls.allow, calls.never, run.allow_motion, run.contract.is_claimed)

    def decide(self, operation: Operation) -> Reason:
        """Return whether an operation may be called, with the reason."""
        allowed = Reason.ALLOWED if self.motion or not operation.motion else Reason.MOVES
        if self.by_author:
            return allowed
        if operation.never:
            return Reason.EXCLUDED
        if any(matches(pattern, operation) for pattern in self.never):
            return Reason.NEVER
        named = any(is_literal(pattern, operation) for pattern in self.allow)
        if not named and harmful_words(operation):
            return Reason.HARMFUL
        if operation.safe and not operation.motion:
            return Reason.READS if operation.reads else Reason.SAFE
        is_permitted = operation.safe or any(matches(pattern, operation) for pattern in self.allow)
        return allowed if is_permitted else Reason.CHANGES

    def unused_patterns(self, operations: Sequence[Operation]) -> list[str]:
        """Return the patterns that match no operation."""
        patterns = (*self.allow, *self.never)
        return [pattern for pattern in patterns if not any(matches(pattern, operation) for operation in operations)]


def matches(pattern: str, operation: Operation) -> bool:
    """Return whether a pattern means an operation: "METHOD PATH", "PATH", an operationId or a tag; * is any text."""
    method, _, path = pattern.strip().partition(" ")
    if path:
        fits = method in {"*", operation.method} or method.upper() == operation.method
        return fits and fnmatchcase(operation.template, path.strip())
    named = (operation.template, operation.id, *operation.tags)
    return any(fnmatchcase(name, pattern.strip()) for name in named)


def is_literal(pattern: str, operation: Operation) -> bool:
    """Return whether a pattern names one operation without a wildcard, by method and path or by its operationId."""
    return pattern.strip() in {operation.label, operation.id}


@lru_cache(maxsize=1024)
def harmful_words(operation: Operation) -> tuple[str, ...]:
    """Return the words in an operation's path, id, tags and declared values that say that it may do harm."""
    text = f"{_PARAMETER.sub(' ', operation.template)} {operation.id}"
    # A tag names a group of operations: its words are no warning for an operation that only reads.
    text += "" if operation.safe else f" {' '.join(operation.tags)}"
    words = words_of(text) - _OF_METHODS.get(operation.method, frozenset())
    words -= {"upload", "uploads"} if words & _RECORDS else set()
    words -= {"update"} if operation.created else set()
    values = {"".join(_WORD.findall(value)).lower() for value in _declared_values(operation)}
    return tuple(sorted((words & (HARMFUL | _SEVERAL)) | (values & _AS_VALUES)))


def _declared_values(operation: Operation) -> Iterator[str]:
    """Yield the texts that an operation's parameters and the members of its bodies may be."""
    schemas = [parameter.schema for parameter in operation.parameters if parameter.where in {"path", "query"}]
    bodies = (body.schema.get("properties", {}) for body in operation.bodies.values() if isinstance(body.schema, dict))
    schemas += [member for members in bodies for member in members.values()]
    for schema in schemas:
        given = schema.get("enum", ()) if isinstance(schema, dict) else ()
        yield from (value for value in given if isinstance(value, str))


def words_of(text: str) -> set[str]:
    """Return the words of a path, a query or an id in lower case, those within camelCase included."""
    return {word.lower() for word in _WORD.findall(text)}


def plan_lines(rules: CallRules, operations: Sequence[Operation], mapped: Collection[str] = ()) -> list[str]:
    """Return lines on which operations a run calls, and why not the others.

    Args:
        rules: what the user says.
        operations: operations of the description.
        mapped: the calls that maps in the statement send in this run.
    """
    by_reason: dict[Reason, list[str]] = {}
    moving = named_by(mapped, [operation.label for operation in operations])
    for operation in operations:
        reason = rules.decide(operation)
        sent = operation.label in moving and not reason.may and reason not in {Reason.NEVER, Reason.EXCLUDED}
        by_reason.setdefault(Reason.MAPPED if sent else reason, []).append(operation.label)
    called = [label for reason, labels in by_reason.items() if reason.may for label in labels]
    changing = by_reason.get(Reason.ALLOWED, []) + by_reason.get(Reason.MAPPED, [])
    kept = len(operations) - len(called)
    all_ = count_of(len(operations), "operation")
    lines = [f"Calls {len(called)} of {all_}; state is changed by {len(changing)}; not called: {kept}."]
    for reason in Reason:
        labels = by_reason.get(reason, [])
        if labels and reason is not Reason.SAFE:
            verb = "  Calls" if reason.may else "  Does not call"
            named = f", as in --call '{labels[0]}'" if reason is Reason.HARMFUL else ""
            lines.append(f"{verb} {len(labels)}, because {reason}{named}: {few_of(labels)}")
    stops = [operation.label for operation in operations if operation.stop]
    if stops and changing:
        lines.append(f"  Sends at the end, to stop the device (x-roaas-stop): {few_of(stops)}")
    return lines

"""Find what a device needs before it moves, by the description's words: a lease, and commands such as enable and home.

The suite sends none of these operations before the device has refused a command, or accepted it and stayed where it is.
"""

from __future__ import annotations

import itertools
import json
import posixpath
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import msgspec

from conformance.api.call_rules import CallRules, harmful_words, matches, words_of
from conformance.documents.openapi import Operation
from conformance.engine.commanded import body_schema, commanded_by, parts_of, with_query
from conformance.engine.map_text import inline, template_of
from conformance.scenarios.motion.preparing import WANTS_LEASE
from conformance.scenarios.motion.templates import fill
from conformance.scenarios.scenario import NotPossibleError
from conformance.statement.motion_calls import NAME, names_operation
from conformance.statement.motion_map import Lease, Step
from conformance.transport.exchange import Exchange

_LEASES: Final = frozenset(
    {"lease", "leases", "lock", "control", "acquire", "claim", "reserve", "reservation", "session"}
)
_KEEPS: Final = frozenset({"renew", "heartbeat", "keepalive", "keep", "refresh", "extend"})
_RELEASES: Final = frozenset({"release", "unlock", "free", "return", "relinquish"})
# Words for operations that make a device ready, in the usual order, with the word for the opposite, if any.
_READY: Final = {
    "enable": "disable", "arm": "disarm", "activate": "deactivate", "on": "off", "energize": "deenergize", "home": "",
    "homing": "", "calibrate": "",
}  # fmt: skip
# Members of a body that switch something on.
_SWITCHES: Final = re.compile(r"enabled?|armed|active|on|power(?:ed)?|motors?", re.IGNORECASE)
# Names of what a lease is known by, in a response and in a command.
_TOKEN: Final = re.compile(r"token|lease|lock|session|control|(?:^|_)id$|(?:^|_)key$", re.IGNORECASE)
_NO_LEASE: Final = re.compile(r"authorization|idempotency|request.?id|api.?key|if-match", re.IGNORECASE)
_LASTS: Final = re.compile(r"ttl|expires?_?in|timeout|duration|valid_for|lifetime", re.IGNORECASE)
# Words of a refusal that demands another operation first, not another number.
_WANTS: Final = re.compile(
    r"lease|lock|control|session|token|owner|enabl|disabled|arm(?:ed)?\b|motors?\b|power|activ|servo|brake|ready|hom(?:e|ing)",
    re.IGNORECASE,
)
_FORBIDDEN: Final = 403
_LOCKED: Final = frozenset({"423", "428"})
_ASKED_S = 30  # duration of the lease that the suite requests, s
_USUAL_S = 2.0  # interval of its renewals if the device does not say how long it lasts, s
_STRANGER: Final = "roaas"
_MOST_STEPS: Final = 4
_OF_STEP: Final = ("send", "body", "read", "at", "shows")


@dataclass(frozen=True)
class Preparing:
    """What a device wants before it moves.

    Attributes:
        lease: what a client must hold; None if there is none.
        steps: commands in order, each with those that end what it began.
    """

    lease: Lease | None = None
    steps: tuple[tuple[Step, tuple[Step, ...]], ...] = ()

    @property
    def before(self) -> tuple[Step, ...]:
        """What is sent before the device can move, in order."""
        return tuple(step for step, _ in self.steps)

    @property
    def after(self) -> tuple[Step, ...]:
        """What is sent last, in order."""
        return tuple(end for _, ends in reversed(self.steps) for end in ends)

    @property
    def calls(self) -> tuple[str, ...]:
        """The operations."""
        lease = self.lease
        held = (lease.acquire, lease.renew, lease.release) if lease else ()
        found = (*held, *(step.send for step in (*self.before, *self.after)))
        return tuple(filter(None, found))

    def announce(self, *, at_once: bool) -> Iterator[str]:
        """Yield what may be sent before the device moves, or is sent ``at_once``, as lines for the user."""
        first = [*([self.lease.acquire] if self.lease else []), *(step.send for step in self.before)]
        last = [step.send for step in self.after]
        last += [self.lease.release] if self.lease and self.lease.release else []
        if first:
            when = "Before that" if at_once else "If it refuses that, or stays where it is,"
            yield f"{when} the suite first sends {', '.join(first)},"
            yield f"and at the end {', '.join(last) or 'nothing, as no operation is known that ends it'}."

    def lines(self, failed: tuple[str, Any] | None = None) -> Iterator[str]:
        """Yield the lines of a map; ``failed``: where a 2xx says whether it failed, and the value on success."""
        if self.steps or failed:
            yield "[motion]"
            yield from ([f"failed = {inline({'at': failed[0], 'not': failed[1]})}"] if failed else [])
            for name, steps in (("before", self.before), ("after", self.after)):
                given = [
                    {at: said for at in _OF_STEP if (said := getattr(step, at)) not in (None, "")} for step in steps
                ]
                yield from ([f"{name} = {inline(given)}"] if given else [])
            yield ""
        if self.lease:
            yield "[motion.lease]"
            found = msgspec.structs.asdict(self.lease)
            yield from (f"{name} = {inline(value)}" for name, value in found.items() if value not in (None, ""))
            yield ""

    def with_token(self, drive: Operation, content: Any) -> Preparing:
        """Return the same with what the response to the lease's acquisition says: its token, and how long it lasts."""
        if self.lease is None:
            return self
        members = dict(members_of(content))
        token = min(
            (at for at, said in members.items() if _TOKEN.search(at) and not isinstance(said, bool)),
            # A token rather than an id, outside rather than within.
            key=lambda at: ("token" not in at.lower(), at.count("/")),
            default="",
        )
        lasts_s = [
            value / (1000 if re.search(r"_ms$|milli", at, re.IGNORECASE) else 1)
            for at, value in members.items()
            if _LASTS.search(at) and type(value) in {int, float} and value > 0
        ]
        lease = msgspec.structs.replace(
            self.lease,
            token=token,
            header=lease_parameter(drive, "header") if token else "",
            every_s=round(min(lasts_s, default=_USUAL_S), 3),
            # The last part of a path that names a lease is its token.
            release=self.lease.release if token or "{" not in self.lease.release else "",
            renew=self.lease.renew if token or "{" not in self.lease.renew else "",
        )
        return replace(self, lease=lease)


NOTHING: Final = Preparing()


def preparing_of(operations: Sequence[Operation], drive: Operation, rules: CallRules) -> Preparing:
    """Return what a device may need before it moves, by the words of its operations, nearest to the drive first."""
    known = [one for one in operations if not is_excluded(one, rules)]
    near = sorted(
        filter(_may_prepare, known),
        key=lambda one: (-len(posixpath.commonpath([one.template, drive.template])), one.method != "POST"),
    )
    lease = next((_lease_of(one, known) for one in near if _is_lease(one)), None)
    steps = dict[str, tuple[Step, tuple[Step, ...]]]()
    for word in _READY:
        found = ((one, step) for one in near if (step := _ready_step(one, word)) is not None)
        for one, step in itertools.islice(found, 1):
            steps.setdefault(one.label, (step, _ends(one, step, known)))
    return Preparing(lease, tuple(steps.values())[:_MOST_STEPS])


def named_preparing(operations: Sequence[Operation], calls: Iterable[str], rules: CallRules) -> Preparing:
    """Return the operations that a user names with --before: "POST /enable", perhaps with JSON behind the path.

    Raises:
        NotPossibleError: one is no operation of the description, or must never be called.
    """
    known = [one for one in operations if not is_excluded(one, rules)]
    found = Preparing()
    for call in calls:
        label, brace, body = call.strip().partition(" {")
        operation = next((one for one in known if names_operation(label, one.label)), None)
        if operation is None:
            raise NotPossibleError(f"--before {label!r} is no operation of the description that may be called")
        if not brace and found.lease is None and _is_lease(operation):
            found = replace(found, lease=_lease_of(operation, known))
            continue
        try:
            step = Step(label, json.loads(f"{{{body}") if brace else _body(operation, on=True))
        except ValueError as error:
            raise NotPossibleError(f"--before {call!r}: its body is no JSON ({error})") from error
        found = replace(found, steps=(*found.steps, (step, _ends(operation, step, known))))
    return found


def is_excluded(operation: Operation, rules: CallRules) -> bool:
    """Return whether an operation must never be called: the description or the user says so."""
    return operation.never or any(matches(pattern, operation) for pattern in rules.never)


def wants_lease(operation: Operation) -> bool:
    """Return whether a description says that an operation wants a lease: by a status, or a header that carries one."""
    return bool(_LOCKED & operation.responses.keys() or lease_parameter(operation))


def lease_parameter(operation: Operation, *places: str) -> str:
    """Return the name of the header or query parameter in which an operation takes a lease; empty if there is none."""
    found = (one.name for place in places or ("header", "query") for one in operation.parameter(place))
    return next(filter(_carries_lease, found), "")


def lease_place(operation: Operation) -> str:
    """Return the JSON pointer of a text in an operation's body that names a lease; empty if none does."""
    for part in parts_of(body_schema(operation)):
        for name, member in part.get("properties", {}).items():
            if _carries_lease(name) and any(one.get("type") == "string" for one in parts_of(member)):
                return f"/{name}"
    return ""


def wants_more(exchange: Exchange) -> bool:
    """Return whether a device refused a command because another one must come first, by status or text."""
    said = exchange.response.body[:2000].decode("utf-8", "replace")
    return exchange.response.status in WANTS_LEASE | {_FORBIDDEN} or bool(_WANTS.search(said))


def _may_prepare(operation: Operation) -> bool:
    """Return whether an operation may be sent before the device moves."""
    return (
        operation.method in {"POST", "PUT"}
        and not (operation.stop or "{" in operation.template or harmful_words(operation))
        and not commanded_by(operation)
    )


def _words(operation: Operation) -> set[str]:
    """Return the words of the last part of an operation's path, and of its id."""
    # Of an id the first word says what is done: stopArm arms nothing.
    named = "" if operation.id == operation.label else re.split(r"(?<=[a-z])(?=[A-Z])|[_\-. /]", operation.id)[0]
    return words_of(f"{posixpath.basename(operation.template)} {named}")


def _is_lease(operation: Operation) -> bool:
    is_acquired = bool(_words(operation) & _LEASES) and not _words(operation) & (_RELEASES | _KEEPS)
    return is_acquired and not (lease_parameter(operation))


def _lease_of(acquire: Operation, operations: Sequence[Operation]) -> Lease:
    """Return a lease with the operations that acquire, renew and release it."""
    path = acquire.template
    folder = posixpath.dirname(path)
    beside = [one for one in operations if one.template == path or one.template.startswith(f"{path.rstrip('/')}/")]
    beside += [one for one in operations if one not in beside and posixpath.dirname(one.template) == folder]
    renew = next((one for one in beside if _words(one) & _KEEPS and not one.safe), None)
    renew = renew or next((one for one in beside if one.method in {"PUT", "PATCH"} and _names_lease(one, path)), None)
    release = next((one for one in beside if one.method == "DELETE" and _names_lease(one, path)), None)
    release = release or next((one for one in beside if _words(one) & _RELEASES and not one.safe), None)
    return Lease(
        acquire.label,
        _body(acquire),
        renew=_with_token(renew) if renew else "",
        renew_body=_body(renew) if renew else None,
        release=_with_token(release) if release else "",
        release_body=_body(release) if release else None,
    )


def _names_lease(operation: Operation, path: str) -> bool:
    """Return whether a path is that of a lease, or that with the lease's id."""
    return operation.template == path or bool(re.fullmatch(rf"{re.escape(path)}/\{{[^{{}}]*\}}", operation.template))


def _with_token(operation: Operation) -> str:
    named = with_query(operation, lease_parameter(operation, "query")).template
    return f"{operation.method} {NAME.sub('{lease}', named)}"


def _body(operation: Operation, *, on: bool | None = None) -> Any:
    """Return a usual body of an operation; ``on``: value for a member that switches something, or None."""
    schema = body_schema(operation)
    if schema is None:
        return None
    at = lease_place(operation) if on is None and not _is_lease(operation) else ""
    made = fill(template_of(schema, {at: "{lease}"} if at else {}), {"seconds": _ASKED_S, "lease": "{lease}"})
    for part in parts_of(schema) if isinstance(made, dict) else ():
        for name, member in part.get("properties", {}).items():
            if on is not None and _SWITCHES.fullmatch(name) and (said := _switch_value(member, on=on)) is not None:
                made[name] = said
            elif made.get(name) == "":
                made[name] = _STRANGER
    return made


def _switch_value(member: Any, *, on: bool) -> Any:
    """Return the value of a member that switches something on or off; None if it has none."""
    for part in parts_of(member):
        if part.get("type") == "boolean":
            return on
        words = {str(item).lower(): item for item in part.get("enum", ())}
        for pair in _READY.items():
            if set(pair) <= words.keys():
                return words[pair[0] if on else pair[1]]
    return None


def _ready_step(operation: Operation, word: str) -> Step | None:
    """Return the step by which an operation makes a device ready; None if it does not, by this word."""
    words = _words(operation)
    body = _body(operation, on=True)
    # PUT /motors {"enabled": true}
    is_switch = word == "enable" and body != _body(operation, on=False)
    if (word in words and not words & set(_READY.values())) or is_switch:
        return Step(operation.label, body)
    return None


def _ends(operation: Operation, step: Step, operations: Sequence[Operation]) -> tuple[Step, ...]:
    """Return the step that ends what another one began; empty if there is none."""
    off = _body(operation, on=False)
    if step.body is not None and step.body == _body(operation, on=True) != off:
        return (Step(operation.label, off),)
    folder, last = posixpath.split(operation.template.lower())
    opposites = {
        posixpath.join(folder, re.sub(rf"\b{word}(?=\b|_)|(?<=_){word}\b", opposite, last))
        for word, opposite in _READY.items()
        if opposite
    } - {operation.template.lower()}
    found = (one for one in operations if one.method == operation.method and one.template.lower() in opposites)
    return tuple(Step(one.label, _body(one)) for one in itertools.islice(found, 1))


def members_of(value: Any, at: str = "", depth: int = 2) -> Iterator[tuple[str, Any]]:
    """Yield the texts, numbers and truth values of a response by JSON pointer."""
    for name, item in value.items() if isinstance(value, Mapping) else ():
        if isinstance(item, Mapping) and depth:
            yield from members_of(item, f"{at}/{name}", depth - 1)
        elif isinstance(item, str | int | float):
            yield f"{at}/{name}", item


def _carries_lease(name: str) -> bool:
    """Return whether a header or member of this name carries a lease."""
    return bool(_TOKEN.search(name.replace("-", "_"))) and not _NO_LEASE.search(name)

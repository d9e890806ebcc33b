"""Send requests with an Idempotency-Key once more: with the same body, with another one, later, and by a new key.

The draft draft-ietf-httpapi-idempotency-key-header, 2.6, says what a device does.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from http import HTTPStatus
from typing import Any, Final

from conformance.api.rest.applicable import callable_operations
from conformance.api.rest.inputs import Inputs, request_of, usual_inputs, with_new_values
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.patches import same
from conformance.api.rest.things import collection_of, id_member
from conformance.api.rest.values import Values
from conformance.documents.json_text import clip, read_json
from conformance.documents.openapi import Operation
from conformance.documents.parameters import Parameter, plain_name
from conformance.scenarios.creating import location_of
from conformance.scenarios.reaching import key_of, new_key
from conformance.scenarios.refusing import is_ours, is_refused
from conformance.scenarios.scenario import NoOccasionError, scenario
from conformance.scenarios.special_bodies import half_valid
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.scenarios.whole_list import read_whole
from conformance.scenarios.writing import Writer, members
from conformance.transport.exchange import Exchange, NoAnswerError, Outgoing

_OPERATIONS = 6  # operations that are tried
_TURN = 7100  # number from which bodies are made that no other check sends
# Keys of a round: the first one, and a new one.
_KEYS: Final = 2
# Members by which a response identifies the created thing.
_IDS: Final = ("id", "uuid", "guid")
# Statuses by which an operation may refuse a key that came with another body.
_REFUSALS: Final = frozenset({"409", "422"})
# Statuses of a creation, and of an activity that begins.
_MADE: Final = frozenset({HTTPStatus.CREATED, HTTPStatus.ACCEPTED})
# Phrases in a description: a retry gets the first result; another body with the same key is refused.
_FIRST: Final = re.compile(
    r"\b(?:first|original|same|earlier|previous|stored) (?:answer|response|result|reply)\b", re.IGNORECASE
)
_OTHER_BODY: Final = re.compile(
    r"\bkey\b[^.]*\b(?:other|another|different)\b[^.]*\b(?:refuse[sd]?|reject(?:ed|s)?|409|422)\b", re.IGNORECASE
)
#: Name of the case in which a key is sent with another body, which the description says is refused.
REFUSED_BODY: Final = "other body, refused by the description"
_KEY: Final = re.compile(r"idempoten", re.IGNORECASE)
UNSPENT: Final = re.compile(
    r"\b(?:refus|reject|fail)\w*\b[^.]*\b(?:not|never)\b[^.]*\b(?:us|consum|spen|keep|kept|stor|remember|burn)\w*",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Keyed:
    """One request with a key that was sent before, or concurrently.

    Attributes:
        operation: its label.
        way: what is special about it: the same request, another body, or a new key.
        shown: the response that decides.
        expected: what should have come of it, as a noun phrase.
        fault: what came of it instead; empty means that.
    """

    operation: str
    way: str
    shown: Exchange
    expected: str
    fault: str = ""


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.EFFECT)
def repeated_keys(api: RestInterface, values: Values) -> tuple[Keyed, ...]:
    """Repeat requests with the key of an earlier one; a fault counts if a second round shows it too."""
    by_key = callable_operations(api)
    found, tried = list[Keyed](), 0
    for operation in by_key.values():
        key = key_of(operation)
        if key is None or operation.method != "POST" or operation.motion or tried >= _OPERATIONS:
            continue
        tried += 1
        api.run.limit.check()
        with api.run.limit.lift(), suppress(NoAnswerError):  # the survey reports a broken connection
            rounds = _Rounds(Writer(api, values), operation, key, by_key)
            first = list(rounds.play(0))
            wrong = [creation for creation in first if creation.fault]
            again = {creation.way for creation in rounds.play(1) if creation.fault} if wrong else set[str]()
            found += [creation for creation in first if not creation.fault or creation.way in again]
    if not found:
        raise NoOccasionError("no operation with a parameter Idempotency-Key answered with what it has made")
    return tuple(found)


@dataclass
class _Rounds:
    """The requests to one operation."""

    writer: Writer
    operation: Operation
    key: Parameter
    operations: dict[tuple[str, str], Operation]

    def __post_init__(self) -> None:
        collection = self.operation.template.rstrip("/")
        reads = [one for (method, path), one in self.operations.items() if method == "GET"]
        self._item = next((operation for operation in reads if collection_of(operation.template) == collection), None)
        self._lister = self.operations.get(("GET", collection))
        self._delete = (
            self.operations.get(("DELETE", self._item.template.rstrip("/"))) if self._item is not None else None
        )

    def play(self, number: int) -> Iterator[Keyed]:
        """Send a request twice, its key with another body, a new key with a third one, and the first request again."""
        bodies, keys = self._bodies(_TURN + 10 * number), self._keys()
        if len(keys) < _KEYS or not bodies:
            return
        before = self._list_paths()
        # A device may refuse a body by a rule that no schema says.
        for inputs in (self._rich(bodies[0]), *bodies):
            keys[0] = self._keys()[0]
            first = self._send(request := self._request(keys[0], inputs))
            if not is_refused(first):
                break
        made, others = [first], [one for one in bodies[1:] if one is not inputs]
        if not first.response.ok or not (name := self._name(first)):
            return
        try:
            again = self._send(request)
            made.append(again)
            yield self._judge_repeat(first, again, name, before)
            if others and self.operation.responses.keys() & _REFUSALS:
                other = self._send(self._request(keys[0], others[0]))
                made.append(other)
                expected = "a refusal with 422 of a key that came before with another body"
                fault = other.came if other.response.ok else ""
                said = f"{self.operation.text} {self.key.says} {self._promise()}"
                way = REFUSED_BODY if _OTHER_BODY.search(said) else "other body"
                yield Keyed(self.operation.label, way, other, expected, fault)
            if others and self._item is not None and first.response.status in _MADE:
                new = self._send(self._request(keys[1], others[-1]))
                made.append(new)
                is_old = new.response.status in _MADE and self._name(new) == name
                expected = f"something else than {name}, which was made for another key and another body"
                yield Keyed(self.operation.label, "new key", new, expected, name if is_old else "")
                # A retry may come after other keys; without a promise, a device may remember few keys.
                more = keys[_KEYS : _KEYS + 1] if _FIRST.search(self._promise()) else []
                made += [self._send(self._request(text, others[-1])) for text in more]
                again = self._send(request)
                made.append(again)
                yield self._judge_repeat(first, again, name, before)
            said = f"{self.operation.text} {self.key.says}"
            if len(keys) > _KEYS + 1 and UNSPENT.search(said):
                yield from self._unspent(keys[_KEYS + 1 :], inputs, made)
            if _FIRST.search(said) and self._item is not None and name.startswith("/"):
                yield from self._later(request, first, self._item, name)
        finally:
            self._tidy_up(made)

    def _promise(self) -> str:
        """Return the description's text on idempotency keys: of the operation, the parameter, or the head."""
        head = str(self.writer.api.run.contract.openapi.get("info", {}).get("description", ""))
        own = [part for part in re.split(r"\n\s*\n", head) if _KEY.search(part)]
        return " ".join((self.operation.text, self.key.says, *own))

    def _judge_repeat(self, first: Exchange, again: Exchange, name: str, before: set[str] | None) -> Keyed:
        """Judge a repeated request: performed twice, it has made two things."""
        expected, shown, fault = f"the response with {name}, or a refusal", again, ""
        second = self._name(again) if again.response.ok else ""
        if second and second != name:
            fault = f"{second}, a second one"
        elif second and (other := self._otherwise(first, again, name)):
            expected, fault = "the members as in the first response and in the thing itself", other
        elif (before is not None) and self._lister is not None and self._item is not None:
            sent = read_json(first.request.body).value
            listing = read_whole(self.writer, self._lister, self._item, self._lister.template)
            new = [
                id_
                for one, id_ in zip(listing.items, listing.ids, strict=True)
                if id_ and id_ not in before and _is_like(one, sent)
            ]
            if len(set(new)) > 1:
                expected, shown, fault = f"a list with {name} alone of what was sent", listing.exchange, ", ".join(new)
        return Keyed(self.operation.label, "same request", shown, expected, fault)

    def _otherwise(self, first: Exchange, again: Exchange, name: str) -> str:
        """Return a member that differs only in the repeated response; the thing itself may have changed."""
        was, now = members(first, ()), members(again, ())
        other = [one for one in was.keys() & now.keys() if not same(was[one], now[one])]
        if not other or self._item is None or not name.startswith("/"):
            return ""
        there = members(self.writer.send(self._item, name), was)
        return ", ".join(f"{clip(now[one])} as {one}" for one in sorted(other) if same(there.get(one), was[one]))

    def _rich(self, inputs: Inputs) -> Inputs:
        """Return inputs with several items in each list of objects, or the same inputs."""
        bodies = [inputs.body] if isinstance(inputs.body, dict) else []
        body = next(iter(self.writer.with_items(self.operation, bodies, _TURN)), inputs.body)
        return inputs if body is inputs.body else replace(inputs, body=body)

    def _unspent(self, keys: list[str], inputs: Inputs, made: list[Exchange]) -> Iterator[Keyed]:
        """Judge a key whose request was refused; a new key shows that the correct request can be accepted."""
        wrong = next(half_valid(self.operation, inputs, inputs.body), None) if isinstance(inputs.body, dict) else None
        if wrong is None or not is_refused(self._send(self._request(keys[0], replace(inputs, body=wrong)))):
            return
        taken = self._send(self._request(keys[0], inputs))
        other = self._send(self._request(keys[1], inputs)) if is_refused(taken) else taken
        made += [taken, other]
        expected = "a creation, because the description says that a refused request does not use up its key"
        fault = taken.came if other.response.ok and is_refused(taken) else ""
        yield Keyed(self.operation.label, "refused before", taken, expected, fault)

    def _later(self, request: Outgoing, first: Exchange, item: Operation, path: str) -> Iterator[Keyed]:
        """Judge a retry after its thing has changed: by the description it gets the first response."""
        changes = (self.operations.get((method, item.template.rstrip("/"))) for method in ("PUT", "PATCH"))
        written = (self.writer.change(operation, item, path, _TURN) for operation in changes if operation is not None)
        write = next((one for one in written if one is not None), None)
        again = self._send(request) if write is not None else first
        was, now = members(first, ()), members(again, ())
        new = members(write.found, ()) if write is not None and again.response.ok else {}
        other = [name for name in new if name in was and name in now and was[name] != new[name]]
        if other:
            fault = ", ".join(f"{clip(now[name])} as {name}" for name in other if now[name] == new[name])
            yield Keyed(self.operation.label, "later", again, "the members as in the first response", fault)

    def _send(self, request: Outgoing) -> Exchange:
        return self.writer.api.send(request)

    def _request(self, key: str, inputs: Inputs) -> Outgoing:
        return request_of(self.operation, inputs.having("header", self.key.name, key))

    def _keys(self) -> list[str]:
        """Return keys that the device does not know, as far as the schema allows them."""
        return [text for _ in range(2 * _KEYS + 1) if (text := new_key(self.key))]

    def _bodies(self, turn: int) -> list[Inputs]:
        """Return inputs with three different bodies, or one if the body cannot vary."""
        usual, values = usual_inputs(self.operation, self.writer.values)[0], self.writer.values
        first, found = with_new_values(self.operation, usual, values), list[Inputs]()
        for number in range(3):
            body = next(iter(self.writer.bodies(self.operation, turn + number)), None)
            inputs = first if body is None else with_new_values(self.operation, replace(usual, body=body), values)
            if all(not same(inputs.body, one.body) for one in found) or not found:
                found.append(inputs)
        return found if len(found) == 3 else found[:1]  # noqa: PLR2004 - see above

    def _name(self, exchange: Exchange) -> str:
        """Return the identifier or location of the thing that a response created; empty if it has neither."""
        if self._item is not None:
            if path := location_of(self.writer.api, self._item, exchange):
                return path
            if (id_ := id_member(read_json(exchange.response.body).value, self._item)[1]) is not None:
                return str(id_)
        told = members(exchange, _IDS)
        id_ = next((one for name, one in told.items() if plain_name(name) in _IDS), None)
        return str(id_) if isinstance(id_, str | int) else exchange.response.header("location") or ""

    def _list_paths(self) -> set[str] | None:
        if self._lister is None or self._item is None or self._lister.parameter("path"):
            return None
        return set(read_whole(self.writer, self._lister, self._item, self._lister.template).ids)

    def _tidy_up(self, made: list[Exchange]) -> None:
        """Delete the things that these exchanges created."""
        names = {self._name(exchange): None for exchange in made if exchange.response.ok}
        for path in names:
            if self._delete is not None and self._item is not None and path.startswith("/"):
                self.writer.conditional(self._delete, self._item, path)


def _is_like(item: dict[str, Any], sent: Any) -> bool:
    """Return whether an item of a list has the texts that this run alone has sent."""
    own = {name: one for name, one in sent.items() if is_ours(one)} if isinstance(sent, dict) else {}
    return bool(own) and all(item.get(name) == one for name, one in own.items())

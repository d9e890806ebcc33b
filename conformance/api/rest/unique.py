"""Members whose value differs for each thing of a collection, such as a name or a barcode.

A description has no word for them. So they are found by trying: a creation that is refused may be accepted with other
texts and numbers. Without these, a device refuses nearly all that is created, and little of it is seen.
"""

from __future__ import annotations

import string
from collections import Counter
from collections.abc import Iterator
from typing import Any, Final

from conformance.api.rest.references import refers
from conformance.api.rest.samples import fits
from conformance.documents.json_schema import Schema, is_number, kinds_of
from conformance.documents.openapi import Operation
from conformance.documents.representation import flat

_TRIED: Final = 6  # most members of a body that get unique values
_COUNTED: Final = 8  # characters of a text that are changed to make it unique
# Distance between two unique values: other code, which counts up by one, does not reach the next of ours.
_STEP: Final = 7919
# Values that are tried until one is found that was not sent before.
_STEPS: Final = 40
# Greatest integer to send where no bound is declared: every language can hold it.
_GREATEST: Final = 2**31 - 1
_TIMES: Final = frozenset({"date", "date-time", "time", "duration"})
_ALPHABETS: Final = (string.digits, string.ascii_lowercase, string.ascii_uppercase)


class Unique:
    """Members whose values must be unique, as far as the run has learned them.

    Args:
        collections: names of the collections that the API has, in the singular.
    """

    def __init__(self, collections: frozenset[str]) -> None:
        self._collections = collections
        self._names: dict[str, tuple[str, ...]] = {}
        self._taken: set[tuple[str, str, Any]] = set()
        self._turns: Counter[str] = Counter()
        self._own: dict[str, dict[str, Any]] = {}

    def knows(self, operation: Operation) -> bool:
        """Return whether members of an operation's body are known that must be new."""
        return bool(self._names.get(_collection(operation)))

    def names(self, operation: Operation) -> tuple[str, ...]:
        """Return the members of an operation's body that must be new."""
        return self._names.get(_collection(operation), ())

    def trials(self, operation: Operation, body: Any, schema: Schema) -> Iterator[tuple[tuple[str, ...], Any]]:
        """Yield members that may have to be unique, and the body with new values of them: all, then each alone."""
        parts = flat(schema).get("properties", {})
        names = [name for name in body if self._may_be(name, parts.get(name, {}))] if isinstance(body, dict) else []
        for chosen in [names[:_TRIED], *([name] for name in names[:_TRIED] if len(names) > 1)] if names else ():
            yield tuple(chosen), self._with_new(operation, body, schema, tuple(chosen))

    def _may_be(self, name: str, schema: Schema) -> bool:
        given = flat(schema)
        plain = not given.keys() & {"enum", "const"} and bool(kinds_of(given) & {"string", "integer"})
        # Another digit makes no date of a date.
        return (
            plain
            and given.get("format") not in _TIMES
            and not given.get("readOnly")
            and not refers(name, schema, self._collections)
        )

    def remember(self, operation: Operation, names: tuple[str, ...]) -> None:
        """Remember that these members must be new."""
        self._names[_collection(operation)] = names

    def with_new_values(self, operation: Operation, body: Any, schema: Schema, *, keep: str = "") -> Any:
        """Return a body with new values in place of those that were sent before; a change has always the same new ones.

        Args:
            operation: the operation that needs it.
            body: as JSON.
            schema: the schema of the member.
            keep: a member whose value has to stay.
        """
        collection = _collection(operation)
        if not isinstance(body, dict) or collection not in self._names:
            return body
        names = [name for name in self._names[collection] if name in body and name != keep]
        if operation.method != "POST":
            if names and operation.label not in self._own:
                new = self._with_new(operation, body, schema, tuple(names))
                self._own[operation.label] = {name: new[name] for name in names}
            own = self._own.get(operation.label, {})
            return {**body, **{name: own[name] for name in names if name in own}}
        if any((collection, name, str(body[name])) in self._taken for name in names):
            body = self._with_new(operation, body, schema, tuple(names))
        self._taken |= {(collection, name, str(body[name])) for name in names}
        return body

    def _with_new(self, operation: Operation, body: dict[str, Any], schema: Schema, names: tuple[str, ...]) -> Any:
        collection, parts = _collection(operation), flat(schema).get("properties", {})
        changed = dict(body)
        self._taken |= {(collection, name, str(body[name])) for name in names}
        for name in names:
            for _ in range(_STEPS):
                self._turns[collection] += 1
                changed[name] = with_number(parts.get(name, {}), body[name], self._turns[collection] * _STEP)
                if (collection, name, str(changed[name])) not in self._taken:
                    break
        self._taken |= {(collection, name, str(changed[name])) for name in names}
        return changed


def with_number(schema: Schema, value: Any, number: int) -> Any:
    """Return a text or integer that the schema allows and that contains a number; the same one if none is allowed."""
    if is_number(value):
        given = flat(schema)
        least, most = given.get("minimum", value), given.get("maximum", _GREATEST)
        made = least + (value - least + number) % (most - least + 1)
        return made if fits(schema, made) else value
    if not isinstance(value, str):
        return value
    places = list[tuple[int, str]]()
    for place in range(len(value) - 1, -1, -1):
        alphabet = next((one for one in _ALPHABETS if value[place] in one), "")
        other = alphabet[(alphabet.find(value[place]) + 1) % len(alphabet)] if alphabet else ""
        if other and fits(schema, value[:place] + other + value[place + 1 :]):
            places.append((place, alphabet))
    made = list(value)
    for place, alphabet in places[:_COUNTED]:
        number, index = divmod(number + alphabet.find(made[place]), len(alphabet))
        made[place] = alphabet[index]
    text = "".join(made)
    return text if fits(schema, text) else value


def _collection(operation: Operation) -> str:
    """Return the path of the collection in which an operation creates or changes a thing."""
    template = operation.template.rstrip("/")
    return template if operation.method == "POST" else template.rpartition("/")[0]

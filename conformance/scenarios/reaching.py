"""Make requests succeed: with new values for unique members and keys, known things, and the current entity tag."""

from __future__ import annotations

import uuid
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Final
from urllib.parse import unquote

from conformance.api.rest.applicable import callable_operations
from conformance.api.rest.inputs import Inputs, parameter_verdict, request_of, with_new_values
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.samples import fits
from conformance.api.rest.validity import VALID
from conformance.api.rest.values import Values
from conformance.api.rest.variations import Variation
from conformance.checkers.untouched import ALONE, OFTEN, keeps_all
from conformance.documents.openapi import Operation, is_json
from conformance.documents.parameters import Parameter, plain_name
from conformance.documents.representation import flat
from conformance.documents.writing import json_text, path_text
from conformance.scenarios.scenario import NotPossibleError
from conformance.transport.exchange import NoAnswerError, Outgoing
from conformance.verdict.time_limit import TimeIsOverError

#: The thing exists already, or its state forbids the request.
CONFLICT: Final = 409
#: The device demands a condition, or the condition in the request does not hold.
WANTS_CONDITION: Final = frozenset({412, 428})
_IF_MATCH: Final = "if-match"
_AROUND: Final = 4  # refused operations that are tried again
_QUIET: Final = (NotPossibleError, TimeIsOverError, NoAnswerError)  # exceptions that are ignored


@dataclass
class Reaching:
    """Writes such requests.

    Attributes:
        api: the device.
        values: values that the run knows.
        wants_tag: operations for which the device asked for a condition.
    """

    api: RestInterface
    values: Values
    wants_tag: set[str] = field(default_factory=set)
    _asked: set[str] = field(default_factory=set)
    _tags: dict[str, str] = field(default_factory=dict)

    def request(self, operation: Operation, variation: Variation) -> Outgoing:
        """Return the request of a variation, with the entity tag of its resource if it has or needs If-Match."""
        request = request_of(operation, with_new_values(operation, variation.inputs, self.values, variation.place))
        return request if variation.place.lower() == f"header {_IF_MATCH}" else self._current(operation, request)

    def complete(self, operation: Operation, request: Outgoing) -> Outgoing:
        """Return a generated request with what only the device or the run knows: its thing, a new key, the tag.

        Otherwise 404, 412 or the refusal of a repeated key would hide what the request is about. DELETE keeps its path:
        the things that are there are still needed.
        """
        has_more = operation.bodies or len(operation.parameter("path")) < len(operation.parameters)
        if has_more and operation.method != "DELETE":
            path, mark, query = request.target.partition("?")
            parts, steps = path.split("/"), operation.template.split("/")
            known = [self._known_part(operation, step, part) for step, part in zip(steps, parts, strict=False)]
            request = replace(request, target="/".join(known + parts[len(known) :]) + mark + query)
        key = key_of(operation)
        given, others = _without(request, key.name) if key is not None else ([], ())
        if key is not None and any(fits(key.schema, text) for text in given):
            new = new_key(key)
            request = replace(request, headers=(*others, (key.name, new)) if new else others)
        return self._current(operation, request)

    def _known_part(self, operation: Operation, step: str, part: str) -> str:
        """Return a part of a path, with the known thing in place of a valid text that names none."""
        parameter = next((one for one in operation.parameter("path") if step == f"{{{one.name}}}"), None)
        if parameter is None or parameter_verdict(operation, parameter, unquote(part)) != VALID:
            return part
        known, ids = self.values.of(operation, parameter), self.values.known_ids(operation, parameter)
        found = [value for value in known if value in ids] or known
        # A value of an enumeration names something, and so does one that is known.
        if "enum" in flat(parameter.schema) or unquote(part) in map(str, found):
            return part
        texts = map(json_text, found) if is_json(parameter.media_type) else found
        return next((path_text(text, parameter.style) for text in texts), part)

    def _current(self, operation: Operation, request: Outgoing) -> Outgoing:
        """Return a request with the entity tag of its resource if it has or needs If-Match.

        With any other tag in If-Match, the device would refuse it (RFC 9110 13.1.1).
        """
        given, others = _without(request, _IF_MATCH)
        if operation.safe or not (given or operation.label in self.wants_tag):
            return request
        path = request.target.partition("?")[0]
        if path not in self._tags:
            with suppress(*_QUIET):
                self._tags[path] = self.api.send(Outgoing("GET", path)).response.header("etag") or ""
        tag = self._tags.get(path, "")
        return replace(request, headers=(*others, ("If-Match", tag))) if tag else request

    def forget_tags(self) -> None:
        """Forget the entity tags: something may have changed."""
        self._tags.clear()

    def finds_new(self, operation: Operation, inputs: Inputs) -> bool:
        """Find out which members must be new in each creation; return whether new ones are accepted."""
        label, unique, found = operation.label, self.values.unique, False
        if label in self._asked or not is_json(inputs.media_type) or operation.safe:
            return False
        self._asked.add(label)
        with suppress(*_QUIET):
            trials = unique.trials(operation, inputs.body, operation.bodies[inputs.media_type].schema)
            for number, (names, body) in enumerate(trials):
                exchange = self.api.send(request_of(operation, replace(inputs, body=body)))
                if exchange.response.ok:
                    self.values.learn(operation, exchange)
                    unique.remember(operation, names)
                    found = True
                    # The first trial changes all members, of which one may be what has to be new.
                    if number:
                        break
        self.api.single[label] = self.api.single.get(label, False) and not found
        return found

    def keep_refused(self, status: int, operation: Operation, request: Outgoing) -> None:
        """Keep a refused request; send the first ones refused by a state again, if the description says what remains.

        Before and after each, all that can be read without input is read, which a checker judges.
        """
        is_new = (status, operation.label) not in self.api.refused
        self.api.refused.setdefault((status, operation.label), request)
        held = [label for number, label in self.api.refused if number == CONFLICT]
        if not (is_new and status == CONFLICT and len(held) <= _AROUND and keeps_all(self.api.run.contract)):
            return
        own = [one for (method, _), one in callable_operations(self.api).items() if method == "GET"]
        targets, steps = list[str](), request.target.partition("?")[0].split("/")
        for read in own:
            needs_path = all(given.where == "path" for given in read.parameters if given.required)
            # The list of all things, and the thing that the request is about.
            if needs_path and ("{" not in read.template or f"{operation.template}/".startswith(f"{read.template}/")):
                known = steps if "{" in read.template else read.template.split("/")
                targets.append("/".join(known[: read.template.count("/") + 1]))
        with suppress(NoAnswerError):
            # The last read shows what changes by itself.
            for turn in range(-ALONE if len(held) == 1 else 0, OFTEN + 2):
                if 0 < turn <= OFTEN:
                    self.api.send(request)
                for target in targets:
                    self.api.send(Outgoing("GET", target))


def _without(request: Outgoing, name: str) -> tuple[list[str], tuple[tuple[str, str], ...]]:
    """Return the values of a header of a request, and the other headers."""
    others = tuple(pair for pair in request.headers if pair[0].lower() != name.lower())
    return [pair[1] for pair in request.headers if pair not in others], others


def key_of(operation: Operation) -> Parameter | None:
    """Return the header parameter of an operation that is its idempotency key, or None."""
    named = (
        parameter
        for parameter in operation.parameter("header")
        if plain_name(parameter.name).endswith("idempotencykey")
    )
    return next(named, None)


def new_key(key: Parameter) -> str:
    """Return an idempotency key that the device does not know; empty if the schema allows none that is made here."""
    text = str(uuid.uuid4())
    candidates = (text, f'"{text}"', text.replace("-", ""), text[:8])
    return next((candidate for candidate in candidates if fits(key.schema, candidate)), "")

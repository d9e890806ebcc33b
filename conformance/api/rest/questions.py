"""Requests whose responses can be told apart, to notice a response that went to the wrong client."""

import itertools
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from http import HTTPStatus
from typing import Final
from urllib.parse import quote

from conformance.api.rest.applicable import allows, working_reads
from conformance.api.rest.calls import JSON, Call, example_call
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.statuses import CRASHES
from conformance.documents.json_schema import Schema, is_numeric
from conformance.documents.json_shape import shape_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import is_json, operations_of
from conformance.documents.parameters import plain_name
from conformance.documents.patterns import PatternError
from conformance.documents.representation import UnreadableError, read
from conformance.transport.exchange import BUSY, Outgoing, Response
from conformance.transport.parallel import Addressed

_MARK: Final = "roaas-client-"  # start of values that only one client sends
_UNKNOWN: Final = 4  # requests for unknown paths
# Fields by which a client recognizes its response, and how many values of one are sent.
_ECHOED: Final = frozenset({"xrequestid", "requestid", "xcorrelationid", "correlationid", "xtraceid"})
_ECHOES: Final = 8
# Characters of a mismatch that a message shows.
_SHOWN: Final = 400


@dataclass(frozen=True)
class Question:
    """A request that changes nothing, and a test whether a response belongs to it.

    Attributes:
        path: target below the base URL.
        accept: media type.
        mismatch: returns why a response cannot be the one to this request; empty where it can.
        comes_and_goes: whether the resource may cease to be there, as a goal that ends.
        headers: further header fields.
    """

    path: str
    accept: str
    mismatch: Callable[[Response], str]
    comes_and_goes: bool = False
    headers: tuple[tuple[str, str], ...] = ()

    @property
    def fields(self) -> tuple[tuple[str, str], ...]:
        """The header fields of its request."""
        return ("Accept", self.accept), *self.headers

    def outgoing(self, api: RestInterface) -> Addressed:
        """Return the request of one of several concurrent clients."""
        return api.client, Outgoing("GET", self.path, self.fields)


def questions(api: RestInterface, more: Iterable[Question] = ()) -> list[Question]:
    """Send each question alone; return those with a matching response. Other requirements judge the others.

    One that is answered by a crash or a 429 now and then has no usual response.

    Args:
        api: the robot's REST interface.
        more: further questions, of the contract pack.
    """
    others = [*_refused_reads(api), *_unknown(), *_echoes(api), *more]
    alone = _reads(api)
    alone += [(item, api.client.send("GET", item.path, headers=item.fields).response) for item in others]
    usual = [(item, answer.status) for item, answer in alone if not item.mismatch(answer)]
    return [_of_status(item, status) for item, status in usual if status not in CRASHES | BUSY]


def mismatch_of(api: RestInterface, question: Question, answer: Response) -> str:
    """Return why a response cannot belong to this request; empty if it can.

    The question is sent alone once more: the robot's state may have changed meanwhile, as when a goal ends. A crash
    is nobody's response; robustness/no-server-error judges it. Neither is that of an overloaded device.
    """
    mismatch = question.mismatch(answer)
    if not mismatch or answer.status in CRASHES | BUSY:
        return ""
    alone = api.client.send("GET", question.path, headers=question.fields).response
    return "" if question.mismatch(alone) and alone.status == answer.status else mismatch


def rounds(asked: Sequence[Question], clients: int, count: int) -> list[list[Question]]:
    """Return rounds in which all clients send different questions, and each client every question over time."""
    step = max(1, len(asked) // clients)
    return [[asked[(turn + client * step) % len(asked)] for client in range(clients)] for turn in range(count)]


def _of_status(question: Question, status: int) -> Question:
    """Return the same question, whose response must have this status as well."""
    usual = {status, HTTPStatus.NOT_FOUND} if question.comes_and_goes else {status}

    def mismatch(answer: Response) -> str:
        return question.mismatch(answer) or (
            "" if answer.status in usual else f"status {answer.status} instead of {status}"
        )

    return replace(question, mismatch=mismatch, comes_and_goes=False)


def _reads(api: RestInterface) -> list[tuple[Question, Response]]:
    """Return a question for each resource in each format, and the response to it alone."""
    found: list[tuple[Question, Response]] = []
    for call in working_reads(api):
        for media_type in call.operation.formats:
            answer = call.send(api, ("Accept", media_type)).response
            alike = api.device.answers_alike(call.operation.template) and not call.operation.motion
            mismatch = _shape_of(call, media_type, answer, entries=alike)
            comes_and_goes = call.operation.schemas_for(HTTPStatus.NOT_FOUND) is not None
            found.append((Question(call.path, media_type, mismatch, comes_and_goes), answer))
    return found


def _shape_of(call: Call, media_type: str, alone: Response, *, entries: bool) -> Callable[[Response], str]:
    """Return a test whether a response has the shape of a single client's response and, on request, its entries."""
    schema, names = call.operation.shape or {}, _names_in(alone)
    listed = _entries(media_type, alone, schema) if entries else None

    def mismatch(answer: Response) -> str:
        if not answer.ok:
            return ""
        if answer.media_type != media_type:
            return f"{answer.media_type or 'no media type'} instead of {media_type}"
        try:
            problem = shape_of(schema).problem(read(media_type, answer.body, schema))
        except PatternError:
            problem = ""  # another requirement says that the schema cannot be used
        except UnreadableError as error:
            return str(error)
        if problem:
            return f"a body in which {problem}"
        found = _names_in(answer)
        # Fewer than half of the members: the response belongs to another schema. Single optional members may be
        # missing.
        if found and 2 * len(names & found) < len(names):
            return f"an object without {min(names - found)}"
        other = _entries(media_type, answer, schema) if listed is not None else None
        return "" if other == listed else f"{other} in place of {listed}"[:_SHOWN]

    return mismatch


def _entries(media_type: str, answer: Response, schema: Schema) -> list[str] | None:
    """Return the entries of a list, sorted; None where the response is no list."""
    try:
        value = read(media_type, answer.body, schema) if answer.ok else None
    except UnreadableError:
        return None
    return sorted(json.dumps(entry, sort_keys=True) for entry in value) if isinstance(value, list) else None


def _names_in(answer: Response) -> frozenset[str]:
    """Return the names in a JSON object or in a list's first item: one open schema may fit two different lists."""
    value = read_json(answer.body).value if is_json(answer.media_type) else None
    first = value[0] if isinstance(value, list) and value else value
    return frozenset(first) if isinstance(first, dict) else frozenset()


def _mark_test(number: int) -> Callable[[Response], str]:
    """Return a test whether a response names another client's question."""
    own = f"{_MARK}{number}-".encode()

    def mismatch(answer: Response) -> str:
        there = answer.body.find(_MARK.encode())
        while there >= 0:
            if not answer.body.startswith(own, there):
                return f"a response with {answer.body[there : there + len(own) + 2]!r} to the request with {own!r}"
            there = answer.body.find(_MARK.encode(), there + 1)
        return f"status {answer.status}" if answer.status < HTTPStatus.MULTIPLE_CHOICES else ""

    return mismatch


def _refused_reads(api: RestInterface) -> list[Question]:
    """Return reads with a text of their own in place of a number, which a refusal may name."""
    numbers = itertools.count(_UNKNOWN)
    found = []
    for operation in operations_of(api.run.contract):
        named = [item.name for item in operation.parameter("query") if is_numeric(item.schema)]
        if operation.method != "GET" or not allows(api, operation) or not named:
            continue
        call = example_call(api, operation)
        for name in named[:2]:
            number = next(numbers)
            path = call.having(name, f"{_MARK}{number}-").path
            found.append(Question(path, JSON, _mark_test(number)))
    return found


def _echoes(api: RestInterface) -> Iterator[Question]:
    """Yield reads with different request ids, where a request and its response have such a field by the description."""
    for call in working_reads(api):
        shown = call.operation.headers.get("200", {})
        names = [one.name for one in call.operation.parameter("header") if plain_name(one.name) in _ECHOED]
        for name in [name for name in names if name.lower() in shown][:1]:
            for text in [f"{_MARK}{number}" for number in range(_ECHOES)]:
                yield Question(call.path, JSON, partial(_other_echo, name, text), headers=((name, text),))
            return


def _other_echo(name: str, text: str, answer: Response) -> str:
    """Return which value of a request's field a response has in place of its own; empty if it has its own."""
    came = answer.header(name)
    return "" if came == text else f"{came} as {name} instead of {text}"


def _unknown() -> list[Question]:
    """Return questions for unknown paths."""
    return [Question(f"/{quote(f'{_MARK}{number}-')}/", JSON, _mark_test(number)) for number in range(_UNKNOWN)]

"""``roaas certify --init --ros``: a ROS map as the description and the live graph suggest it, for a person to check.

An operation is taken for the topic, service or action whose fields its schemas have, by name and type, and whose name
its path or operationId shares; or which a list names beside the value of the path's parameter. What is left to guess
becomes a comment.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from http import HTTPStatus
from typing import Any, Final, NamedTuple

from conformance.contract.toml_file import basic_string
from conformance.documents.json_schema import Schema, kinds_of
from conformance.documents.json_text import read_json
from conformance.documents.openapi import Operation
from conformance.engine.commanded import body_schema, parts_of
from conformance.engine.first_ros_fields import FEW, Fit, fields_of, fit_of, items_of, leaves_of, places_of
from conformance.engine.first_ros_names import named_in_paths, named_in_requests, place_of
from conformance.engine.first_ros_parameters import parameters_of
from conformance.engine.map_text import inline
from conformance.observe.clock import WALL_CLOCK
from conformance.scenarios.ros.definition import Definition, value_at
from conformance.scenarios.ros.robot import ProbeError, Robot
from conformance.transport.client import HttpClient
from conformance.transport.exchange import NoAnswerError

# Names from the graph in a comment.
_NAMED: Final = 3
_READ_S: Final = 3.0  # deadline of one read, s
_READS_S: Final = 60.0  # time for all reads, s
_DISCOVERY_S: Final = 15.0  # longest wait for the graph, s
_SETTLES_S: Final = 3.0
# Names that every ROS node has.
_COMMON: Final = re.compile(r"/(parameter_events|rosout)$|/_|/(get_type_description|\w+_parameters(_atomically)?)$")
_PARAMETER: Final = re.compile(r"\{[^{}]*\}")  # a parameter in a path
_CANCELS: Final = re.compile(r"/[^/]*(cancel|abort|stop|preempt)[^/]*/?$")
_COMMANDS: Final = re.compile(r"(^|[/_])(cmd|commands?)([/_]|$)")
_STATE: Final = re.compile(r"[/_](state|status|phase)$")
_SENDS: Final = frozenset({"POST", "PUT", "PATCH"})
# Names of booleans beside a message, and their value if the message is too old or missing.
_FAILURES: Final = {r"/(is_?)?(stale|outdated|expired)$": True, r"/(success|ok)$": False}
_KINDS: Final = ("topics", "services", "actions")  # ends of the graph
# Names of objects without declared fields, by the part of a goal or call that they contain.
_HOLDS: Final = {
    "feedback": re.compile(r"/[^/]*(feedback|progress)$"),
    "result": re.compile(r"/[^/]*(result|outcome|output|response|parameters)$"),
}
#: For each state of a goal: beginnings of words for it, and its numbers in action_msgs/msg/GoalStatus.
_STATES: Final = {
    "running": r"run|exec|activ|accept|pend|work|cancell?ing|[123]$",
    "succeeded": r"succe|done|compl|finish|4$",
    "canceled": r"cancel|stop|preempt|5$",
    "aborted": r"abort|fail|error|6$",
    "rejected": r"reject|refus|deni",
}


class Graph(NamedTuple):
    """Contents of the ROS graph: types by name of topic, service and action, and definitions of types.

    ``read`` has what operations returned, by label: the document, or the status of what was no success; ``named`` those
    with values of their parameters, and the ROS names that lists or requests give for them; ``known`` those that a read
    showed, and their keys; ``bodies`` what the body says beside the message. ``is_named``: the graph is one such
    name, so that a body without declared fields may hold its messages. ``is_soap``: the operations are those of a WSDL.
    """

    topics: dict[str, str]
    services: dict[str, str]
    actions: dict[str, str]
    definition: Callable[[str], Definition]
    read: dict[str, Any]
    named: dict[str, tuple[Operation, str]]
    known: dict[str, tuple[Operation, dict[str, Any]]]
    bodies: dict[str, dict[str, str]]
    is_named: bool = False
    is_soap: bool = False

    def reads(self, one: Operation) -> bool:
        """Return whether an operation only reads: a GET, or one of a WSDL whose message says nothing."""
        says = any(at for at, _ in leaves_of(body_schema(one) or {}))
        return one.method == "GET" or (self.is_soap and one.shape is not None and not says)

    def only(self, name: str) -> Graph:
        """Return the graph with nothing but one name."""
        ends: dict[str, Any] = {
            kind: {key: one for key, one in getattr(self, kind).items() if key == name} for kind in _KINDS
        }
        return self._replace(**ends, is_named=True)

    def fitting(
        self, schema: Schema | None, ends: dict[str, str], part: str = "", holder: re.Pattern[str] | None = None
    ) -> dict[str, Fit]:
        """Return by name the topics, services and actions whose type, or a part of it, has a schema's fields.

        An object without declared fields has them if its name is that of a ``holder``, or if a list names the end.
        """
        found, places = {}, places_of(schema or {})
        objects = [at for at, leaf in leaves_of(schema or {}) if kinds_of(leaf) == {"object"}]
        objects = [at for at in objects if (holder.search(at) if holder else self.is_named)]
        for name, type_ in ends.items():
            with suppress(ProbeError):  # the message type is not installed
                fit = fit_of(places, self.definition(type_ + part))
                fit = Fit(objects[0], {}, FEW, 0, {}) if objects and not (fit and fit.size) else fit
                if fit is not None and not (part and fit.lacks):
                    found[name] = fit
        return found


@dataclass
class _Proposal:
    """The proposed table of one operation, how it writes numbers and bytes, and why it is a guess; or empty."""

    keys: dict[str, Any]
    forms: dict[str, str] = field(default_factory=dict)
    guess: str = ""


def ros_proposals(
    operations: Sequence[Operation], domain_id: int, client: HttpClient, *, is_soap: bool = False
) -> Iterator[str]:
    """Yield the lines of a ROS map by the graph of a domain, after each operation that may be called was read once.

    Operations of a WSDL (``is_soap``) are not called.

    Raises:
        ProbeError: the suite's node cannot be started.
    """
    read: dict[str, Any] = {}
    until = WALL_CLOCK.now() + _READS_S

    def get(one: Operation, *, again: bool = False) -> Any:
        is_first = one.label not in read and one.method == "GET" and one.shape is not None and "{" not in one.template
        if (again or is_first) and WALL_CLOCK.now() < until:
            # A gateway may subscribe only when a client reads.
            with suppress(NoAnswerError):
                exchange = client.send("GET", one.template, headers=(("Accept", "*/*"),), timeout_s=_READ_S)
                response = exchange.response
                read[one.label] = read_json(response.body).value if response.ok else response.status
        return read.get(one.label)

    for operation in operations:
        get(operation)
    robot = Robot(domain_id, "roaas_init")
    try:
        robot.await_ready()
        told = _settled_graph(robot)
        ends = {name: one for kind in _KINDS for name, one in told[kind].items()}
        types = {name: one["types"] if isinstance(one, dict) else one for name, one in ends.items()}
        topics, services, actions = (
            {name: types[name][0] for name in told[kind] if types[name] and not _COMMON.search(name)} for kind in _KINDS
        )
        named = {one.label: (one, name) for one, name in named_in_paths(operations, ends, get)}
        # A gateway may have found a node only after the first read.
        again = partial(get, again=True)
        known = {
            one.label: (one, keys)
            for one, keys in parameters_of(operations, robot.tell("parameters")["nodes"], again)
            if one.label not in named
        }
        bodies: dict[str, dict[str, str]] = {}
        for one, name, body in named_in_requests(
            operations, dict(zip(_KINDS, (topics, services, actions), strict=True))
        ):
            if one.method != "GET" and not told["topics"].get(name, {"subscribers": 1})["subscribers"]:
                continue
            if one.method != "GET":
                named[one.label], bodies[one.label] = (one, name), body
            elif name in topics and told["topics"][name]["publishers"]:
                with suppress(ProbeError):  # the message type is not installed
                    fields = {field for field, _ in robot.definition(topics[name]).fields("")}
                    at = place_of(again(one), fields)
                    keys = {"topic": name, "type": topics[name]} | ({"at": at} if at else {})
                    known |= {one.label: (one, keys)} if at is not None else {}
        graph = Graph(topics, services, actions, robot.definition, read, named, known, bodies, is_soap=is_soap)
        made = (_by_parameters(one, graph) for one in operations)
        known |= {one.label: (one, keys) for one, keys in filter(None, made)}
        every = {one.label: one for one in (*operations, *(one for one, _ in (*named.values(), *known.values())))}
        yield from _map_lines([*every.values()], graph, domain_id)
    finally:
        robot.close()


def _settled_graph(robot: Robot) -> dict[str, Any]:
    """Return the ROS graph once other nodes were found and no more appear."""
    until, seen = WALL_CLOCK.now() + _DISCOVERY_S, robot.tell("graph")
    while True:
        WALL_CLOCK.sleep(_SETTLES_S)
        now = robot.tell("graph")
        if (now["nodes"] and now == seen) or WALL_CLOCK.now() > until:
            return now
        seen = now


def _map_lines(operations: Sequence[Operation], graph: Graph, domain_id: int) -> Iterator[str]:
    """Yield the lines of a ROS map; operations that are guesses or do not fit become comments."""
    found = {label: _Proposal(keys) for label, (_, keys) in graph.known.items()}
    followers: set[str] = set()
    written: set[str] = set()
    # Topics that the gateway publishes come first: another operation hardly reads one of them.
    for operation in sorted(operations, key=graph.reads):
        if "{" in operation.template or operation.label in graph.known:
            continue
        there = graph.only(graph.named[operation.label][1]) if operation.label in graph.named else graph
        proposal = (
            _goal(operation, operations, there, followers) or _call(operation, there)
            if not graph.reads(operation) and operation.method in _SENDS
            else _lists(operation, there)
        ) or _topic(operation, there, written)
        if proposal:
            proposal.keys |= {"body": graph.bodies[operation.label]} if graph.bodies.get(operation.label) else {}
            found[operation.label] = proposal
            written |= set() if proposal.guess else {proposal.keys.get("publishes", "")}
    for operation in operations:
        of = found.get(operation.label.rpartition("/")[0])
        if of and "topic" in of.keys and any(name.startswith("text/event-stream") for name in operation.formats):
            guess = of.guess or ("at" in of.keys and "an event may have the message elsewhere.") or ""
            keys = {key: of.keys[key] for key in ("topic", "type", "fields") if key in of.keys}
            found[operation.label] = _Proposal(keys | {"stream": "sse"}, guess=guess)
    sure = [one for one in found.values() if not one.guess]
    sign = "" if sure else "# "
    yield f"{sign}[ros]"
    yield f"{sign}domain_id = {domain_id}"
    for name in ("non_finite", "integers", "bytes"):
        forms = {one.forms[name] for one in sure if name in one.forms}
        yield from (f"{name} = {basic_string(form)}" for form in forms if len(forms) == 1)
    yield ""
    yield f"{sign}[ros.operations]"
    for operation in operations:
        if operation.label in found:
            proposal = found[operation.label]
            comment = "# " if proposal.guess else ""
            yield from [f"# A guess: {proposal.guess}"] if proposal.guess else []
            yield f"{comment}{basic_string(operation.label)} = {inline(proposal.keys)}"
        elif operation.label not in {*followers, *graph.named, *(re.split("[?#]", label)[0] for label in found)}:
            label = "".join(char if char.isprintable() else " " for char in operation.label)
            yield f"# {label}: {_why_not(operation, graph)}"


def _why_not(one: Operation, graph: Graph) -> str:
    schema = one.shape if graph.reads(one) else body_schema(one)
    if "{" in one.template:
        return "its path has a parameter: write an operation for each value, as in GET /topics/odom"
    if one.method != "GET" and one.method not in _SENDS:
        return "it reads nothing and sends nothing, unless it cancels a goal"
    if schema is None or not any(at for at, _ in leaves_of(schema)):
        is_list = schema is not None and items_of(schema) is not None
        return "a list, but not of the graph's names, all or of one type" if is_list else "its schema names no fields"
    ends = f"{len(graph.topics)} topics, {len(graph.services)} services and {len(graph.actions)} actions"
    return f"nothing on the graph has its fields, of {ends}"


def _topic(one: Operation, graph: Graph, written: Collection[str]) -> _Proposal | None:
    """Return the proposal that an operation reads a topic, or publishes on it.

    A declared 404 may be for anything: `absent` is a status that it returned, for want of a message, as it seems.
    """
    reads = graph.reads(one)
    fits = graph.fitting(one.shape if reads else body_schema(one), graph.topics)
    # Partial matches of fields count only if the operation's name also fits.
    fits = {name: fit for name, fit in fits.items() if not fit.lacks or _shared_words(one, name)}
    name, guess = _best(one, fits, written if reads else (), reads=reads)
    if not name:
        return None
    read = graph.read.get(one.label)
    keys = {"topic" if reads else "publishes": name, "type": graph.topics[name]} | fits[name].keys
    keys |= {"absent": [read]} if read in (HTTPStatus.NOT_FOUND, HTTPStatus.SERVICE_UNAVAILABLE) else {}
    keys |= _failure(one, fits[name].at, graph.definition(graph.topics[name])) if reads else {}
    return _Proposal(keys, fits[name].forms, guess)


def _failure(one: Operation, at: str, definition: Definition) -> dict[str, Any]:
    """Return the key `failure` where a successful response has a boolean for it outside of its message."""
    contents = (content for status, content in one.responses.items() if status.startswith("2"))
    leaves = [pair for content in contents for schema in content.values() for pair in leaves_of(schema)]
    own = dict(fields_of(definition))
    for names, value in _FAILURES.items():
        for place, leaf in leaves:
            is_inside = place.startswith(f"{at}/") if at else place in own
            if re.search(names, place, re.IGNORECASE) and kinds_of(leaf) == {"boolean"} and not is_inside:
                return {"failure": {"at": place, "values": [value]}}
    return {}


def _best(
    one: Operation, fits: dict[str, Fit], written: Collection[str] = (), *, reads: bool = False
) -> tuple[str, str]:
    """Return the topic, service or action that an operation fits best, and why that is a guess; empty if none fits."""

    def rank(name: str) -> tuple[bool, bool, int, float]:
        return name not in written, not fits[name].lacks, fits[name].size, _shared_words(one, name)

    name, *others = sorted(fits, key=rank, reverse=True) or [""]
    equal = [other for other in others if rank(other) == rank(name)]
    if equal:
        return name, f"{', '.join(equal[:_NAMED])} would do as well."
    if name in written:
        return name, "another operation publishes on this topic."
    if reads and _COMMANDS.search(name):
        return name, "its name is that of a topic for commands."
    alike = any(fits[other].size == fits[name].size for other in others)
    if name and not _shared_words(one, name) and (alike or fits[name].size < FEW):
        return name, "the fields agree, but not the name."
    return name, fits[name].guess if name else ""


def _call(one: Operation, graph: Graph) -> _Proposal | None:
    """Return the proposal that an operation calls a service."""
    requests = graph.fitting(body_schema(one), graph.services, "#Request")
    responses = graph.fitting(one.shape, {name: graph.services[name] for name in requests}, "#Response")
    name, guess = _best(one, {name: fit for name, fit in responses.items() if not fit.fields})
    if not name:
        return None
    keys = {"service": name, "type": graph.services[name]} | requests[name].keys
    keys |= {"result": responses[name].at} if responses[name].at else {}
    keys |= _failure(one, responses[name].at, graph.definition(f"{graph.services[name]}#Response"))
    return _Proposal(keys, requests[name].forms | responses[name].forms, guess)


def _by_parameters(one: Operation, graph: Graph) -> tuple[Operation, dict[str, Any]] | None:
    """Return an operation with its parameters written out, and the keys of the service or topic that has their fields.

    None: its parameters are no message, or which one is a guess.
    """
    given = {item.name: item for item in (*one.parameter("path"), *one.parameter("query"))}
    if not given or body_schema(one) is not None:
        return None
    schema = {"properties": {name: item.schema for name, item in given.items()}}
    fits = {name: fit for name, fit in graph.fitting(schema, graph.services, "#Request").items() if fit.size}
    responses = graph.fitting(one.shape, {name: graph.services[name] for name in fits}, "#Response")
    name, guess = _best(one, {name: fit for name, fit in responses.items() if not fit.fields})
    keys: dict[str, Any] = {"service": name, "type": graph.services.get(name)}
    keys |= {"result": responses[name].at} if name and responses[name].at else {}
    if not name and one.method in _SENDS:
        fits = graph.fitting(schema, graph.topics)
        name, guess = _best(one, {topic: fit for topic, fit in fits.items() if _shared_words(one, topic)})
        keys = {"publishes": name, "type": graph.topics.get(name)}
    if not name or guess:
        return None
    fields = fits[name].fields or {f"/{field}": f"/{field}" for field in given}
    own = {web.removeprefix("/"): place for web, place in fields.items()}
    if any(item.required and item.name not in own for item in given.values()):
        return None
    query = "&".join(f"{item.name}={{{item.name}}}" for item in one.parameter("query") if item.name in own)
    return replace(one, template=f"{one.template}{'?' * bool(query)}{query}"), keys | {"in_url": own}


def _goal(one: Operation, operations: Sequence[Operation], graph: Graph, followers: set[str]) -> _Proposal | None:
    """Return the proposal that an operation sends goals to an action, or begins calls that are followed like goals.

    The operations that follow a goal go to ``followers``.
    """
    ends, part = (graph.actions, "Goal") if graph.actions or not graph.is_named else (graph.services, "Request")
    fits = graph.fitting(body_schema(one), ends, f"#{part}")
    name, guess = _best(one, fits)
    id_ = next((at for at, _ in leaves_of(one.shape or {}) if re.search(r"[/_]u?u?id$", at)), None)
    if not name or id_ is None:
        return None
    is_goal = part == "Goal"
    keys = {"action" if is_goal else "service": name, "type": ends[name]} | fits[name].keys | {"id": id_}
    keys |= _failure(one, "", graph.definition(f"{ends[name]}#{part}"))
    forms = dict(fits[name].forms)
    # All goals may be in one place, beside the operations that send them.
    for place in (one.template.rstrip("/"), one.template.rstrip("/").rpartition("/")[0]):
        goal = re.compile(re.escape(place) + r"/\{[^{}]+\}(/[^{}]*)?")
        for other in (other for other in operations if goal.fullmatch(other.template)):
            call = f"{other.method} {_PARAMETER.sub('{id}', other.template)}"
            cancels = other.method == "DELETE" if other.template.endswith("}") else _CANCELS.search(other.template)
            if cancels and other.method != "GET":
                keys |= {"cancel": call} if is_goal else {}
            elif other.method == "GET" and other.shape is not None and "state" not in keys:
                leaves = ((at, leaf) for at, leaf in leaves_of(other.shape) if _STATE.search(at))
                found = {at: _states(leaf) for at, leaf in leaves}
                # A call cannot be canceled: words for that are of goals beside it.
                at = max(found, key=lambda at: (is_goal or "canceled" not in found[at], len(found[at])), default="")
                keys |= {"state": {"read": call, "at": at} | found[at]} if at else {}
                for held, names in list(_HOLDS.items())[not is_goal :] if at else ():
                    part = held.capitalize() if is_goal else "Response"
                    for fit in graph.fitting(other.shape, {name: ends[name]}, f"#{part}", names).values():
                        keys |= {held: fit.at} if fit.at and not fit.fields else {}
                        forms |= fit.forms
            else:
                continue
            followers.add(other.label)
        if "state" in keys or "cancel" in keys:
            break
    return _Proposal(keys, forms, guess) if is_goal or "state" in keys else None


def _states(leaf: Schema) -> dict[str, list[str]]:
    """Return the words of a schema for the states of a goal."""
    found: dict[str, list[str]] = {}
    for word in (str(word) for part in parts_of(leaf) for word in part.get("enum", ())):
        state = next((name for name, begins in _STATES.items() if re.match(begins, word.lower())), None)
        if state:
            found.setdefault(state, []).append(word)
    return found


def _lists(one: Operation, graph: Graph) -> _Proposal | None:
    """Return the proposal that an operation lists the graph, if its response has all names of a kind, or of a type."""
    for at, leaf in leaves_of(one.shape or {}):
        items = items_of(leaf)
        members = dict(leaves_of(items)) if items else {}
        listed = value_at(graph.read.get(one.label), at)
        for kind, ends in (("topics", graph.topics), ("services", graph.services), ("actions", graph.actions)):
            for name in members if ends and isinstance(listed, list) else ():
                found = {str(value_at(item, name)) for item in listed}
                types = {ends.get(one, "") for one in found}
                of = types.pop() if len(types) == 1 else ""
                if {*ends} <= found or (of and {one for one, type_ in ends.items() if type_ == of} == found):
                    type_ = next((other for other in members if re.search("type|kind", other)), "")
                    places = {"at": at, "name": name, "type": type_, "of": "" if {*ends} <= found else of}
                    return _Proposal({"lists": kind} | {key: place for key, place in places.items() if place})
            # An operation of a WSDL was not read: the members of its items suggest what it lists.
            name = next((other for other in (f"/{kind[:-1]}", "/name") if other in members), "")
            type_ = next((other for other in members if re.search("type$", other)), "")
            words = f"{one.template.rpartition('/')[2]} {name}".lower()
            if graph.is_soap and name and type_ and kind[:-1] in words:
                keys = {"lists": kind, "at": at, "name": name, "type": type_}
                return _Proposal(keys, guess="members of its items have these names. If it lists one type, add `of`.")
    return None


def _shared_words(one: Operation, name: str) -> float:
    """Return the share of the words in a ROS name that an operation's path or id has; "vel" is "velocity"."""
    own = re.findall("[a-z]+", name.lower())
    web = re.findall("[a-z]+", re.sub("([a-z])([A-Z])", r"\1 \2", f"{one.template} {one.id}").lower())
    return sum(any(_is_word(*sorted((word, other), key=len)) for other in web) for word in own) / max(1, len(own))


def _is_word(short: str, long: str) -> bool:
    return short == long or (len(short) > 2 and long.startswith(short))  # noqa: PLR2004 - shorter ones begin anything

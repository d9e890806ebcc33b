"""Play the scenarios of REST on SOAP operations, which are seen as resources: lifecycles and lists."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, field
from typing import Any, Final
from urllib.parse import unquote

from conformance.api.call_rules import CallRules, Reason
from conformance.api.device import Device
from conformance.api.rest.applicable import callable_operations
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.listing import page_of
from conformance.api.rest.references import collections_of
from conformance.api.rest.values import Values
from conformance.api.soap.resources import BASE, Place, Resources, SoapExchange, resources_of
from conformance.api.soap.roles import Role
from conformance.documents.openapi import Operation, is_json, matching, operations_of
from conformance.documents.xsd_json import schema_of
from conformance.documents.xsd_shapes import NoElementError
from conformance.scenarios.described_messages import fields_of, target_of
from conformance.scenarios.ending import Deletion, begin_and_end, look_at_ended, used_things
from conformance.scenarios.lifecycles import lifecycles
from conformance.scenarios.lists import Paged, lists_of, pages_of_lists, vary_lists
from conformance.scenarios.living import Life
from conformance.scenarios.own_things import own_things
from conformance.scenarios.scenario import NotPossibleError, partial_trace, scenario
from conformance.scenarios.soap_survey import Caller, Kind, SoapProbe, usual_message
from conformance.scenarios.stage import Leaves, Need, Stage
from conformance.scenarios.writing import Writer
from conformance.transport.exchange import Attempt, Exchange, NoAnswerError, Outgoing, Request, Response
from conformance.transport.parallel import send_together

# Things that lists are filtered, sorted and read in parts with.
_LISTED: Final = 5
# How long nothing changes before lists are compared, s.
_QUIET_S: Final = 3.1
_REFUSED: Final = Response(400, (), b"", 0.0)


@dataclass(frozen=True)
class Things:
    """What the scenarios recorded, and the messages of all."""

    lives: tuple[Life, ...]
    pages: tuple[Paged, ...]
    deletions: tuple[Deletion, ...]
    probes: tuple[SoapProbe, ...]


@dataclass(frozen=True)
class _Rules(CallRules):
    """Which resources may be used: those of the operations that may be called."""

    called: frozenset[str] = frozenset()

    def decide(self, operation: Operation) -> Reason:
        """Return whether an operation may be called."""
        return Reason.ALLOWED if operation.label in self.called else Reason.NEVER


def _head(place: Place) -> str:
    return place.template.partition("/{")[0]


def _schema_by(place: Place, branch: int) -> dict[str, Any]:
    return schema_of(place.request, branch=branch) if place.request is not None else {}


@dataclass
class _OverSoap(RestInterface):
    """A SOAP device as one with resources: what is sent to them goes out as messages.

    Attributes:
        caller: sends and records.
        resources: the operations as resources.
    """

    caller: Caller = field(kw_only=True)
    resources: Resources = field(kw_only=True)

    def __post_init__(self) -> None:
        self.device = Device(self.run)

    @classmethod
    def of(cls, caller: Caller, branch: int = 0) -> _OverSoap:
        """Return the interface to the operations that may be called, with a branch of each choice.

        With another than the first one, it has only the things whose requests have choices.
        """
        resources = Resources(caller.api.run.contract, caller.messages.found, branch)
        run = copy(caller.api.run)
        run.contract = resources.contract
        made = cls(run, caller.api.client, caller=caller, resources=resources)
        places = [place for place in resources.places.values() if place.act.label in caller.acts]
        if branch:
            heads = {
                _head(place) for place in places if place.request and _schema_by(place, 0) != _schema_by(place, branch)
            }
            places = [place for place in places if _head(place) in heads]
        made_in = {place.template for place in places if place.method == "POST"}
        # Only what the suite has created is ended.
        called = {
            f"{place.method} {place.template}"
            for place in places
            if place.act.role is not Role.ENDS or _head(place) in made_in
        }
        called |= {f"GET {item}" for item, one in resources.lists.items() if f"GET {one.template}" in called}
        made.call_rules = _Rules(called=frozenset(called))
        return made

    def _message(self, request: Outgoing) -> tuple[Place, bytes] | None:
        """Return the message for a request; None if there is none."""
        operation = matching(self.resources.contract, request.method, request.target.partition("?")[0])
        try:
            place = next(
                one
                for one in self.resources.places.values()
                if operation is not None and (one.method, one.template) == (operation.method, operation.template)
            )
            node = self.resources.message(place, request)
            return place, self.caller.messages.message(place.act.port, place.act.operation, node)
        except (StopIteration, NoElementError, NotPossibleError, ValueError):
            return None

    def send(self, request: Outgoing, *, fresh: bool = False, timeout_s: float | None = None) -> Exchange:  # noqa: ARG002 - messages go out on the run's connection
        """Send a request as a message; what no message can say is refused."""
        path = request.target.partition("?")[0]
        operation = matching(self.resources.contract, request.method, path)
        if operation is not None and request.method == "GET" and operation.template in self.resources.lists:
            place = self.resources.lists[operation.template]
            listed, id_ = self.send(Outgoing("GET", place.template)), unquote(path.rpartition("/")[2])
            page = page_of(listed.response)
            there = [item for item in page.items if str(item.get(place.id)) == id_] if page is not None else []
            if not isinstance(listed, SoapExchange) or page is None:
                return listed
            return self.resources.item_of(listed, operation.template, id_, [*there, None][0])
        made = self._message(request) if not request.body or is_json(request.media_type) else None
        if made is None:
            return Exchange(Request(request.method, request.target), _REFUSED)
        probe = self.caller.send(made[0].act, Kind.TRIED, "a valid message", made[1])
        if probe.exchange is None:
            raise NoAnswerError(probe.unanswered) if probe.unanswered else NotPossibleError("it was not sent")
        seen = self.resources.as_rest(probe.exchange)
        return seen if isinstance(seen, Exchange) else Exchange(Request(request.method, request.target), _REFUSED)

    def send_together(self, requests: Sequence[Outgoing]) -> list[Attempt]:
        """Send requests at the same moment."""
        made = [one for one in map(self._message, requests) if one is not None]
        sent = [
            Outgoing("POST", target_of(one.act.port), fields_of(one.act.port, one.act.operation), octets)
            for one, octets in made
        ]
        attempts = send_together([[(self.client, one) for one in sent]])[0] if sent else []
        return [seen for one in attempts if (seen := self.resources.as_rest(one)) is not None]


@scenario(needs={Need.REST}, leaves=Leaves.UNTOUCHED, stage=Stage.INPUT)
def soap_things(api: RestInterface) -> Things:
    """Create things by SOAP operations, read, change, list and remove them."""
    caller, resources = Caller.of(api), resources_of(api.run.contract)
    if resources is None:
        raise NotPossibleError("the device has no WSDL")
    values = Values(api.run.statement.values, collections_of(operations_of(resources.contract)))
    device = _OverSoap.of(caller)
    for act in caller.acts.values():
        with suppress(NotPossibleError):  # the survey names what a message lacks
            if not act.needs and act.role is Role.READS:
                usual_message(caller, act)
    for probe in caller.probes:
        seen = resources.as_rest(probe.exchange) if probe.exchange is not None else None
        if isinstance(seen, Exchange) and seen.response.ok:
            operation = matching(resources.contract, seen.request.method, seen.request.target)
            if operation is not None:
                values.learn(operation, seen)
    lives, pages, deletions = list[Life](), list[Paged](), list[Deletion]()
    with partial_trace(lambda: Things(tuple(lives), tuple(pages), tuple(deletions), tuple(caller.probes))):
        with suppress(NotPossibleError):
            lives += lifecycles.play(device, values)
        with suppress(NotPossibleError):
            lives += lifecycles.play(_OverSoap.of(caller, 1), values)
        with suppress(NotPossibleError):
            deletions += used_things.play(device, values)
        with suppress(NotPossibleError):
            look_at_ended(device, values, begin_and_end(device, values))
        with suppress(NotPossibleError):
            own_things.play(device, values)
        made = list(_fill(Writer(device, values)))
        # A total may be late after a change.
        time.sleep(_QUIET_S if lists_of(device) else 0)
        with suppress(NotPossibleError):
            vary_lists(device, values)
        with suppress(NotPossibleError):
            pages += pages_of_lists.play(device, values)
        for path in made:
            with suppress(NoAnswerError, NotPossibleError):
                device.send(Outgoing("DELETE", path))
    return Things(tuple(lives), tuple(pages), tuple(deletions), tuple(caller.probes))


def _fill(writer: Writer) -> Iterator[str]:
    """Create things for each list with parameters, with different values; yield the path of each."""
    operations = callable_operations(writer.api)
    for listing in lists_of(writer.api):
        path = listing.operation.template
        create = operations.get(("POST", path)) if listing.operation.parameters else None
        if create is None or not any(one[0] == "DELETE" and one[1].startswith(f"{path}/") for one in operations):
            continue
        for turn in range(_LISTED):
            with suppress(NoAnswerError, NotPossibleError):
                sent = (writer.send(create, body=body) for body in writer.bodies(create, turn))
                done = next((exchange for exchange in sent if exchange.response.ok), None)
                location = done.response.header("location") if done is not None else None
                yield from [location.removeprefix(BASE)] if location else []

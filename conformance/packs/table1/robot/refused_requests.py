"""Requests that command nothing, and those that the robot refused in a run, to send them again in another state.

A robot may refuse a request without effect in one state, and let it have one in another: while a goal is active, while
a velocity is held, between deliveries.
"""

import random
import re
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final

from conformance.api.rest.calls import XML
from conformance.api.rest.interface import RestInterface
from conformance.api.soap.callable_services import SoapServices
from conformance.api.soap.calls import read_exchange
from conformance.api.soap.service import SoapService
from conformance.contract.classes import Interface
from conformance.packs.table1.robot.delivery import Delivery, path_of
from conformance.packs.table1.robot.geometry import Pose
from conformance.packs.table1.robot.goal import goal_body, put_goal
from conformance.packs.table1.robot.robot import (
    ACCEPT_JSON,
    DELIVERIES,
    GOAL_PATH,
    JSON_BODY,
    LINEAR,
    POSE,
    SENSORS,
    VELOCITY,
    Robot,
    Velocity,
    put_as_xml,
)
from conformance.packs.table1.robot.soap_services import ask, send_delivery
from conformance.transport.client import HttpClient
from conformance.transport.exchange import SAFE_METHODS, Exchange, Listener, Request, Response
from conformance.verdict.effort import Effort

# Statuses for a request that is wrong in every state, regardless of sender, size or rate.
_WRONG: Final = frozenset({400, 404, 405, 406, 415, 422})
_FAULTS: Final = frozenset({"Client", "MustUnderstand", "VersionMismatch"})  # the same as fault codes of SOAP
# Headers that change the framing of a request or its later meaning.
_SPECIAL: Final = frozenset({"transfer-encoding", "expect", "range", "idempotency-key", "if-match", "if-none-match"})
_OF_THE_CLIENT: Final = frozenset({"host", "content-length", "connection"})
_LARGEST: Final = 8192  # longest request that is kept, bytes: other checks test larger ones
_LONGEST: Final = 1024  # longest target, characters
_ATTACKS: Final = (b"<!DOCTYPE", b"<!ENTITY", b"XInclude")
# The words of a refusal show its kind of fault: these find where they start, and the values to remove from them.
_DETAIL: Final = re.compile(r"detail\W+|faultstring\W*")
_VALUES: Final = re.compile(r"'[^']*'|\d+")
_KIND: Final = 48
_MOST: Final = 400  # requests of one operation that are kept
_ALIKE: Final = 2  # requests that are kept for each kind of fault
_BEYOND: Final = Velocity(angular_z=1e4)  # a velocity that every robot refuses
#: A frame that no robot knows.
NO_FRAME: Final = "no_such_frame"
_NO_NUMBER: Final = ("3", "1", "2", "3", "4", "5", "abc")
_COUNTS: Final = {"quick": 60, "standard": 300}  # requests sent again to a fast robot, by effort
_FEWEST: Final = 8  # requests that are sent again to a slow robot
# Longest time for these requests if --request-rate limits them, s.
_LONGEST_S: Final = 0.5
# Kinds of fault that an operation gets in each round, by its rank.
_DEPTH: Final = (6, 2, 1)


@dataclass(frozen=True)
class Refused:
    """A request that was refused.

    Attributes:
        client: sends it again.
        request: the request.
        path: its target below the client's base URL.
    """

    client: HttpClient
    request: Request
    path: str

    @property
    def what(self) -> str:
        """Return the request as a noun phrase."""
        kind = f" of {self.request.media_type}" if self.request.media_type else ""
        return f"{self.request.method} {self.path.split('?')[0][:80]}{kind}, which was refused before"

    @property
    def acts(self) -> bool:
        """Return whether the request would change something if it were valid."""
        return self.request.method not in SAFE_METHODS

    def send(self) -> Exchange:
        """Send it again."""
        own = self.client.connection.credentials.fields(shown=True)
        fields = [
            (name, value)
            for name, value in self.request.headers
            if name.lower() not in _OF_THE_CLIENT and (name, value) not in own
        ]
        names = {name.lower() for name, _ in fields}
        fields += [] if "accept" in names else [("Accept", "")]
        return self.client.send(self.request.method, self.path, headers=fields, body=self.request.body)


def is_refused(exchange: Exchange) -> bool:
    """Return whether a response says that the request is wrong: by its status, or as a SOAP fault."""
    response = exchange.response
    if exchange.request.method == "POST" and response.media_type in {"text/xml", "application/soap+xml"}:
        return read_exchange(exchange).code in _FAULTS
    return response.status in _WRONG


class RefusedRequests(Listener):
    """Listens to all exchanges of one run, and keeps the refused requests by operation and kind of fault.

    Args:
        api: the robot's REST interface.

    Attributes:
        has_known: whether the robot was sent what every robot refuses.
    """

    def __init__(self, api: RestInterface) -> None:
        self._rest = api.client
        self._by_operation: dict[tuple[str, str, int], dict[str, list[Request]]] = defaultdict(dict)
        self._dropped: set[Request] = set()
        self.has_known = False

    def on_response(self, exchange: Exchange) -> None:
        """Keep a request that was refused, if it can be sent again and is refused in any state."""
        request, response = exchange.request, exchange.response
        if not _is_plain(request) or not is_refused(exchange) or request in self._dropped:
            return
        if request.url == self._rest.url(GOAL_PATH) and response.status == 404:  # noqa: PLR2004 - there was no goal
            return
        kinds = self._by_operation[request.endpoint, request.media_type, response.status]
        alike = kinds.setdefault(_kind_of(response), []) if len(kinds) < _MOST else []
        if len(alike) < _ALIKE and request not in alike:
            alike.append(request)

    def drop(self, refused: Refused) -> None:
        """Forget a request that the robot has taken in another state: it was not wrong, but came at a wrong time."""
        self._dropped.add(refused.request)

    def choose(self, services: Iterable[SoapService], effort: Effort) -> list[Refused]:
        """Return as many requests as the effort allows: of each operation some, and first those that would act."""
        count = max(_FEWEST, round(_COUNTS.get(effort.name, _COUNTS["standard"]) * effort.speed.share))
        clients = [self._rest, *(service.client for service in services)]
        if rate := self._rest.connection.request_rate:
            count = min(count, max(_FEWEST, round(rate * _LONGEST_S)))
        found: list[Refused] = []
        ranked: list[tuple[int, int, Request]] = []
        for key, kinds in self._by_operation.items():
            rank = _rank(self._rest, key[0])
            depth = _DEPTH[rank]
            alike = [kind[place] for place in range(_ALIKE) for kind in kinds.values() if place < len(kind)]
            ranked += [(number // depth, rank, request) for number, request in enumerate(alike)]
        ranked.sort(key=lambda one: one[:2])
        for _, _, request in ranked:
            client = next((http_client for http_client in clients if request.url.startswith(http_client.url(""))), None)
            if client is None or request in self._dropped:
                continue
            path = request.url[len(client.url("")) :]
            if not client.refusal(request.method, path):
                found.append(Refused(client, request, path))
        return found[:count]


def send_known(robot: Robot, soap: SoapServices, refused: RefusedRequests) -> None:
    """Send requests that every robot refuses, so that a run of few checks has each kind too."""
    if refused.has_known:
        return
    refused.has_known = True
    goal = goal_body(Pose(0.0, 0.0, 0.0), NO_FRAME, "refused")
    put_goal(robot, goal)
    put_as_xml(robot, VELOCITY, _BEYOND.twist)
    robot.put_velocity(_BEYOND)
    robot.rest.send("PUT", GOAL_PATH, headers=(("Content-Type", XML),), body=b"<MoveBaseActionGoal/>")
    robot.rest.send("PUT", path_of(*_NO_NUMBER))
    for path in (POSE, SENSORS):
        robot.rest.send("GET", path, headers=(("Accept", "image/png"),))
    if soap.publishers is not None and Interface.PUBLISHERS not in soap.run.unreachable:
        send_delivery(soap.publishers, Delivery(0, *map(float, range(6))))


def _rank(rest: HttpClient, endpoint: str) -> int:
    """Return the rank of an operation: moving and ordering ones come first."""
    method, _, url = endpoint.partition(" ")
    moves = any(url.startswith(rest.url(path.rstrip("/"))) for path in (VELOCITY, LINEAR, GOAL_PATH, DELIVERIES))
    if method in SAFE_METHODS:
        return 2
    return 0 if moves or "Execute" in url else 1


def _is_plain(request: Request) -> bool:
    """Return whether a request can be sent again unchanged, and is no attack."""
    names = [name.lower() for name, _ in request.headers]
    size = next((value for name, value in request.headers if name.lower() == "content-length"), str(len(request.body)))
    host = next((value for name, value in request.headers if name.lower() == "host"), "")
    fields = sum(len(name) + len(value) for name, value in request.headers)
    return (
        request.raw is None
        and not request.query
        and len(request.body) <= _LARGEST
        and len(request.url) <= _LONGEST
        and fields <= _LONGEST
        and _SPECIAL.isdisjoint(names)
        and len(set(names)) == len(names)
        and size == str(len(request.body))
        and f"//{host}/" in request.url
        and not any(attack in request.body for attack in _ATTACKS)
    )


def _kind_of(response: Response) -> str:
    """Return the beginning of a refusal's text, without values."""
    text = response.body[:_LONGEST].decode("utf-8", "replace")
    return _VALUES.sub("*", _DETAIL.split(text, maxsplit=1)[-1])[:_KIND]


_NOT_ACCEPTABLE: Final = (("Accept", "image/png"),)
# Quaternions off by more than 2e-3 are refused (contract.md#poses).
_NO_UNIT: Final = 2.0
_NO_DELIVERY: Final = Delivery(0, *map(float, range(6)))
_MALFORMED: Final = b'{"linear": '


def refuse_goal(robot: Robot) -> object:
    """PUT a goal that the robot must refuse."""
    return put_goal(robot, goal_body(Pose(0.0, 0.0, 0.0), "map", length=_NO_UNIT))


def no_commands(robot: Robot, soap: SoapServices, seed: str) -> list[Callable[[], object]]:
    """Return requests that are refused or only read, some of another client, in an order set by the seed."""
    away = soap.run.unreachable
    publishers = None if Interface.PUBLISHERS in away else soap.publishers
    subscribers = None if Interface.SUBSCRIBERS in away else soap.subscribers
    rest = robot.rest
    found: list[Callable[[], object]] = [
        lambda: robot.put_velocity(_BEYOND),
        lambda: robot.put_linear(_BEYOND._replace(linear_x=1e3, angular_z=0.0)),
        lambda: refuse_goal(robot),
        lambda: rest.send("PUT", path_of(*_NO_NUMBER)),
        lambda: rest.send("GET", VELOCITY, headers=_NOT_ACCEPTABLE),
        lambda: rest.send("HEAD", VELOCITY),
        lambda: rest.send("OPTIONS", LINEAR),
        lambda: rest.send("GET", SENSORS),
        lambda: rest.send("PUT", VELOCITY, headers=JSON_BODY, body=_MALFORMED, fresh=True),
        lambda: rest.send("PUT", GOAL_PATH, headers=JSON_BODY, body=_MALFORMED, fresh=True),
        lambda: rest.send("GET", VELOCITY, headers=ACCEPT_JSON, fresh=True),
    ]
    if publishers is not None:
        found.append(lambda: send_delivery(publishers, _NO_DELIVERY))
    if subscribers is not None:
        found.append(lambda: ask(subscribers, "GetVelocity"))
        found.append(lambda: ask(subscribers, "GetPose"))
    random.Random(f"{seed}/no commands").shuffle(found)  # noqa: S311 - no secret
    return found

"""Requests that the robot has refused in the run, sent again at rest, between deliveries and while a goal is active."""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from http import HTTPStatus
from typing import Any, Final

from conformance.api.rest.calls import JSON
from conformance.api.rest.interface import RestInterface
from conformance.api.rest.validity import INVALID, VALID, validity
from conformance.api.soap.callable_services import SoapServices
from conformance.documents.json_text import read_json
from conformance.observe.clock import poll_for
from conformance.packs.table1.robot.deliveries_seen import QUIET_S, DeliveryObserver, NoObserverError, observer_of
from conformance.packs.table1.robot.delivery import Delivery, key_of, put_delivery
from conformance.packs.table1.robot.delivery_sender import DeliverySender
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.geometry import Pose, length_of, wrapped
from conformance.packs.table1.robot.goal import (
    NEW,
    await_goal,
    await_none,
    choose_goals,
    difference,
    goal_body,
    is_there,
    put_goal,
)
from conformance.packs.table1.robot.goal_trace import Put
from conformance.packs.table1.robot.message_shapes import body_of
from conformance.packs.table1.robot.probe import ProbeError, RosProbe
from conformance.packs.table1.robot.refused_requests import NO_FRAME, Refused, RefusedRequests, is_refused, send_known
from conformance.packs.table1.robot.robot import GOAL_PATH, STILL, Robot, put_as_xml
from conformance.packs.table1.robot.soap_services import send_delivery
from conformance.packs.table1.robot.stopping import bring_to_rest
from conformance.packs.table1.scenarios.attempts import GOAL, elsewhere
from conformance.packs.table1.scenarios.goal_life import await_motion, put_new
from conformance.papers_robot.delivery import COFFEE, COURIER
from conformance.scenarios.scenario import NoOccasionError, PartialTraceError, scenario
from conformance.scenarios.stage import Need, Stage
from conformance.transport.exchange import Exchange
from conformance.verdict.evidence import Case

_AFTER: Final = "requests that were refused before, sent again"
# How often a refused request must have an effect: a single order may be another client's.
_TWICE: Final = 2
# A robot that has moved less than _STOOD_M, m, and _STOOD_RAD, rad, stood still.
_STOOD_M: Final = 0.01
_STOOD_RAD: Final = 0.02
_OTHER_RAD: Final = 1.0
# Refused requests sent again: a faulty robot may end its goal at only every third one.
_AGAIN: Final = 8
# A quaternion whose length is off by more is refused (contract.md#poses).
_NO_UNIT: Final = 2e-3


def _of(code: int, first: int) -> Delivery:
    return Delivery(code, *(first + place + 1 / 11 for place in range(6)))


@dataclass(frozen=True)
class Ordered:
    """Valid deliveries directly after refused requests, and the messages that arrived.

    Attributes:
        orders: the deliveries that were accepted, each with its exchange.
        seen: the deliveries that arrived since the first of the refused requests.
        unknown: those that are none of the orders.
        refused: the last refused request before the orders.
        exact: whether the sign of a zero is seen.
    """

    orders: tuple[tuple[Delivery, Exchange], ...]
    seen: tuple[Delivery, ...]
    unknown: tuple[Delivery, ...]
    refused: Exchange
    exact: bool


@dataclass(frozen=True)
class DuringGoal:
    """A request that was sent while a goal was active.

    Attributes:
        what: the request, or what is wrong with it.
        exchange: the request and its response.
        differs: how the goal that the robot then shows differs from the one before; empty if nowhere.
    """

    what: str
    exchange: Exchange
    differs: str


@dataclass(frozen=True)
class RefusedAgain:
    """The effects of refused requests that were sent again.

    Attributes:
        rests: readings after them at rest.
        ordered: the deliveries between them; twice where the first time showed one too many.
        unseen: why no deliveries are seen, or empty.
        renamed: the PUT of the active goal's pose under another id.
        conflicts: PUTs of another goal under the active goal's id.
        during: each request while a goal was active.
        stands: exchanges after which a robot with a goal stood still as long as requests were refused; and how often.
        drives: whether it was seen to drive meanwhile.
        cancelled: GET of the goal after it was cancelled, and its id.
    """

    rests: tuple[Case, ...] = ()
    ordered: tuple[Ordered, ...] = ()
    unseen: str = ""
    renamed: Put | None = None
    conflicts: tuple[Put, ...] = ()
    during: tuple[DuringGoal, ...] = ()
    stands: tuple[Exchange, ...] = ()
    drives: bool = False
    cancelled: tuple[Exchange, str] | None = None


@scenario(needs={Need.REST, Need.MOTION}, stage=Stage.LATE)
def refused_again(
    api: RestInterface,
    robot: Robot,
    soap: SoapServices,
    probe: RosProbe,
    refused: RefusedRequests,
    senders: list[DeliverySender],
) -> RefusedAgain:
    """Send the run's refused requests again: at rest, between deliveries, and during a goal."""
    player = _Player(api, robot, soap, refused)
    try:
        send_known(robot, soap, refused)
        player.elsewhere()
        observer = player.observer(probe, senders)
        player.rest()
        # Deliveries are read after the drive, because reading takes a while and nothing sent here may be one.
        if observer is None:
            player.drive()
        else:
            with player.ordering(observer):
                player.drive()
    except NoOccasionError:
        return player.trace
    except Exception as error:
        raise PartialTraceError(player.trace) from error
    return player.trace


@dataclass
class _Player:
    """One play of the scenario."""

    api: RestInterface
    robot: Robot
    soap: SoapServices
    refused: RefusedRequests
    trace: RefusedAgain = RefusedAgain()

    def _choose(self) -> list[Refused]:
        return self.refused.choose(self.soap.there.values(), self.api.run.effort)

    def _send(self, one: Refused) -> Exchange:
        """Send a request again; one that the robot takes now, rightly for all that is known, is not sent any more."""
        exchange = one.send()
        if one.acts and not is_refused(exchange) and not self._is_wrong(one):
            self.refused.drop(one)
        return exchange

    def _is_wrong(self, one: Refused) -> bool:
        """Return whether the contract does not allow a request, in whatever state the robot is."""
        if one.client is not self.robot.rest:
            return False
        request, run = one.request, self.api.run
        said = validity(run.contract, request.method, one.path, request.media_type, request.body)
        if said.verdict != VALID or request.method != "PUT" or one.path != GOAL_PATH:
            return said.verdict == INVALID
        target: Any = read_json(request.body).value["goal"]["target_pose"]
        off = abs(length_of(target["pose"]["orientation"]) - 1) > _NO_UNIT
        return off or target["header"]["frame_id"] == NO_FRAME

    def elsewhere(self) -> None:
        """Send a valid goal with methods and to a path that the robot must refuse, so that it is sent again later."""
        (near,) = choose_goals(self.robot, 1.0, 1)
        body = body_of(goal_body(near, self.robot.statement.motion.frame, "not to be followed"))
        for method, path in elsewhere(self.robot, GOAL_PATH):
            self.robot.rest.send(method, path, headers=(("Content-Type", JSON),), body=body, fresh=True)

    def rest(self) -> None:
        """Send the requests at rest, and read the robot; if it moves or gets a goal, send them one by one."""
        chosen = self._choose()
        rests: tuple[Case, ...] = (self._rest(chosen),) if chosen else ()
        if not all(rest.holds for rest in rests):
            # Another client may have moved the robot, so try it alone.
            rests = tuple(self._alone(chosen)) or (self._rest(chosen),)
        self.trace = replace(self.trace, rests=rests)

    def _rest(self, chosen: list[Refused]) -> Case:
        """Send the requests at rest, and read the robot."""
        bring_to_rest(self.api)
        exchanges = [self._send(refusal) for refusal in chosen]
        pairs = zip(chosen, exchanges, strict=True)
        if any(one.acts and exchange.response.ok and not self._is_wrong(one) for one, exchange in pairs):
            bring_to_rest(self.api)
        return self._read(_AFTER)

    def _read(self, after: str) -> Case:
        """Read whether the robot is at rest, without a goal."""
        drive = Drive(self.robot)
        still, seen = drive.sees(STILL)
        if still is False:
            return Case(still, drive.trace.turns[-1].velocity_exchange, f"rest after {after}", seen, "moves")
        goal, exchange = self.robot.goal()
        return Case(goal is None, exchange, f"rest after {after}", "" if goal is None else GOAL, "moves")

    def _alone(self, chosen: list[Refused]) -> Iterator[Case]:
        """Send each request that would act with a look of its own; yield the readings that show an effect."""
        for refusal in chosen:
            if refusal.acts:
                bring_to_rest(self.api)
                exchange = self._send(refusal)
                seen = self._read(refusal.what)
                if not seen.holds and (is_refused(exchange) or self._is_wrong(refusal)):
                    yield replace(seen, exchange=exchange, cause=refusal.what)

    def observer(self, probe: RosProbe, senders: list[DeliverySender]) -> DeliveryObserver | None:
        """Return an observer of deliveries from now on, or None."""
        try:
            for sender in senders:
                sender.watch(0.0)  # messages so far belong to the batches
            observer = senders[0].observer if senders else observer_of(self.api, probe)
            if not senders:
                observer.mark()
        except (NoObserverError, ProbeError) as error:
            self.trace = replace(self.trace, unseen=str(error))
            return None
        return observer

    @contextmanager
    def ordering(self, observer: DeliveryObserver) -> Iterator[None]:
        """Send the requests, and a valid delivery over each interface directly after; again if more have arrived."""
        clock = self.robot.clock
        for turn in range(_TWICE):
            if turn:
                observer.mark()
            chosen = [refusal for refusal in self._choose() if refusal.acts]
            last = [self._send(refusal) for refusal in chosen][-1:]
            orders = list(self._orders(10_000 * (turn + 1), chosen)) if chosen else []
            until = clock.now() + QUIET_S
            try:
                if turn == 0:
                    yield
            finally:
                left_s = max(0.0, until - clock.now())
                found = self._take_arrivals(observer, orders, last[0], left_s) if orders else ()
            if not found:
                return

    def _take_arrivals(
        self, observer: DeliveryObserver, orders: list[tuple[Delivery, Exchange]], last: Exchange, left_s: float
    ) -> tuple[Delivery, ...]:
        """Record the deliveries after the last refused request; return those that no accepted request ordered."""
        accepted = tuple((delivery, exchange) for delivery, exchange in orders if exchange.response.ok)
        try:
            seen = tuple(sighting.delivery for sighting in observer.collect(len(accepted), left_s))
        except (NoObserverError, ProbeError) as error:
            self.trace = replace(self.trace, unseen=str(error))
            return ()
        left = Counter(key_of(delivery, exact=observer.exact) for delivery, _ in accepted)
        unknown = []
        for delivery in seen:
            key = key_of(delivery, exact=observer.exact)
            unknown += [] if left[key] else [delivery]
            left[key] -= left[key] > 0
        ordered = Ordered(accepted, seen, tuple(unknown), last, observer.exact)
        self.trace = replace(self.trace, ordered=(*self.trace.ordered, ordered))
        return ordered.unknown

    def _orders(self, first: int, chosen: list[Refused]) -> Iterator[tuple[Delivery, Exchange]]:
        """Send deliveries over each interface, each directly after a refused request on either interface."""
        here = [refusal for refusal in chosen if refusal.client is self.robot.rest] or chosen
        there = [refusal for refusal in chosen if refusal.client is not self.robot.rest] or chosen
        delivery = _of(COURIER, -first)
        for number, before in enumerate((here[0], there[0])):
            before.send()
            one = delivery._replace(depot_x=delivery.depot_x - 0.5 - number)
            yield one, put_delivery(self.api, one.rest_path, fresh=True)
        publishers = self.soap.publishers
        for number, (before, coffee) in enumerate(((there[0], False), (here[0], True)) if publishers else ()):
            before.send()
            one = _of(COFFEE if coffee else COURIER, -first - 100 * (number + 1))
            if publishers is not None:
                yield one, send_delivery(publishers, one, coffee=coffee)

    def drive(self) -> None:
        """Send the requests while a goal is active, and read the goal after each."""
        robot, frame = self.robot, self.robot.statement.motion.frame
        pose, other = choose_goals(robot, 1.5, 2)
        put = put_new(robot, goal_body(pose, frame, "refused again"), pose)
        if put.exchange.response.status not in NEW or put.differs:
            return  # another check judges that a valid goal is followed
        active = goal_body(pose, frame, "the same pose, another goal")
        renamed = put_new(robot, active, pose)
        self.trace = replace(self.trace, renamed=renamed)
        if renamed.shown is None or renamed.differs:
            return
        self._contradict(active, pose, other)
        for turn in range(_TWICE):
            stood = self._refuse(active, pose)
            if stood is None:
                break
            self.trace = replace(self.trace, stands=(*self.trace.stands, stood))
            if turn + 1 < _TWICE:
                put_goal(robot, active)
                await_goal(robot, active)
        if not (self._refused_cancel(active, pose) or robot.delete_goal()).response.ok or is_there(robot, pose):
            return
        self.trace = replace(self.trace, cancelled=(await_none(robot), active["goal_id"]["id"]))
        for _ in range(_TWICE):
            robot.rest.send("HEAD", GOAL_PATH)
        robot.goal()

    def _contradict(self, active: dict[str, Any], pose: Pose, other: Pose) -> None:
        """PUT another pose, and another heading, under the active goal's id, as JSON and as XML."""
        robot, frame, id_ = self.robot, self.robot.statement.motion.frame, active["goal_id"]["id"]
        turned = pose._replace(yaw=pose.yaw + _OTHER_RAD)
        against = [goal_body(one, frame, id_) for one in (other, *([turned] if robot.can_move(5) else []))]
        for body in against:
            for xml in (False, True):
                exchange = put_as_xml(robot, GOAL_PATH, body) if xml else put_goal(robot, body)
                goal, read = robot.goal()
                if exchange is None or exchange.response.status == HTTPStatus.UNSUPPORTED_MEDIA_TYPE:
                    continue
                if goal is None and is_there(robot, pose):
                    return
                differs = read.came if goal is None else difference(goal, active)
                put = Put(exchange, body, goal, read, differs, ended=False)
                self.trace = replace(self.trace, conflicts=(*self.trace.conflicts, put))
                if differs:
                    put_goal(robot, active)

    def _refuse(self, active: dict[str, Any], pose: Pose) -> Exchange | None:
        """Send the requests during a goal, until it changes or ends by itself.

        Return the last exchange if the robot stood still as long as requests were refused, and drives when they are
        not; None otherwise.
        """
        robot, chosen = self.robot, self._choose()
        await_motion(robot)
        start, began, last = robot.odometry(), robot.clock.now(), None
        for number in range(1, 1 + len(chosen)):
            last = self._send_during(chosen[max(0, number - _AGAIN) : number], active, pose)
            if last is None:
                return None
        while last is not None:
            end, took = robot.odometry(), robot.clock.now() - began
            if start is None or end is None or is_there(robot, pose):
                return None
            if _has_moved(start.pose, end.pose):
                self.trace = replace(self.trace, drives=True)
                return None
            if took > robot.settle_s:
                robot.clock.sleep(took)
                later = robot.odometry()
                # A robot that still stands may be blocked.
                return last if later is not None and _has_moved(end.pose, later.pose) else None
            for refusal in chosen:
                refusal.send()
        return None

    def _send_during(self, sent: list[Refused], active: dict[str, Any], pose: Pose) -> Exchange | None:
        """Send requests during a goal, and read the goal; return None if the goal ended by itself or was lost."""
        robot, one = self.robot, sent[-1]
        exchange = self._send(one)
        goal, _ = robot.goal()
        if goal is None and (
            is_there(robot, pose)
            or not ends(robot, active, lambda: [again.send() for again in (sent * _AGAIN)[-_AGAIN:]])
        ):
            return None
        differs = "none" if goal is None else difference(goal, active)
        if is_refused(exchange) or self._is_wrong(one):
            invalid = DuringGoal(one.what, exchange, differs)
            self.trace = replace(self.trace, during=(*self.trace.during, invalid))
            if differs:
                return None
        elif differs:
            put_goal(robot, active)
            await_goal(robot, active)
        return exchange

    def _refused_cancel(self, active: dict[str, Any], pose: Pose) -> Exchange | None:
        """Cancel the goal with an Accept header that excludes all formats: a robot that refuses that keeps the goal.

        Return the exchange if the robot has cancelled the goal; else None.
        """
        robot = self.robot
        cancel = partial(robot.delete_goal, ("Accept", "image/png"))
        exchange = cancel()
        if exchange.response.status == HTTPStatus.NOT_ACCEPTABLE:
            goal, _ = robot.goal()
            if goal is not None or not (is_there(robot, pose) or not ends(robot, active, cancel)):
                differs = "none" if goal is None else difference(goal, active)
                one = DuringGoal("Accept: image/png", exchange, differs)
                self.trace = replace(self.trace, during=(*self.trace.during, one))
        return exchange if exchange.response.ok else None


def ends(robot: Robot, active: dict[str, Any], act: Callable[[], object]) -> bool:
    """Return whether an action ends the goal, by comparing with a goal of the same kind without the action."""
    put_goal(robot, active)
    began = robot.clock.now()
    act()
    ended = robot.goal()[0] is None
    took = robot.clock.now() - began
    put_goal(robot, active)
    return ended and all(robot.goal()[0] is not None for _ in poll_for(robot.clock, 0.0, 2 * took))


def _has_moved(one: Pose, other: Pose) -> bool:
    return one.distance(other) > _STOOD_M or abs(wrapped(one.yaw - other.yaw)) > _STOOD_RAD

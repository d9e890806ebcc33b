"""The ROS end that the gateways in Python share: the last message of topics, publishers, services, actions, the graph.

Nothing here waits: what takes time returns a future, which each gateway awaits in its own style.
"""

import argparse
import importlib
import json
import threading
import time
import uuid
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import rclpy
from action_msgs.msg import GoalStatus
from messages import Forms, RefusedError, interface
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, ShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from surface import ACTION, DEADLINE_S, PUBLISHES, READS, SERVICES, STYLES, End

_LOOK_S = 0.1
_DEPTH = 100
# So many messages within a second are a crowd, and so many calls at once: more than any but a crowd sends. A busy
# machine hardly brings about more of these at one moment.
_MANY, _WAITING = 17, 9


@dataclass
class Goal:
    """A goal and what has become of it: `status` as GoalStatus has it."""

    faults: frozenset[str] = frozenset()
    handle: Any = None
    status: int = GoalStatus.STATUS_EXECUTING
    feedback: list[Any] = field(default_factory=list)
    result: Any = None
    reads: int = 0

    def latest(self) -> Any:
        """Return the last feedback, or None."""
        if not self.feedback:
            return None
        self.reads += 1
        if "feedback goes back" in self.faults and self.reads % 2:
            return self.feedback[-2:][0]
        return self.feedback[0 if "first feedback for ever" in self.faults else -1]


@dataclass
class _Heard:
    kind: type
    callback: Callable[[Any], None] | None
    subscription: Any = None
    quality: tuple[ReliabilityPolicy, DurabilityPolicy] | None = None
    is_deaf: bool = False


class RosEnd:
    """A node with all that a gateway does on the graph.

    Args:
        domain_id: the ROS domain.
        forms: how JSON writes messages.
        faults: what is done wrong.
    """

    def __init__(self, domain_id: int, forms: Forms, faults: frozenset[str] = frozenset()) -> None:
        self.faults, self.forms = faults, replace(forms, faults=faults)
        self.deadline_s = DEADLINE_S
        self.goals: dict[str, Goal] = {}
        self._before: dict[str, Any] = {}
        self._parameters: dict[tuple[str, str], Any] = {}
        self._reads, self._sent, self._called, self._refused = 0, 0, 0.0, False
        self._result: Any = None
        self._published: Any = None
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node("gateway", context=self._context, start_parameter_services=False, enable_rosout=False)
        self._heard: dict[str, list[_Heard]] = {}
        self._last: dict[str, tuple[Any, float]] = {}
        self._ends: dict[str, Any] = {}
        self._held: list[Any] = []
        self._waiting, self._recent = 0, deque(maxlen=_MANY)
        self._topics: dict[str, str] = {}
        self._creating = threading.Lock()
        self.node.create_timer(_LOOK_S, self._look)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        threading.Thread(target=self._spin, daemon=True).start()

    def prepare(self, *, keep: bool) -> None:
        """Create all ends early, as ROS takes a moment to find what is at the others; keep the last messages."""
        for end in PUBLISHES:
            self.publisher(end)
        for end in SERVICES:
            self.client(end)
        self.action_client(ACTION)
        for end in READS if keep else ():
            self.subscribe(end.ros, end.type, partial(self._came, end.ros))

    def read(self, value: Any, kind: type, end: End) -> Any:
        """Return the message, request or goal that JSON names.

        Raises:
            RefusedError: it names none.
        """
        try:
            return self.forms.read(value, kind)
        except RefusedError:
            self._refused = True
            if "invalid published" in self.faults and "/msg/" in end.type:
                self.publish(end, kind())
            if "invalid as default" in self.faults:
                return kind()
            raise

    def subscribe(self, topic: str, kind: str, callback: Callable[[Any], None]) -> Callable[[], None]:
        """Call `callback` with each message; return what ends that."""
        heard = _Heard(interface(kind), callback)
        self._connect(topic, heard)
        self._heard.setdefault(topic, []).append(heard)

        def end() -> None:
            if "subscriptions of streams left" in self.faults:
                return
            heard.callback = None  # the executor may be waiting for it: its own thread destroys it

        return end

    def stream(self, end: End, send: Callable[[str], None], throttle_s: float = 0.0) -> Callable[[], None]:
        """Send the JSON of each message of a topic, and none sooner than so long after another; return what ends it."""
        held: list[str] = []
        next_s = 0.0

        def came(message: Any) -> None:
            nonlocal next_s
            now = time.monotonic()
            if now < next_s and "stream throttle ignored" not in self.faults:
                return
            next_s = now + throttle_s
            held.append(json.dumps(self.forms.write(message), ensure_ascii=False))
            if "stream drops" in self.faults and len(held) % 4 == 0:
                return
            if "stream reorders" in self.faults and end.name == "scan":
                if len(held) % 2 == 0:
                    send(held[-1])
                    send(held[-2])
                return
            send(held[-1])
            if "stream doubles" in self.faults and len(held) % 4 == 0:
                send(held[-1])

        return self.subscribe(end.ros, end.type, came)

    def last(self, end: End) -> Any:
        """Return the last message of a topic; None without one, or if it is too old."""
        topic, kind, max_age_s = end.ros, end.type, end.max_age_s
        message, at = self._last.get(topic, (None, 0.0))
        while "calls hold up reads" in self.faults and self._waiting and time.monotonic() - self._called < DEADLINE_S:
            time.sleep(_LOOK_S)
        while "deadlock" in self.faults and self._waiting:
            time.sleep(_LOOK_S)
        if "subscriptions left" in self.faults:
            self.node.create_subscription(interface(kind), topic, lambda _: None, 1)
        if message is None:
            return interface(kind)() if "empty at first" in self.faults else None
        if max_age_s is not None and time.monotonic() - at > max_age_s:
            return message if "stale" in self.faults else None
        if "goes back" in self.faults:
            self._reads += 1
            return self._before[topic] if self._reads % 3 == 0 else message
        return message

    def publisher(self, end: End) -> Any:
        """Return the publisher of a topic."""
        return self._end(end.ros, lambda: self.node.create_publisher(interface(end.type), end.ros, _DEPTH))

    def publish(self, end: End, message: Any) -> None:
        """Publish a message."""
        publisher = self.publisher(end)
        with self._creating:
            is_equal = self._published == (end.ros, message)
            self._published = end.ros, message
            if is_equal and "equal dropped" in self.faults:
                return
            if "reordered" in self.faults:
                self._held.append(message)
                if len(self._held) == 2:
                    publisher.publish(self._held.pop())
                    publisher.publish(self._held.pop())
                elif len(self._held) == 1:
                    threading.Timer(0.3, self._late, [publisher, message]).start()
                return
            self._recent.append(time.monotonic())
            is_crowd = len(self._recent) == _MANY and self._recent[-1] - self._recent[0] < 1
            if is_crowd and "reordered in a crowd" in self.faults:
                threading.Timer(0.3 * (len(self._held) % 2), publisher.publish, [message]).start()
                self._held.append(message)
                return
            for _ in range(self._copies(end, is_crowd=is_crowd)):
                publisher.publish(message)
            if "publishers left" in self.faults:
                self.node.create_publisher(interface(end.type), end.ros, 1)

    def _copies(self, end: End, *, is_crowd: bool) -> int:
        """Return how often a message is published."""
        was_refused, self._refused = self._refused, False
        self._sent += end.name == "say"
        is_dropped = "message dropped" in self.faults and end.name == "say" and self._sent % 3 == 0
        is_dropped |= "message dropped in a crowd" in self.faults and is_crowd
        is_dropped |= "lost after a refusal" in self.faults and was_refused
        is_doubled = "doubled after a refusal" in self.faults and was_refused
        return 0 if is_dropped else 1 + ("message doubled" in self.faults or is_doubled)

    def client(self, end: End) -> Any:
        """Return the client of a service."""
        return self._end(end.ros, lambda: self.node.create_client(interface(end.type), end.ros))

    def action_client(self, end: End) -> Any:
        """Return the client of an action."""
        return self._end(end.ros, lambda: ActionClient(self.node, interface(end.type), end.ros))

    def call(self, end: End, request: Any) -> Future | None:
        """Call a service; return the future of its response, or None if there is none."""
        client, empty, future = self.client(end), interface(end.type).Response, Future()
        if "clients left" in self.faults:
            self.node.create_client(interface(end.type), end.ros)
        if not client.service_is_ready():
            if "absent service as success" not in self.faults:
                return None
            future.set_result(empty())
            return future
        self._waiting, self._called = self._waiting + 1, time.monotonic()
        was_refused, self._refused = self._refused, False
        if "call doubled" in self.faults or ("doubled after a refusal" in self.faults and was_refused):
            client.call_async(request)
        _passed_on(client.call_async(request), future, lambda response: self._served(end.ros, response))
        if "call repeated" in self.faults:
            threading.Timer(0.6, lambda: future.done() or client.call_async(request)).start()
        if "silence as success" in self.faults:
            threading.Timer(0.8 * DEADLINE_S, lambda: future.done() or future.set_result(empty())).start()
        return future

    def get_parameter(self, end: End) -> Future | None:
        """Return the future of a parameter's value as JSON; None without its node."""
        called = self._parameter_call(end, "Get", names=[end.name])
        read: Future = Future()
        if called is not None:
            _passed_on(called, read, lambda response: self._parameter_in(end, response))
        return called and read

    def set_parameter(self, end: End, value: Any) -> Future | None:
        """Return the future of whether a node takes a value; None without the node.

        Raises:
            RefusedError: it is no value of the parameter's type.
        """
        kind = interface("rcl_interfaces/msg/ParameterValue")
        number = getattr(interface("rcl_interfaces/msg/ParameterType"), f"PARAMETER_{end.type.upper()}")
        made = replace(self.forms, required=False).read({f"{end.type}_value": value}, kind)
        made.type = number
        own = interface("rcl_interfaces/msg/Parameter")(name=end.name, value=made)
        for _ in range("parameter set twice" in self.faults):
            self._parameter_call(end, "Set", parameters=[own])
        called = self._parameter_call(end, "Set", parameters=[own])
        done: Future = Future()
        is_deaf = "parameter refusal ignored" in self.faults
        if called is not None:
            _passed_on(called, done, lambda response: response.results[0].successful or is_deaf)
        return called and done

    def _parameter_call(self, end: End, what: str, **request: Any) -> Future | None:
        kind = f"rcl_interfaces/srv/{what}Parameters"
        service = f"{end.ros}/{what.lower()}_parameters"
        return self.call(End("", service, kind), interface(kind).Request(**request))

    def _parameter_in(self, end: End, response: Any) -> Any:
        found = self.forms.write(response.values[0])[f"{end.type}_value"]
        if "parameters cached" in self.faults:
            found = self._parameters.setdefault((end.ros, end.name), found)
        return str(found) if "parameter as text" in self.faults else found

    def send_goal(self, end: End, request: Any) -> tuple[str, Goal, Future] | None:
        """Send a goal; return its id, it, and the future of whether it is accepted; None if there is no server."""
        client = self.action_client(end)
        if not client.server_is_ready():
            return None
        goal, accepted, name = Goal(self.faults), Future(), uuid.uuid4().hex
        self.goals[name] = goal
        was_refused, self._refused = self._refused, False
        if "goal doubled" in self.faults or ("doubled after a refusal" in self.faults and was_refused):
            client.send_goal_async(request)

        def responded(handle: Any) -> bool:
            goal.handle = handle
            if not handle.accepted:
                goal.status = GoalStatus.STATUS_UNKNOWN
                if "refused goal as accepted" in self.faults:
                    goal.status = GoalStatus.STATUS_EXECUTING
                return "refused goal as accepted" in self.faults
            handle.get_result_async().add_done_callback(lambda done: self._finished(goal, done.result()))
            return True

        def progressed(came: Any) -> None:
            goal.feedback.append(came.feedback)
            if "succeeded at once" in self.faults:
                goal.status = GoalStatus.STATUS_SUCCEEDED

        self._ask(lambda: client.send_goal_async(request, progressed), accepted, responded)
        return name, goal, accepted

    def goal(self, name: str) -> Goal | None:
        """Return a goal by its id."""
        return self.goals.get(name)

    def cancel(self, goal: Goal) -> Future:
        """Cancel a goal; return the future of whether its server does so."""
        canceled: Future = Future()
        if "cancel lost" in self.faults:
            canceled.set_result(result=True)
            return canceled
        for other in self.goals.values() if "all goals canceled" in self.faults else ():
            if other.status == GoalStatus.STATUS_EXECUTING and other.handle and other is not goal:
                other.handle.cancel_goal_async()

        def responded(response: Any) -> bool:
            is_wrong = "refused cancel as canceled" in self.faults and not response.goals_canceling
            goal.status = GoalStatus.STATUS_CANCELED if is_wrong else goal.status
            return is_wrong or bool(response.goals_canceling)

        self._ask(goal.handle.cancel_goal_async, canceled, responded)
        return canceled

    def topics(self) -> dict[str, str]:
        """Return the topics of the graph, with their types."""
        found = {name: kinds[0] for name, kinds in self.node.get_topic_names_and_types()}
        there = {name: kind for name, kind in found.items() if self._ends_of(name)}
        if "list without namespaces" in self.faults:
            return {"/" + name.rpartition("/")[2]: kind for name, kind in there.items()}
        if "list cut" in self.faults:
            return dict(list(there.items())[-25:])
        if "list has what never was" in self.faults:
            return {**there, "/ghost": "std_msgs/msg/String"}
        if "list keeps what is gone" in self.faults:
            self._topics |= there
            return self._topics
        return there

    def _ask(self, send: Callable[[], Any], target: Future, converted: Callable[[Any], Any]) -> None:
        """Send in the executor's thread: rclpy's action client loses a response that comes before it expects one."""
        self._executor.create_task(lambda: _passed_on(send(), target, converted))

    def _late(self, publisher: Any, message: Any) -> None:
        with self._creating:
            if self._held == [message]:
                publisher.publish(self._held.pop())

    def _served(self, service: str, response: Any) -> Any:
        is_crowd, self._waiting = self._waiting >= _WAITING, self._waiting - 1
        if "last response" in self.faults or (is_crowd and "last response in a crowd" in self.faults):
            response, self._last[service] = self._last.get(service, (response, 0.0))[0], (response, 0.0)
        return response

    def _finished(self, goal: Goal, done: Any) -> None:
        if "refused cancel as canceled" in self.faults and goal.status == GoalStatus.STATUS_CANCELED:
            return
        wrong = {
            ("aborted as succeeded", GoalStatus.STATUS_ABORTED): GoalStatus.STATUS_SUCCEEDED,
            ("canceled as aborted", GoalStatus.STATUS_CANCELED): GoalStatus.STATUS_ABORTED,
            ("canceled as succeeded", GoalStatus.STATUS_CANCELED): GoalStatus.STATUS_SUCCEEDED,
        }
        goal.result = type(done.result)() if "result lost" in self.faults else done.result
        if "result of another goal" in self.faults:
            goal.result, self._result = self._result or done.result, done.result
        statuses = [status for (fault, was), status in wrong.items() if fault in self.faults and was == done.status]
        goal.status = statuses[0] if statuses else done.status

    def _came(self, topic: str, message: Any) -> None:
        if "first message for ever" in self.faults and topic in self._last:
            message = self._last[topic][0]
        if "messages mixed" in self.faults:
            topics = [name for name, heard in self._heard.items() if heard[0].kind is type(message)]
            for name in topics:
                self._last[name] = message, time.monotonic()
        goes_back = "goes back" in self.faults and topic in self._last and message != self._last[topic][0]
        self._before[topic] = self._last[topic][0] if goes_back else message
        self._last[topic] = message, time.monotonic()

    def _look(self) -> None:
        for topic, all_heard in list(self._heard.items()):
            for heard in list(all_heard):
                if heard.callback is None:
                    all_heard.remove(heard)
                    self.node.destroy_subscription(heard.subscription)
                else:
                    self._connect(topic, heard)

    def _connect(self, topic: str, heard: _Heard) -> None:
        """Subscribe with the reliability and durability of the topic's publishers."""
        found = [one.qos_profile for one in self.node.get_publishers_info_by_topic(topic)]
        reliable = all(one.reliability == ReliabilityPolicy.RELIABLE for one in found)
        latched = (
            "volatile only" not in self.faults
            and bool(found)
            and all(one.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in found)
        )
        quality = (
            ReliabilityPolicy.RELIABLE if reliable or "reliable only" in self.faults else ReliabilityPolicy.BEST_EFFORT,
            DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )
        if "deaf after a publisher" in self.faults and heard.quality and not found and topic in self._last:
            heard.is_deaf = True
            self.node.destroy_subscription(heard.subscription)
        kinds = {one.topic_type for one in self.node.get_publishers_info_by_topic(topic)}
        if "deaf after another type" in self.faults and topic == "/note" and len(kinds) == 1:
            is_own = getattr(importlib.import_module("std_msgs.msg"), kinds.pop().rpartition("/")[2]) is heard.kind
            heard.is_deaf |= not is_own
            heard.callback = heard.callback if is_own else (lambda _: None)
        if heard.is_deaf or quality == heard.quality or (heard.quality and not found):
            return
        old, heard.quality = heard.subscription, quality
        profile = QoSProfile(depth=_DEPTH, reliability=quality[0], durability=quality[1])
        heard.subscription = self.node.create_subscription(
            heard.kind, topic, lambda message: heard.callback and heard.callback(message), profile
        )
        if old is not None:
            self.node.destroy_subscription(old)

    def _ends_of(self, topic: str) -> int:
        return self.node.count_publishers(topic) + self.node.count_subscribers(topic)

    def _end(self, name: str, create: Callable[[], Any]) -> Any:
        with self._creating:
            if name not in self._ends:
                self._ends[name] = create()
            return self._ends[name]

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except (ExternalShutdownException, ShutdownException):
            return


def begun(style: str) -> tuple[RosEnd, int]:
    """Return the ROS end and the port that the command line names: `PORT DOMAIN [FAULT,…]`."""
    parser = argparse.ArgumentParser()
    parser.add_argument("port", type=int)
    parser.add_argument("domain", type=int)
    parser.add_argument("faults", nargs="?", default="")
    given = parser.parse_args()
    end = RosEnd(given.domain, STYLES[style].forms, frozenset(given.faults.split(",")))
    end.prepare(keep=style != "node")
    return end, given.port


def _passed_on(source: Any, target: Future, converted: Callable[[Any], Any]) -> None:
    """Complete a future with the result of one of rclpy's, unless its time was up before."""

    def done(finished: Any) -> None:
        if target.set_running_or_notify_cancel():
            target.set_result(converted(finished.result()))

    source.add_done_callback(done)

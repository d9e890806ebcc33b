"""A ROS node that does as told: publishes, listens, serves services and actions, and lists the graph.

Each command is an object with "do"; each gets one answer. Times are of CLOCK_MONOTONIC, ns. Values are as in values.py.

- `describe` (type): the fields of a type. `complete` (type, value): the value with its defaults.
- `publish` (topic, type, values, gap_s, repeat_s, reliability, durability, apart): publish; the first time, become a
  publisher. Without values, only that. The last value is repeated every repeat_s until the next command. With
  `apart`, the publisher is a participant of its own, so that its first message is older than its readers. Answers
  `sent`: when each was handed to ROS; `subscribers`; `best_effort`: whether one of them may lose messages.
- `listen` (topic, type): subscribe, as reliably as the publishers that are there, and answer how many that are.
- `heard` (name, count, within_s): what came to a topic, service or action since the last call, each `[time, what,
  value]`; waits until so much has come.
- `serve` (service, type, script): serve. Each call takes the next item of the script, and the last one goes on:
  `{"answer": value, "delay_s": s}`, `{"never": true}`. Events: `request`, and `response` with its `request`.
- `act` (action, type, script): the same for goals: `{"reject": true}`, or `{"feedback": [values], "gap_s": s, "end":
  "succeed" | "abort" | "never", "result": value, "refuse_cancel": true, "cancel_s": s}`. Events: `goal`, `rejected`,
  `feedback`, `cancel`, `end`.
- `script` (name, script): what the served service or action does from now on.
- `hold` (node, values, refuses): be a node of this name with parameters, each `[type, value]` by name, which change at
  once; with `refuses`, others may not change them. Events of the node: `set`, with the values that somebody set.
- `held` (node): the values of its parameters.
- `parameters`: by node, the parameters of all others, each `[type, value]` by name.
- `forget` (name): leave a topic, service or action.
- `graph`: topics with types and counts, services, how many clients these have, actions and nodes.
"""

import threading
import time
from collections import defaultdict, deque
from collections.abc import Callable
from functools import partial
from typing import Any, Final

import rclpy
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.action import ActionServer, CancelResponse, GoalResponse, get_action_names_and_types
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.executors import (
    Executor,
    ExternalShutdownException,
    MultiThreadedExecutor,
    ShutdownException,
    SingleThreadedExecutor,
)
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from ros_probe.values import described, message_of, octets_of, plain, plain_parameter, type_of

# Messages that came and were not asked for yet, of one topic; then the oldest are lost, and that is said.
_KEPT: Final = 20_000
_DEPTH: Final = 5000
# Calls and goals that may wait at the same moment.
_THREADS: Final = 48
_STEP_S: Final = 0.01
_LONGEST_S: Final = 60.0
# For a node to tell its parameters, s.
_ANSWERS_S: Final = 10.0

Event = tuple[int, str, Any]


class Player:
    """A ROS node that does as told.

    Args:
        domain_id: of the graph.
        name: of the node.
    """

    def __init__(self, domain_id: int, name: str) -> None:
        self._domain_id, self._context = domain_id, _join(domain_id)
        # What is heard is dated by a thread that does nothing else; who serves may wait.
        self._node, self._name = self._made(name), name
        self._servant: Node | None = None
        self._executors: list[Executor] = []
        self._ends = threading.Event()
        self._spin(SingleThreadedExecutor(context=self._context), self._node)
        self._entities: dict[str, Any] = {}
        # Nodes of publishers that are participants of their own, by topic.
        self._apart: dict[str, Node] = {}
        self._steps: dict[str, _Steps] = {}
        self._timers: dict[str, Any] = {}
        self._nodes: dict[str, _Holder] = {}
        self._came: dict[str, deque[Event]] = defaultdict(partial(deque, maxlen=_KEPT))
        self._news = threading.Condition()
        self._commands: dict[str, Callable[..., dict[str, Any]]] = {
            "describe": lambda type: {"types": described(type)},  # noqa: A006 - the command's own word
            "complete": lambda type, value: {"value": plain(message_of(type, value))},  # noqa: A006 - as above
            "publish": self._publish,
            "listen": self._listen,
            "heard": self._heard,
            "serve": self._serve,
            "act": self._act,
            "script": self._script,
            "hold": self._hold,
            "held": lambda node: {"values": self._nodes[node].values()},
            "parameters": self._parameters,
            "forget": self._forget,
            "graph": self._graph,
        }

    def answer(self, command: dict[str, Any]) -> dict[str, Any]:
        """Carry out a command; return its answer, or {"problem": …} if it cannot be carried out."""
        what = command.pop("do", None)
        if what not in self._commands:
            return {"problem": f"not understood: {what!r}; known are {', '.join(self._commands)}"}
        try:
            return self._commands[what](**command)
        except Exception as error:  # noqa: BLE001 - whatever it is, the parent process has to be told
            return {"problem": f"{what}: {type(error).__name__}: {error}"}

    def close(self) -> None:
        """Remove the nodes from the graph."""
        self._ends.set()
        for executor in self._executors:
            executor.shutdown(timeout_sec=1)
        for topic in list(self._apart):
            self._forget(topic)
        for node in filter(None, (*(holder.node for holder in self._nodes.values()), self._servant, self._node)):
            node.destroy_node()
        self._context.try_shutdown()

    def _made(self, name: str, context: Context | None = None) -> Node:
        return Node(name, context=context or self._context, start_parameter_services=False, enable_rosout=False)

    def _spin(self, executor: Executor, node: Node) -> None:
        def spin() -> None:
            while not self._ends.is_set():
                try:
                    executor.spin()
                except (ExternalShutdownException, ShutdownException):
                    return
                except Exception:  # noqa: BLE001, S112 - a callback's: of a call whose service was destroyed meanwhile
                    continue

        executor.add_node(node)
        self._executors.append(executor)
        threading.Thread(target=spin, name="ros", daemon=True).start()

    def _server(self) -> Node:
        """Return the node that serves; its callbacks may wait."""
        if self._servant is None:
            self._servant = self._made(f"{self._name}_server")
            self._spin(MultiThreadedExecutor(_THREADS, context=self._context), self._servant)
        return self._servant

    def _hold(self, node: str, values: dict[str, tuple[str, Any]], *, refuses: bool = False) -> dict[str, Any]:
        if node not in self._nodes:
            space, _, name = node.rpartition("/")
            made = Node(name, namespace=space or "/", context=self._context, enable_rosout=False)
            self._nodes[node] = _Holder(made, partial(self._note, node))
            self._server()
            self._executors[-1].add_node(made)
        self._nodes[node].hold(values, refuses=refuses)
        return {}

    def _parameters(self) -> dict[str, Any]:
        found: dict[str, dict[str, Any]] = {}
        graph = self._graph()
        for node in (one for one in graph["nodes"] if f"{one}/list_parameters" in graph["services"]):
            listed = self._ask(ListParameters, f"{node}/list_parameters", ListParameters.Request())
            names = listed.result.names if listed else []
            values = names and self._ask(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=names))
            for name, value in zip(names, values.values if values else (), strict=False):
                kind = Parameter.Type(value.type).name.lower()
                own = plain_parameter(kind, parameter_value_to_python(value))
                found.setdefault(node, {})[name] = [kind, own]
        return {"nodes": found}

    def _ask(self, kind: Any, service: str, request: Any) -> Any:
        """Return the response of a service; None: it does not respond in time."""
        client, came = self._node.create_client(kind, service), threading.Event()
        try:
            if not client.wait_for_service(_ANSWERS_S):
                return None
            future = client.call_async(request)
            future.add_done_callback(lambda _: came.set())
            return future.result() if came.wait(_ANSWERS_S) else None
        finally:
            self._node.destroy_client(client)

    def _note(self, name: str, what: str, value: Any, at_ns: int | None = None) -> None:
        with self._news:
            self._came[name].append((at_ns or time.monotonic_ns(), what, value))
            self._news.notify_all()

    def _publish(
        self,
        topic: str,
        type: str,  # noqa: A002 - the command's own word
        values: list[dict[str, Any]] = [],  # noqa: B006 - is only read
        gap_s: float = 0.0,
        repeat_s: float = 0.0,
        reliability: str = "reliable",
        durability: str = "volatile",
        depth: int = 100,
        *,
        apart: bool = False,
    ) -> dict[str, Any]:
        messages = [message_of(type, value) for value in values]
        key = f"publish {topic}"
        if key not in self._entities:
            qos = QoSProfile(
                depth=depth,
                reliability=ReliabilityPolicy[reliability.upper()],
                durability=DurabilityPolicy[durability.upper()],
            )
            if apart:
                self._apart[topic] = self._made(f"{self._name}_apart", _join(self._domain_id))
            self._entities[key] = self._apart.get(topic, self._node).create_publisher(type_of(type), topic, qos)
        publisher, sent = self._entities[key], []
        self._stop_repeating(topic)
        for number, message in enumerate(messages):
            if number and gap_s:
                time.sleep(gap_s)
            sent.append(time.monotonic_ns())
            publisher.publish(message)
        if messages and repeat_s:
            self._timers[topic] = self._node.create_timer(repeat_s, partial(publisher.publish, messages[-1]))
        there = self._node.get_subscriptions_info_by_topic(topic)
        best_effort = any(item.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT for item in there)
        return {"sent": sent, "subscribers": publisher.get_subscription_count(), "best_effort": best_effort}

    def _listen(self, topic: str, type: str) -> dict[str, Any]:  # noqa: A002 - as above
        publishers = self._node.get_publishers_info_by_topic(topic)
        best_effort = any(
            publisher.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT for publisher in publishers
        )
        reliability = ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE

        def came(message: Any) -> None:
            at_ns = time.monotonic_ns()
            self._note(topic, "message", plain(message), at_ns)

        if topic not in self._entities:
            qos = QoSProfile(depth=_DEPTH, reliability=reliability)
            self._entities[topic] = self._node.create_subscription(type_of(type), topic, came, qos)
        return {"publishers": self._node.count_publishers(topic), "best_effort": best_effort}

    def _heard(self, name: str, count: int = 0, within_s: float = 0.0) -> dict[str, Any]:
        events = self._came[name]
        with self._news:
            self._news.wait_for(lambda: len(events) >= count, min(within_s, _LONGEST_S))
            return {"events": [events.popleft() for _ in range(len(events))]}

    def _serve(self, service: str, type: str, script: list[dict[str, Any]]) -> dict[str, Any]:  # noqa: A002 - as above
        self._forget(service)
        # Made from each step before it is taken, so that a value of another type is the command's problem.
        steps = self._steps[service] = _Steps(
            script, lambda step: step | {"made": message_of(f"{type}#Response", step.get("answer", {}))}
        )

        def called(request: Any, _: Any) -> Any:
            step = steps.next()
            self._note(service, "request", plain(request))
            self._ends.wait(None if step.get("never") else step.get("delay_s", 0.0))
            self._note(service, "response", {"request": plain(request), "response": plain(step["made"])})
            return step["made"]

        self._entities[service] = self._server().create_service(
            type_of(type), service, called, callback_group=ReentrantCallbackGroup()
        )
        return {}

    def _act(self, action: str, type: str, script: list[dict[str, Any]]) -> dict[str, Any]:  # noqa: A002 - as above
        self._forget(action)
        steps = self._steps[action] = _Steps(script)
        played = _Goals(partial(self._note, action), type, steps, self._ends)
        self._entities[action] = ActionServer(
            self._server(),
            type_of(type),
            action,
            played.execute,
            goal_callback=played.decide,
            cancel_callback=played.cancel,
            callback_group=ReentrantCallbackGroup(),
        )
        return {}

    def _stop_repeating(self, topic: str) -> None:
        if topic in self._timers:
            timer = self._timers.pop(topic)
            timer.cancel()
            self._node.destroy_timer(timer)

    def _script(self, name: str, script: list[dict[str, Any]]) -> dict[str, Any]:
        self._steps[name].replace(script)
        return {}

    def _forget(self, name: str) -> dict[str, Any]:
        self._stop_repeating(name)
        if (holder := self._nodes.pop(name, None)) is not None:
            self._executors[-1].remove_node(holder.node)
            holder.node.destroy_node()
        if (apart := self._apart.pop(name, None)) is not None:
            del self._entities[f"publish {name}"]
            apart.destroy_node()
            apart.context.try_shutdown()
        found = [self._entities.pop(key) for key in (name, f"publish {name}") if key in self._entities]
        for item in found:
            # In rclpy, each entity has its own way out; an action server is one of several entities.
            if isinstance(item, ActionServer):
                item.destroy()
            else:
                destroy = {"Publisher": "destroy_publisher", "Subscription": "destroy_subscription"}
                node = self._servant if item.__class__.__name__ == "Service" else self._node
                getattr(node, destroy.get(item.__class__.__name__, "destroy_service"))(item)
        return {"forgotten": len(found)}

    def _graph(self) -> dict[str, Any]:
        node = self._node
        topics = {
            name: {
                "types": types,
                "publishers": node.count_publishers(name),
                "subscribers": node.count_subscribers(name),
            }
            for name, types in node.get_topic_names_and_types()
        }
        own = {f"/{self._name}{part}" for part in ("", "_server", "_apart")}
        nodes = [f"{space.rstrip('/')}/{name}" for name, space in node.get_node_names_and_namespaces()]
        return {
            "topics": topics,
            "services": dict(node.get_service_names_and_types()),
            "clients": {name: node.count_clients(name) for name, _ in node.get_service_names_and_types()},
            "actions": dict(get_action_names_and_types(node)),
            "nodes": [name for name in nodes if name not in own],
        }


def _join(domain_id: int) -> Context:
    """Return a new context, whose nodes are a participant of their own."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain_id, signal_handler_options=SignalHandlerOptions.NO)
    return context


class _Steps:
    """A script: each call takes the next step, and the last one goes on.

    Args:
        script: the steps.
        prepare: makes a step what `next` returns.
    """

    def __init__(
        self, script: list[dict[str, Any]], prepare: Callable[[dict[str, Any]], dict[str, Any]] = dict
    ) -> None:
        self._lock, self._prepare = threading.Lock(), prepare
        self.replace(script)

    def replace(self, script: list[dict[str, Any]]) -> None:
        """Replace the steps that are left."""
        left = deque(map(self._prepare, script or [{}]))
        with self._lock:
            self._left = left

    def next(self) -> dict[str, Any]:
        """Return the next step."""
        with self._lock:
            return self._left.popleft() if len(self._left) > 1 else self._left[0]


class _Holder:
    """A node with parameters.

    Args:
        node: the node.
        note: keeps an event.
    """

    def __init__(self, node: Node, note: Callable[[str, Any], None]) -> None:
        self.node, self._note = node, note
        self._kinds: dict[str, str] = {}
        self._refuses, self._is_own = False, False
        node.add_on_set_parameters_callback(self._decide)

    def hold(self, values: dict[str, tuple[str, Any]], *, refuses: bool) -> None:
        """Have parameters of some types and values."""
        self._refuses, self._is_own = refuses, True
        try:
            for name, (kind, value) in values.items():
                type_ = Parameter.Type[kind.upper()]
                if not self.node.has_parameter(name):
                    self.node.declare_parameter(name, type_)
                self._kinds[name] = kind
                if isinstance(value, dict):
                    value = octets_of(value)  # noqa: PLW2901 - as ROS has it
                self.node.set_parameters([Parameter(name, type_, value)])
        finally:
            self._is_own = False

    def values(self) -> dict[str, Any]:
        """Return the values by name."""
        return {name: plain_parameter(kind, self.node.get_parameter(name).value) for name, kind in self._kinds.items()}

    def _decide(self, parameters: list[Parameter]) -> SetParametersResult:
        if not self._is_own:
            values = {item.name: plain_parameter(item.type_.name.lower(), item.value) for item in parameters}
            self._note("set", values)
        return SetParametersResult(successful=self._is_own or not self._refuses, reason="it was told to refuse")


class _Goals:
    """What an action server does with goals.

    Args:
        note: keeps an event.
        kind: the action's type.
        steps: a step for each goal.
        ends: is set when the node ends.
    """

    def __init__(self, note: Callable[..., None], kind: str, steps: _Steps, ends: threading.Event) -> None:
        self._note, self._kind, self._steps, self._ends = note, kind, steps, ends
        self._accepted: deque[dict[str, Any]] = deque()
        self._by_goal: dict[bytes, dict[str, Any]] = {}
        self._lock = threading.Lock()

    def decide(self, goal: Any) -> Any:
        """Accept or reject a goal."""
        step = self._steps.next()
        self._note("rejected" if step.get("reject") else "goal", plain(goal))
        if step.get("reject"):
            return GoalResponse.REJECT
        with self._lock:
            self._accepted.append(step)
        return GoalResponse.ACCEPT

    def cancel(self, goal: Any) -> Any:
        """Accept or refuse to cancel a goal."""
        step = self._by_goal.get(bytes(goal.goal_id.uuid), {})
        refused = step.get("refuse_cancel", False)
        self._note("cancel", {"id": bytes(goal.goal_id.uuid).hex(), "accepted": not refused})
        return CancelResponse.REJECT if refused else CancelResponse.ACCEPT

    def execute(self, goal: Any) -> Any:
        """Carry out a goal as its step says; return the result."""
        id_ = bytes(goal.goal_id.uuid)
        with self._lock:
            step = self._by_goal[id_] = self._accepted.popleft()
        for value in step.get("feedback", []):
            if self._is_over(goal, step.get("gap_s", 0.0)):
                break
            goal.publish_feedback(message_of(f"{self._kind}#Feedback", value))
            self._note("feedback", {"id": id_.hex(), "value": value})
        while step.get("end") == "never" and not self._is_over(goal, _STEP_S):
            pass
        if not goal.is_cancel_requested:
            self._is_over(goal, step.get("gap_s", 0.0))
        end = "canceled" if goal.is_cancel_requested else step.get("end", "succeed")
        if end == "canceled":
            self._ends.wait(step.get("cancel_s", 0.0))
        # Dated before anybody can know of it.
        at_ns = time.monotonic_ns()
        {"canceled": goal.canceled, "abort": goal.abort}.get(end, goal.succeed)()
        self._note("end", {"id": id_.hex(), "end": end}, at_ns)
        return message_of(f"{self._kind}#Result", step.get("result", {}))

    def _is_over(self, goal: Any, wait_s: float) -> bool:
        """Wait; return whether the goal is to be canceled, or the node ends, before that."""
        until = time.monotonic() + wait_s
        while not (goal.is_cancel_requested or self._ends.is_set()):
            if time.monotonic() >= until:
                return False
            time.sleep(min(_STEP_S, max(0.0, until - time.monotonic())))
        return True

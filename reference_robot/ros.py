"""The ROS runtime that the simulation and the web services share: a context, nodes and executor threads.

::

    with RosRuntime(domain_id=7) as ros:
        node = ros.create_node("publishers")
        ...  # create publishers, subscriptions, timers
        ros.start()
        ...  # callbacks run in the runtime's thread until the block ends

The runtime has its own ROS context and installs no signal handlers; signals are left to the program. To hide the robot
from other machines, set ``ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST`` in the environment first. If the environment
names no Fast DDS profiles, the runtime uses those in ``fastdds.xml``.
"""

import os
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import rclpy
from rclpy.action import ActionClient, ActionServer
from rclpy.context import Context
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor, ExternalShutdownException, ShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as rclpy_c
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

try:
    from rclpy.experimental.events_executor import EventsExecutor
except ImportError:  # an early Jazzy, without the backport
    EventsExecutor = None

# Measured with 50 Hz odometry, two action servers and a dozen subscriptions in one process:
# EventsExecutor 2.2 % of a core, SingleThreadedExecutor, which builds its wait set anew for every
# message, 6 %.

# Fast DDS reads the file once per process. A file that the user has set takes precedence.
_FAST_DDS_PROFILES: Final = "FASTRTPS_DEFAULT_PROFILES_FILE"
_OUR_PROFILES: Final = Path(__file__).with_name("fastdds.xml")

_IDLE_WAKE_S: Final = 0.5
_CLOSING_S: Final = 8.0  # for the executors and their threads together
HUNG_S: Final = 2.0  # a callback takes milliseconds
_HIGHEST_DOMAIN_ID: Final = 101  # higher ones put DDS's ports into Linux's ephemeral range


class RosArgumentsError(ValueError):
    """An error in the arguments after ``--ros-args``; the message contains the arguments and ROS's explanation."""


class RosRuntime:
    """One ROS context with its nodes.

    One thread runs the callbacks of all nodes, except for nodes created with ``apart``, which have their own thread.

    Args:
        domain_id: The ROS domain, 0 to 101; None takes ROS_DOMAIN_ID from the environment.
        arguments: ROS arguments (``--ros-args ...``) for all nodes: namespace, remappings, parameters, enclave.

    Raises:
        ValueError: The domain id is out of range.
        RosArgumentsError: ROS rejects the arguments.
    """

    def __init__(self, domain_id: int | None = None, arguments: Sequence[str] = ()) -> None:
        domain = int(os.environ.get("ROS_DOMAIN_ID") or 0) if domain_id is None else domain_id
        if not 0 <= domain <= _HIGHEST_DOMAIN_ID:
            raise ValueError(f"a ROS domain id is 0 to {_HIGHEST_DOMAIN_ID}, not {domain}")
        self.domain_id = domain
        os.environ.setdefault(_FAST_DDS_PROFILES, str(_OUR_PROFILES))
        self.context = Context()
        try:
            rclpy.init(
                args=list(arguments),
                context=self.context,
                domain_id=domain,
                signal_handler_options=SignalHandlerOptions.NO,
            )
        except (rclpy_c.RCLError, rclpy_c.RCLInvalidROSArgsError, rclpy_c.UnknownROSArgsError) as error:
            raise RosArgumentsError(f"ROS does not accept {' '.join(arguments)}: {error}") from error
        self._executors = [_executor(self.context)]
        self._awake: list[float] = []  # for each thread: when its last callback or wait ended
        self._nodes: list[Node] = []
        self._threads: list[threading.Thread] = []
        self._watches: list[tuple[rclpy_c.GuardCondition, threading.Thread]] = []
        self._closing = threading.Event()

    def create_node(self, name: str, *, apart: bool = False, spun: bool = True) -> Node:
        """Return a new node, which ``close`` destroys.

        Args:
            name: The node's name.
            apart: Run the node's callbacks in a thread of its own, so that its messages do not delay other nodes.
            spun: False for a node without callbacks; ``watch`` and ``waiting_messages`` serve its subscriptions.

        Raises:
            RosArgumentsError: The ROS arguments contain a parameter that a node cannot have.
        """
        try:
            # Parameter services would appear among the robot's own services.
            node = Node(name, context=self.context, start_parameter_services=False)
        except ParameterException as error:
            raise RosArgumentsError(f"a node does not accept its parameter: {error}") from error
        self._nodes.append(node)
        if not spun:
            return node
        if apart:
            self._executors.append(_executor(self.context))
        self._executors[-1 if apart else 0].add_node(node)
        return node

    def watch(self, subscription: Subscription, node: Node, callback: Callable[[], None], pause_s: float) -> None:
        """Call ``callback`` in a node's thread whenever messages wait at a subscription of a node that is not spun.

        The first message triggers a call at once; later calls are at least ``pause_s`` seconds apart, so that each call
        can read many messages. Call this method before ``start``.
        """
        executor = next(executor for executor in self._executors if node in executor.get_nodes())
        wake = rclpy_c.GuardCondition(self.context.handle)
        arguments = (subscription, wake, partial(executor.create_task, callback), pause_s)
        self._watches.append((wake, threading.Thread(target=self._watch, args=arguments, name="ros", daemon=True)))

    def start(self) -> None:
        """Start the threads that run the callbacks; a second call does nothing."""
        if not self._threads:
            self._awake = [time.monotonic()] * len(self._executors)
            self._threads = [
                threading.Thread(target=self._spin, args=(number, executor), name="ros", daemon=True)
                for number, executor in enumerate(self._executors)
            ]
            self._threads += [thread for _, thread in self._watches]
            for thread in self._threads:
                thread.start()

    def silence(self) -> float:
        """Return for how many seconds the least active thread has been in one callback or idle; 0.5 s is normal."""
        return time.monotonic() - min(self._awake, default=time.monotonic())

    def hangs(self) -> bool:
        """Return whether a thread has been silent for over 2 s; the robot's state in memory is then out of date."""
        return self.silence() > HUNG_S

    def close(self) -> None:
        """Stop the threads and destroy the nodes and the context; a second call does nothing."""
        if self._closing.is_set():
            return
        self._closing.set()
        for wake, _ in self._watches:
            wake.trigger_guard_condition()
        # Any other order may crash the process: "terminate called without an active exception".
        give_up = time.monotonic() + _CLOSING_S
        for executor in self._executors:
            executor.shutdown(timeout_sec=max(0.0, give_up - time.monotonic()))
        for thread in self._threads:
            thread.join(max(0.0, give_up - time.monotonic()))
        for node in reversed(self._nodes):
            # destroy_node does not destroy actions; a remaining action keeps the node on the graph.
            for entity in list(node.waitables):
                if isinstance(entity, ActionClient | ActionServer):
                    entity.destroy()
            node.destroy_node()
        self.context.try_shutdown()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _spin(self, number: int, executor: Executor) -> None:
        # Not executor.spin(): outside the main thread, EventsExecutor's loop uses a whole core.
        while not self._closing.is_set() and self.context.ok():
            self._awake[number] = time.monotonic()
            try:
                executor.spin_once(timeout_sec=_IDLE_WAKE_S)
            except (ExternalShutdownException, ShutdownException):
                return
            except Exception:  # noqa: BLE001 - one node's failing callback must not stop the robot's others
                if not self._closing.is_set():
                    get_logger("ros").error(f"a callback failed:\n{traceback.format_exc()}")

    def _watch(
        self, subscription: Subscription, wake: rclpy_c.GuardCondition, notify: Callable[[], object], pause_s: float
    ) -> None:
        waiting = rclpy_c.WaitSet(1, 1, 0, 0, 0, 0, self.context.handle)
        while not self._closing.is_set() and self.context.ok():
            waiting.clear_entities()
            waiting.add_subscription(subscription.handle)
            waiting.add_guard_condition(wake)
            waiting.wait(-1)
            if waiting.is_ready("subscription", 0):
                notify()
                self._closing.wait(pause_s)


class _NoNode:
    """What an executor takes for a second node, with nothing in it and unknown to ROS."""

    subscriptions = timers = clients = services = waitables = guards = ()


def _executor(context: Context) -> Executor:
    """Return an executor that survives an exception in a callback.

    An EventsExecutor with exactly one node ends the process with a segmentation fault when a task raises (rclpy issue
    1641). Tasks are the callbacks of futures and of ``watch``. Something that is not a node makes the nodes two.
    """
    if EventsExecutor is None:
        return SingleThreadedExecutor(context=context)
    executor = EventsExecutor(context=context)
    executor.add_node(_NoNode())
    return executor


def waiting_messages(subscription: Subscription) -> Iterator[bytes]:
    """Remove and yield the serialized messages that wait at a subscription of a node that is not spun."""
    handle = subscription.handle
    with handle:
        while (found := handle.take_message(subscription.msg_type, True)) is not None:  # noqa: FBT003 - rclpy's own
            yield found[0]

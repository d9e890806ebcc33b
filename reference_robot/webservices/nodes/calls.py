"""Calls of ROS services and actions from the web server's event loop, with a deadline; and lifecycles of nodes."""

import asyncio
from collections.abc import Callable
from typing import Any, Final

from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.task import Future

from reference_robot.webservices.representation.problems import Problem, not_yet


class RosCalls:
    """A caller of ROS services and actions that waits at most ``deadline`` seconds for each response.

    A call starts in the executor's thread. rclpy's action client registers a request only after sending it, so a
    response that another thread received in between would be dropped as unexpected.
    """

    def __init__(self, executor: Executor, deadline: float) -> None:
        self._executor = executor
        self._deadline = deadline

    async def result(self, begin: Callable[[], Future], what: str) -> Any:
        """Return the ROS response to the call that ``begin`` starts in the executor's thread.

        Args:
            begin: Starts the call; returns its future.
            what: The called service or action, for the error message.

        Raises:
            Problem: 503, if there is no response within the deadline.
        """
        loop = asyncio.get_running_loop()
        answer: asyncio.Future[Any] = loop.create_future()

        def settle(outcome: Any, error: BaseException | None) -> None:
            if answer.done():
                return  # too late: the deadline has passed
            if error is not None:
                answer.set_exception(error)
            else:
                answer.set_result(outcome)

        def hand_over(outcome: Any, error: BaseException | None = None) -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(settle, outcome, error)

        def start() -> None:
            try:
                future = begin()
            except Exception as error:  # noqa: BLE001 - raised in the caller, not in the executor's thread
                hand_over(None, error)
                return
            future.add_done_callback(
                lambda done: hand_over(None, done.exception()) if done.exception() else hand_over(done.result())
            )

        self._executor.create_task(start)
        try:
            async with asyncio.timeout(self._deadline):
                return await answer
        except TimeoutError as error:
            raise not_yet(f"{what} did not respond within {self._deadline:g} s") from error


_UNMANAGED: Final = "unmanaged"
_SILENT: Final = "silent"


class ManagedNode:
    """A named ROS node that may have a lifecycle (ROS 2 design, "Managed nodes"); without one it counts as active."""

    def __init__(self, node: Node, calls: RosCalls, name: str) -> None:
        self._calls = calls
        self._name = name
        self._states = node.create_client(GetState, f"{name}/get_state")

    async def state(self) -> str:
        """Return the node's state, such as "active".

        "unmanaged" means that the node has no lifecycle, "silent" that it does not respond.
        """
        if not self._states.service_is_ready():
            return _UNMANAGED
        try:
            reply = await self._calls.result(lambda: self._states.call_async(GetState.Request()), self._name)
        except Problem:
            return _SILENT
        label: str = reply.current_state.label
        return "active" if reply.current_state.id == State.PRIMARY_STATE_ACTIVE else label or "unknown"

    async def require_active(self) -> None:
        """Raise the Problem 503 if the node has a lifecycle and is not active."""
        state = await self.state()
        if state not in {"active", _UNMANAGED}:
            raise not_yet(f"the robot's {self._name} is {state}, not active")

"""Asking ROS from the web server's event loop: hand over, wait with a deadline, come back."""

import asyncio
from collections.abc import Callable
from typing import Any

from rclpy.executors import Executor
from rclpy.task import Future

from reference_robot.webservices.representation.problems import not_yet


class RosCalls:
    """Calls services and actions for the event loop, and waits ``deadline`` seconds for an answer.

    A call begins in the executor's thread: rclpy's action client registers a request after it has sent it, so an
    answer taken meanwhile by another thread would be dropped as unexpected.
    """

    def __init__(self, executor: Executor, deadline: float) -> None:
        self._executor = executor
        self._deadline = deadline

    async def result(self, begin: Callable[[], Future], what: str) -> Any:
        """Return what ROS answers to ``begin``, which runs in the executor's thread; ``what`` is the partner's name.

        Raises:
            Problem: 503, when no answer came within the deadline.
        """
        loop = asyncio.get_running_loop()
        answer: asyncio.Future[Any] = loop.create_future()

        def settle(outcome: Any, error: BaseException | None) -> None:
            if answer.done():
                return  # too late: nobody waits any more
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
            except Exception as error:  # noqa: BLE001 - it belongs to the caller, not to the executor's thread
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
            raise not_yet(f"{what} did not answer within {self._deadline:g} s") from error

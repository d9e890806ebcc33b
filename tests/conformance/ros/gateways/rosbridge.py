"""A server of the rosbridge protocol, version 2, over WebSocket: publish, subscribe, services, actions, status.

https://github.com/RobotWebTools/rosbridge_suite/blob/ros2/ROSBRIDGE_PROTOCOL.md (3.4, 4)
"""

import asyncio
import json
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from action_msgs.msg import GoalStatus
from messages import RefusedError, interface, parsed
from ros_end import Goal, RosEnd, begun
from surface import ACTION, PUBLISHES, READS, SERVICES
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed

_WAITING = 1000


@dataclass
class _Subscription:
    """What one client hears of a topic: at most one message each `throttle_s`, the last `queue_length` kept."""

    send: Callable[[dict[str, Any]], None]
    loop: asyncio.AbstractEventLoop
    throttle_s: float
    kept: deque[dict[str, Any]]
    next_s: float = 0.0
    timer: asyncio.TimerHandle | None = None
    end: Callable[[], None] = lambda: None
    faults: frozenset[str] = frozenset()

    def came(self, message: dict[str, Any]) -> None:
        now = time.monotonic()
        if (now >= self.next_s or "stream throttle ignored" in self.faults) and not self.kept:
            self.next_s = now + self.throttle_s
            self.send(message)
        elif self.kept.maxlen:
            self.kept.append(message)
            self.timer = self.timer or self.loop.call_later(self.next_s - now, self.flush)

    def flush(self) -> None:
        self.timer, self.next_s = None, time.monotonic() + self.throttle_s
        self.send(self.kept.popleft())
        if self.kept:
            self.timer = self.loop.call_later(self.throttle_s, self.flush)


@dataclass
class _Client:
    """One connection: its subscriptions and goals, and the messages that wait to be sent."""

    ros: RosEnd
    connection: ServerConnection
    loop: asyncio.AbstractEventLoop
    sending: asyncio.Queue[dict[str, Any]] = field(default_factory=lambda: asyncio.Queue(_WAITING))
    subscriptions: dict[str, _Subscription] = field(default_factory=dict)
    goals: dict[str, tuple[Goal, Any]] = field(default_factory=dict)

    def send(self, message: dict[str, Any]) -> None:
        """Send a message, unless a slow client has too many waiting."""
        if not self.sending.full():
            self.sending.put_nowait(message)

    async def write(self) -> None:
        """Write what is to be sent."""
        while True:
            await self.connection.send(json.dumps(await self.sending.get(), allow_nan=False))

    async def listen(self) -> None:
        """Do what the client says."""
        tasks = set()
        async for text in self.connection:
            try:
                said = parsed(text)
                operation = getattr(self, f"_{said['op']}")
            except (RefusedError, TypeError, KeyError, AttributeError) as error:
                self.send({"op": "status", "level": "error", "msg": f"not understood: {error}"})
                continue
            tasks.add(task := asyncio.create_task(self._answer(operation, said)))
            task.add_done_callback(tasks.discard)

    async def _answer(self, operation: Callable[..., Any], said: dict[str, Any]) -> None:
        try:
            await operation(said)
        except (RefusedError, KeyError, TypeError) as error:
            self.send({"op": "status", "level": "error", "msg": str(error), "id": said.get("id")})

    async def _advertise(self, said: dict[str, Any]) -> None:
        interface(said["type"])

    async def _publish(self, said: dict[str, Any]) -> None:
        end = next(end for end in PUBLISHES if end.ros == said["topic"])
        self.ros.publish(end, self.ros.read(said["msg"], interface(end.type), end))
        if "id" in said:
            self.send({"op": "status", "level": "info", "msg": "published", "id": said["id"]})

    async def _subscribe(self, said: dict[str, Any]) -> None:
        topic = said["topic"]
        end = next((end for end in READS if end.ros == topic), None)
        if end is None or topic in self.subscriptions:
            raise RefusedError(f"{topic} is not served, or subscribed already")
        kept: deque[dict[str, Any]] = deque(maxlen=int(said.get("queue_length", 0)))
        heard = _Subscription(self.send, self.loop, int(said.get("throttle_rate", 0)) / 1000, kept)
        heard.faults = self.ros.faults
        self.subscriptions[topic] = heard

        def came(message: Any) -> None:
            written = {"op": "publish", "topic": topic, "msg": self.ros.forms.write(message)}
            self.loop.call_soon_threadsafe(heard.came, written)

        heard.end = self.ros.subscribe(topic, said.get("type") or end.type, came)

    async def _unsubscribe(self, said: dict[str, Any]) -> None:
        subscription = self.subscriptions.pop(said["topic"])
        if "unsubscribe ignored" not in self.ros.faults:
            subscription.end()

    async def _call_service(self, said: dict[str, Any]) -> None:
        service = said["service"]
        result: dict[str, Any] = {"op": "service_response", "service": service, "result": False}
        result |= {"id": said["id"]} if "id" in said else {}
        if "service error as success" in self.ros.faults:
            result["result"] = True
        if service == "/rosapi/topics":
            topics = self.ros.topics()
            values = {"topics": list(topics), "types": list(topics.values())}
            self.send(result | {"values": values, "result": True})
            return
        try:
            end = next(end for end in SERVICES if end.ros == service)
            request = self.ros.read(said.get("args", {}), interface(end.type).Request, end)
        except (RefusedError, StopIteration) as error:
            self.send(result | {"values": f"refused: {error}"})
            return
        called = self.ros.call(end, request)
        if called is None:
            self.send(result | {"values": f"service {service} does not exist"})
            return
        try:
            response = await asyncio.wait_for(asyncio.wrap_future(called), self.ros.deadline_s)
        except TimeoutError:
            self.send(result | {"values": f"service {service} does not answer"})
            return
        self.send(result | {"values": self.ros.forms.write(response), "result": True})

    async def _send_action_goal(self, said: dict[str, Any]) -> None:
        name, end = said["id"], ACTION
        result = {"op": "action_result", "id": name, "action": end.ros, "result": False}
        try:
            request = self.ros.read(said.get("args", {}), interface(end.type).Goal, end)
        except RefusedError as error:
            self.send(result | {"values": f"refused: {error}", "status": 0})
            return
        sent = self.ros.send_goal(end, request)
        if sent is None:
            self.send(result | {"values": f"action {end.ros} does not exist", "status": 0})
            return
        _, goal, accepted = sent
        self.goals[name] = goal, accepted
        if not await asyncio.wrap_future(accepted):
            self.send(result | {"values": "goal was rejected", "status": 0})
            return
        told = 0
        while goal.result is None or goal.status not in _ENDED:
            for one in goal.feedback[told:] if said.get("feedback") else ():
                told += 1
                values = self.ros.forms.write(one)
                self.send({"op": "action_feedback", "id": name, "action": end.ros, "values": values})
            await asyncio.sleep(0.02)
        values = self.ros.forms.write(goal.result)
        self.send(result | {"values": values, "status": goal.status, "result": True})

    async def _cancel_action_goal(self, said: dict[str, Any]) -> None:
        goal, accepted = self.goals[said["id"]]
        await asyncio.wrap_future(accepted)  # a busy server may take its time
        if not await asyncio.wrap_future(self.ros.cancel(goal)):
            raise RefusedError("the goal cannot be canceled")


_ENDED = {GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED}


async def _served(ros: RosEnd, connection: ServerConnection) -> None:
    client = _Client(ros, connection, asyncio.get_running_loop())
    writing = asyncio.create_task(client.write())
    try:
        await client.listen()
    except ConnectionClosed:
        return
    finally:
        writing.cancel()
        for goal, _ in client.goals.values():
            if goal.handle and goal.status not in _ENDED and "goals of clients that left" not in ros.faults:
                ros.cancel(goal)
        for subscription in client.subscriptions.values():
            subscription.end()


async def _main() -> None:
    ros, port = begun("node")
    async with serve(lambda connection: _served(ros, connection), "127.0.0.1", port, max_size=8_000_000):
        await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(_main())

"""A gateway on aiohttp: bare messages, states as ROS's numbers, DELETE cancels, absent topics are 503."""

import asyncio
import json
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

from action_msgs.msg import GoalStatus
from aiohttp import web
from messages import RefusedError, interface, parsed
from ros_end import Goal, begun
from surface import ACTION, PUBLISHES, READS, SERVICES, STYLES, End, openapi

ros, port = begun("aiohttp")
routes = web.RouteTableDef()
_watching: list[asyncio.Task[None]] = []
_reads, _publishes, _services = ({end.name: end for end in ends} for ends in (READS, PUBLISHES, SERVICES))


class _Problem(Exception):  # noqa: N818 - becomes a response
    def __init__(self, status: int, detail: str) -> None:
        self.status, self.detail = status, detail


@web.middleware
async def _problems(request: web.Request, handler: Callable[[web.Request], Awaitable[Any]]) -> Any:
    try:
        return await handler(request)
    except _Problem as problem:
        return web.json_response({"detail": problem.detail}, status=problem.status)
    except RefusedError as error:
        return web.json_response({"detail": str(error)}, status=422)
    except web.HTTPException as error:
        if error.status < 400:
            raise
        headers = {"Allow": error.headers["Allow"]} if "Allow" in error.headers else None
        return web.json_response({"detail": error.reason}, status=error.status, headers=headers)


async def _member(request: web.Request, name: str = "") -> Any:
    if request.content_type != "application/json":
        raise _Problem(415, "only application/json")
    body = await request.read()
    try:
        value = parsed(body)
    except RefusedError as error:
        raise _Problem(400, str(error)) from error
    if not name:
        return value
    if not isinstance(value, dict) or set(value) != {name}:
        raise _Problem(422, f"an object with {name} alone is expected")
    return value[name]


def _end(ends: dict[str, End], request: web.Request) -> End:
    try:
        return ends[request.match_info["name"]]
    except KeyError as error:
        raise _Problem(404, "unknown") from error


def _goal(request: web.Request) -> Goal:
    goal = ros.goal(request.match_info["id"])
    if goal is None:
        raise _Problem(404, "unknown goal")
    return goal


async def _of(future: Any) -> Any:
    if future is None:
        raise _Problem(503, "nobody serves that")
    done, _ = await asyncio.wait({asyncio.wrap_future(future)}, timeout=ros.deadline_s)
    if not done:
        raise _Problem(504, "no response in time")
    return done.pop().result()


@routes.get("/openapi.json")
async def description(_: web.Request) -> Any:
    """Return the OpenAPI."""
    return web.json_response(openapi(STYLES["aiohttp"]))


@routes.get("/ros")
async def topics(_: web.Request) -> Any:
    """Return the graph's topics."""
    return web.json_response([{"topic": name, "kind": kind} for name, kind in sorted(ros.topics().items())])


@routes.get("/ros/{name}")
async def last(request: web.Request) -> Any:
    """Return the last message."""
    message = ros.last(_end(_reads, request))
    if message is None:
        raise _Problem(503, "nothing fresh")
    return web.json_response(text=json.dumps(ros.forms.write(message), ensure_ascii=False))


@routes.get("/ros/{name}/events")
async def events(request: web.Request) -> Any:
    """Stream the messages of a topic as server-sent events, one in `every_ms` at most."""
    response = web.StreamResponse(headers={"Content-Type": "text/event-stream", "Cache-Control": "no-store"})
    queue, end = _streamed(request)
    await response.prepare(request)
    try:
        while True:
            await response.write(f"data: {await queue.get()}\n\n".encode())
    except ConnectionError:
        return response
    finally:
        end()


@routes.get("/ros/{name}/socket")
async def messages(request: web.Request) -> Any:
    """Send the messages of a topic over a WebSocket."""
    socket = web.WebSocketResponse()
    queue, end = _streamed(request)
    await socket.prepare(request)

    async def forward() -> None:
        while True:
            await socket.send_str(await queue.get())

    sending = asyncio.create_task(forward())
    try:
        async for _ in socket:
            pass
    finally:
        sending.cancel()
        end()
    return socket


def _streamed(request: web.Request) -> tuple[asyncio.Queue[str], Callable[[], None]]:
    queue: asyncio.Queue[str] = asyncio.Queue()
    loop, throttle_s = asyncio.get_running_loop(), int(request.query.get("every_ms", "0")) / 1000
    send = partial(loop.call_soon_threadsafe, queue.put_nowait)
    return queue, ros.stream(_end(_reads, request), send, throttle_s)


@routes.post("/ros/{name}/messages")
async def publish(request: web.Request) -> Any:
    """Publish a message."""
    end = _end(_publishes, request)
    ros.publish(end, ros.read(await _member(request, "message"), interface(end.type), end))
    return web.Response(status=204)


@routes.post("/ros/{name}/calls")
async def call(request: web.Request) -> Any:
    """Call a service."""
    end = _end(_services, request)
    message = ros.read(await _member(request, "request"), interface(end.type).Request, end)
    return web.json_response(ros.forms.write(await _of(ros.call(end, message))))


def _written(name: str, goal: Goal) -> dict[str, Any]:
    latest, outcome = goal.latest(), goal.result
    return {
        "goal_id": name,
        "status": goal.status or GoalStatus.STATUS_ACCEPTED,
        "latest": latest and ros.forms.write(latest),
        "outcome": outcome and ros.forms.write(outcome),
    }


async def _watch(request: web.Request, goal: Goal) -> None:
    while request.transport and not request.transport.is_closing():  # noqa: ASYNC110 - nothing tells when it closes
        await asyncio.sleep(0.05)
    ros.cancel(goal)


@routes.post("/ros/navigate/goals")
async def begin(request: web.Request) -> Any:
    """Send a goal."""
    wanted = ros.read(await _member(request), interface(ACTION.type).Goal, ACTION)
    sent = ros.send_goal(ACTION, wanted)
    name, goal, accepted = sent or ("", None, None)
    if not await _of(accepted):
        raise _Problem(422, "refused by its server")
    if "canceled when its client leaves" in ros.faults:
        _watching.append(asyncio.create_task(_watch(request, goal)))
    return web.json_response(_written(name, goal), status=201, headers={"Location": f"/ros/navigate/goals/{name}"})


@routes.get("/ros/navigate/goals/{id}")
async def goal_of(request: web.Request) -> Any:
    """Return a goal."""
    return web.json_response(_written(request.match_info["id"], _goal(request)))


@routes.delete("/ros/navigate/goals/{id}")
async def cancel(request: web.Request) -> Any:
    """Cancel a goal."""
    if not await _of(ros.cancel(_goal(request))):
        raise _Problem(409, "not to be cancelled")
    return web.Response(status=204)


if __name__ == "__main__":
    application = web.Application(middlewares=[_problems], client_max_size=4_000_000)
    application.add_routes(routes)
    web.run_app(application, host="127.0.0.1", port=port, print=None)

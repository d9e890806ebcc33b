"""A gateway on FastAPI: async functions, resources under a version, errors as `detail`, absent topics are 404."""

import asyncio
from collections.abc import AsyncIterator
from functools import partial
from typing import Any

import uvicorn
from action_msgs.msg import GoalStatus
from fastapi import FastAPI, HTTPException, Request
from fastapi.responses import JSONResponse, Response, StreamingResponse
from messages import RefusedError, interface, parsed
from ros_end import Goal, begun
from surface import ACTION, PARAMETERS, PUBLISHES, READS, SERVICES, STYLES, End, openapi

_STATES = {
    GoalStatus.STATUS_SUCCEEDED: "succeeded",
    GoalStatus.STATUS_CANCELED: "canceled",
    GoalStatus.STATUS_ABORTED: "aborted",
    GoalStatus.STATUS_CANCELING: "canceling",
}
_BODY_BYTES = 2_000_000
ros, port = begun("fastapi")
app = FastAPI(openapi_url=None)
_sent: list[str] = []
_kept: dict[tuple[str, str], Response | None] = {}
_reads, _publishes, _services, _parameters = (
    {end.name: end for end in ends} for ends in (READS, PUBLISHES, SERVICES, PARAMETERS)
)


def _found(ends: dict[str, End], name: str) -> End:
    if name not in ends:
        raise HTTPException(404, f"no {name!r} here")
    return ends[name]


async def _body(request: Request) -> Any:
    if request.headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
        raise HTTPException(415, "send application/json")
    body = await request.body()
    if len(body) > _BODY_BYTES:
        raise HTTPException(413, f"over {_BODY_BYTES} bytes")
    try:
        return parsed(body)
    except RefusedError as error:
        raise HTTPException(400, str(error)) from error


def _read(value: Any, kind: type, end: End) -> Any:
    try:
        return ros.read(value, kind, end)
    except RefusedError as error:
        raise HTTPException(422, str(error)) from error


def _goal(name: str) -> Goal:
    goal = ros.goal(name)
    if goal is None:
        raise HTTPException(404, "no such goal")
    return goal


async def _within(future: Any) -> Any:
    if future is None:
        raise HTTPException(503, "there is no server")
    try:
        return await asyncio.wait_for(asyncio.wrap_future(future), ros.deadline_s)
    except TimeoutError as error:
        raise HTTPException(504, "the server does not answer") from error


@app.middleware("http")
async def once(request: Request, carry_out: Any) -> Response:
    """Perform a request with an Idempotency-Key once; what was refused leaves its key free."""
    key = request.headers.get("idempotency-key")
    if key is None or "keys ignored" in ros.faults:
        return await carry_out(request)
    name = (request.url.path, (await request.body()).decode() if "keys mixed" in ros.faults else key)
    if name in _kept:
        return _kept[name] or JSONResponse({"detail": "it is being performed"}, 409)
    _kept[name] = None
    came = await carry_out(request)
    headers = {field: value for field, value in came.headers.items() if field != "content-length"}
    response = Response(b"".join([part async for part in came.body_iterator]), came.status_code, headers)
    if came.status_code < 400:
        _kept[name] = response
    else:
        del _kept[name]
    return response


@app.get("/openapi.json")
async def description() -> Any:
    """Return the OpenAPI."""
    return openapi(STYLES["fastapi"])


@app.get("/api/v1/topics")
async def topics() -> Any:
    """Return the graph's topics."""
    return {"topics": [{"name": name, "type": kind} for name, kind in ros.topics().items()]}


@app.get("/api/v1/topics/{name}")
async def last(name: str) -> Any:
    """Return the last message."""
    end = _found(_reads, name)
    message = ros.last(end)
    if message is None:
        raise HTTPException(404, "no message")
    # What JSON has no form for was replaced; the standard writer keeps -0.0 and all digits.
    return JSONResponse({"type": end.type, "data": ros.forms.write(message)})


@app.get("/api/v1/topics/{name}/events")
async def events(name: str, request: Request) -> StreamingResponse:
    """Stream the messages of a topic as server-sent events."""
    queue: asyncio.Queue[str] = asyncio.Queue()
    repeats = "stream repeats" in ros.faults and "Last-Event-ID" in request.headers
    end = ros.stream(_found(_reads, name), partial(asyncio.get_running_loop().call_soon_threadsafe, queue.put_nowait))

    async def written() -> AsyncIterator[str]:
        try:
            for text in _sent[-4:] if repeats else ():
                yield f"data: {text}\n\n"
            while True:
                _sent.append(await queue.get())
                yield f"id: {len(_sent)}\ndata: {_sent[-1]}\n\n"
        finally:
            end()

    return StreamingResponse(written(), media_type="text/event-stream")


@app.post("/api/v1/topics/{name}", status_code=202)
async def publish(name: str, request: Request) -> Any:
    """Publish a message."""
    end = _found(_publishes, name)
    ros.publish(end, _read(await _body(request), interface(end.type), end))
    return {"published": True}


@app.post("/api/v1/services/{name}")
async def call(name: str, request: Request) -> Any:
    """Call a service."""
    end = _found(_services, name)
    message = _read(await _body(request), interface(end.type).Request, end)
    return JSONResponse({"result": ros.forms.write(await _within(ros.call(end, message)))})


@app.get("/api/v1/parameters/{name}")
async def parameter(name: str) -> Any:
    """Return a parameter."""
    return JSONResponse({"value": await _within(ros.get_parameter(_found(_parameters, name)))})


@app.put("/api/v1/parameters/{name}", status_code=204)
async def set_parameter(name: str, request: Request) -> None:
    """Set a parameter."""
    body = await _body(request)
    if not isinstance(body, dict) or body.keys() != {"value"}:
        raise HTTPException(422, "expected one member, value")
    try:
        is_taken = await _within(ros.set_parameter(_found(_parameters, name), body["value"]))
    except RefusedError as error:
        raise HTTPException(422, str(error)) from error
    if not is_taken:
        raise HTTPException(409, "the node refuses it")


@app.post("/api/v1/goals", status_code=202)
async def begin(request: Request) -> Any:
    """Send a goal."""
    body = await _body(request)
    if not isinstance(body, dict) or body.keys() != {"goal"}:
        raise HTTPException(422, "expected one member, goal")
    sent = ros.send_goal(ACTION, _read(body["goal"], interface(ACTION.type).Goal, ACTION))
    name, goal, accepted = sent or ("", None, None)
    if not await _within(accepted):
        del ros.goals[name]
        raise HTTPException(409, "the goal was refused")
    return {"id": name, "state": _STATES.get(goal.status, "executing")}


@app.get("/api/v1/goals/{name}")
async def goal_of(name: str) -> Any:
    """Return a goal."""
    goal = _goal(name)
    state, latest, result = _STATES.get(goal.status, "executing"), goal.latest(), goal.result
    written = {"feedback": ros.forms.write(latest) if latest else None}
    written["result"] = ros.forms.write(result) if result else None
    return JSONResponse({"id": name, "state": state} | written)


@app.post("/api/v1/goals/{name}/cancel", status_code=202)
async def cancel(name: str) -> Any:
    """Cancel a goal."""
    if not await _within(ros.cancel(_goal(name))):
        raise HTTPException(409, "it cannot be canceled now")
    return {"id": name}


if __name__ == "__main__":
    uvicorn.run(app, host="127.0.0.1", port=port, log_level="critical")

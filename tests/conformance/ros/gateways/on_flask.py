"""A gateway on Flask: a thread for each request beside the executor's, refused goals are tasks with a state."""

import json
from concurrent.futures import TimeoutError as LateError
from typing import Any

from action_msgs.msg import GoalStatus
from flask import Flask, Response, abort, request
from messages import RefusedError, interface, parsed
from ros_end import Goal, begun
from surface import ACTION, PARAMETERS, PUBLISHES, READS, SERVICES, STYLES, End, openapi
from werkzeug.exceptions import HTTPException
from werkzeug.serving import WSGIRequestHandler

_PHASES = {
    GoalStatus.STATUS_SUCCEEDED: "done",
    GoalStatus.STATUS_CANCELED: "stopped",
    GoalStatus.STATUS_ABORTED: "failed",
    GoalStatus.STATUS_UNKNOWN: "rejected",
}
ros, port = begun("flask")
app = Flask(__name__)
_ends = {
    kind: {end.name: end for end in ends}
    for kind, ends in zip("rpsn", (READS, PUBLISHES, SERVICES, PARAMETERS), strict=True)
}


def _json(value: Any, status: int = 200) -> Response:
    return Response(json.dumps(value), status, mimetype="application/json")


@app.errorhandler(HTTPException)
def _problem(error: HTTPException) -> Response:
    response = error.get_response()
    response.data, response.mimetype = json.dumps({"detail": str(error.description)}), "application/json"
    return response


@app.errorhandler(RefusedError)
def _refused(error: RefusedError) -> Response:
    return _json({"detail": str(error)}, 400)


def _body() -> Any:
    if request.mimetype != "application/json":
        abort(415)
    return parsed(request.get_data())


def _end(kind: str, name: str) -> End:
    return _ends[kind].get(name) or abort(404)


def _of(future: Any) -> Any:
    if future is None:
        abort(503)
    try:
        return future.result(ros.deadline_s)
    except LateError:
        future.cancel()
        return abort(504)


def _task(name: str, goal: Goal) -> dict[str, Any]:
    latest, output = goal.latest(), goal.result
    progress = ros.forms.write(latest) if latest is not None else None
    phase = _PHASES.get(goal.status, "running")
    return {
        "task": {
            "uid": name,
            "phase": phase,
            "progress": progress,
            "output": ros.forms.write(output) if output else None,
        }
    }


@app.get("/openapi.json")
def description() -> Response:
    """Return the OpenAPI."""
    return _json(openapi(STYLES["flask"]))


@app.get("/topics")
def topics() -> Response:
    """Return the graph's topics."""
    return _json([{"name": name, "type": kind} for name, kind in ros.topics().items()])


@app.get("/state/<name>")
def last(name: str) -> Response:
    """Return the last message."""
    message = ros.last(_end("r", name))
    return _json({"msg": ros.forms.write(message)}) if message is not None else abort(404)


@app.post("/command/<name>")
def publish(name: str) -> Response:
    """Publish a message."""
    end = _end("p", name)
    ros.publish(end, ros.read(_body(), interface(end.type), end))
    return _json({"sent": 1})


@app.post("/do/<name>")
def call(name: str) -> Response:
    """Call a service."""
    end = _end("s", name)
    message = ros.read(_body(), interface(end.type).Request, end)
    return _json({"ok": True, "answer": ros.forms.write(_of(ros.call(end, message)))})


@app.get("/params/<name>")
def parameter(name: str) -> Response:
    """Return a parameter."""
    return _json({"value": _of(ros.get_parameter(_end("n", name)))})


@app.put("/params/<name>")
def set_parameter(name: str) -> Response:
    """Set a parameter."""
    body = _body()
    if not isinstance(body, dict) or list(body) != ["value"]:
        abort(422)
    return Response(status=204) if _of(ros.set_parameter(_end("n", name), body["value"])) else abort(409)


@app.post("/tasks")
def begin() -> Response:
    """Send a goal."""
    body = _body()
    if not isinstance(body, dict) or list(body) != ["input"]:
        abort(422)
    sent = ros.send_goal(ACTION, ros.read(body["input"], interface(ACTION.type).Goal, ACTION))
    name, goal, accepted = sent or ("", None, None)
    _of(accepted)
    return _json(_task(name, goal), 201)


@app.get("/tasks/<name>")
def task(name: str) -> Response:
    """Return a task."""
    return _json(_task(name, ros.goal(name) or abort(404)))


@app.post("/tasks/<name>/abort")
def cancel(name: str) -> Response:
    """Cancel a task."""
    goal = ros.goal(name) or abort(404)
    if goal.handle is None or not goal.handle.accepted or not _of(ros.cancel(goal)):
        abort(409)
    return _json({"aborting": True})


if __name__ == "__main__":
    WSGIRequestHandler.protocol_version = "HTTP/1.1"
    app.run("127.0.0.1", port, threaded=True)

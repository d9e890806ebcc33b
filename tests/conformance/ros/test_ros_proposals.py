"""``roaas certify --init --ros``: the map that is proposed of a right gateway is its own, and a run with it passes."""

import json
import re
import sys
import threading
import tomllib
from contextlib import closing, contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from gateway_processes import gateway
from processes import ended
from toy_server import serving

from ros_probe.process import ProbeError, RosProcess

#: What no description says.
UNSAID = ("max_age_s", "rejected", "refused", "timeout_s", "disconnect")
#: Parameters of the nodes, so that a read shows which is which.
HELD = {
    "/base": {"max_speed": ("double", 0.5), "count": ("integer", 2**53 + 1), "on": ("bool", True)},
    "/base/inner": {"modes": ("string_array", ["süß", ""]), "key": ("byte_array", {"b64": "AP8="})},
}


def _proposed(url, folder, domain_id):
    """Return the statement that is written, and what it says."""
    path = folder / "proposed.toml"
    more = ["--init", "--ros", "--ros-domain-id", domain_id, path]
    done = ended(sys.executable, "-m", "roaas", "certify", url, *more)
    assert done.returncode == 0, done.stdout + done.stderr
    return path, tomllib.loads(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("style", ["fastapi", "aiohttp", "flask", "node"])
def test_the_map_of_a_right_gateway_is_found(tmp_path, domain_id, style):
    robot = RosProcess("robot", domain_id=domain_id)
    robot.await_ready()
    for node, values in HELD.items():
        robot.tell("hold", node=node, values=values)
    with gateway(style, domain_id, tmp_path) as statement, closing(robot):
        own = tomllib.loads(statement.read_text(encoding="utf-8"))
        path, found = _proposed(own["api"]["openapi"], tmp_path, domain_id)
    empty = ("", [])
    wanted = {
        call: {key: value for key, value in table.items() if key not in UNSAID and value not in empty}
        for call, table in own["ros"]["operations"].items()
        # It is a guess where events have a message that is inside of a read. No description says what a query does.
        if "stream" not in table or (style == "aiohttp" and call.endswith("/events"))
    }
    assert found["ros"]["operations"] == wanted
    assert ("an event may have the message elsewhere" in path.read_text(encoding="utf-8")) == (style == "fastapi")
    assert found["ros"].items() <= (own["ros"] | {"operations": wanted}).items()


STAMP = {"type": "object", "properties": {"sec": {"type": "integer"}, "nanosec": {"type": "integer"}}}
HEADER = {"type": "object", "properties": {"stamp": STAMP, "frameId": {"type": "string"}}}
PLACE = {"header": HEADER} | {name: {"type": "number"} for name in ("pointX", "pointY", "pointZ")}
OBJECT = {"type": "object"}
GOAL = {"id": {"type": "string"}, "state": {"enum": ["runs", "done", "failed", "canceled"]}, "output": OBJECT}
SHORT = {name: {"type": "number"} for name in ("x", "y", "z", "qx", "qy", "qz", "qw")}
SHORT |= {"sec": {"type": "integer"}, "nanosec": {"type": "integer"}, "link": {"type": "string"}}
VELOCITY = {f"{part}{axis}": {"type": "number"} for part in ("linear", "angular") for axis in "XYZ"}


def _paths():
    def content(members):
        return {"content": {"application/json": {"schema": {"type": "object", "properties": members}}}}

    done = {"200": {"description": "done"} | content({}), "422": {"description": "refused"} | content({})}
    goal = {"201": {"description": "a goal"} | content(GOAL)}
    read = {"200": {"description": "a place"} | content(PLACE), "404": {"description": "none"} | content({})}
    return {
        "/place": {"get": {"responses": read}},
        "/pose": {"get": {"responses": {"200": {"description": "a pose"} | content(SHORT)}}},
        "/pose/events": {"get": {"responses": {"200": {"description": "poses", "content": {"text/event-stream": {}}}}}},
        "/cmd/velocity": {"post": {"requestBody": {"required": True} | content(VELOCITY), "responses": done}},
        "/halt": {"post": {"requestBody": content({"hard": {"type": "boolean"}}), "responses": done}},
        "/places/{id}": {"get": {"responses": read}},
        "/goals/count": {"post": {"requestBody": content({"order": {"type": "integer"}}), "responses": goal}},
        "/goals/{goal}": {"get": {"responses": goal}, "delete": {"responses": goal}},
        "/apps": {"get": {"responses": {"200": {"description": "all"} | content({})}}},
        "/apps/{app}/data": {"get": {"responses": {"200": {"description": "all"} | content({})}}},
        "/apps/{app}/data/{name}": {
            "get": {
                "responses": {
                    "200": {"description": "a message"} | content({"data": OBJECT, "stale": {"type": "boolean"}})
                }
            },
            "put": {"requestBody": content({}), "responses": done},
        },
    }


@contextmanager
def _renaming(domain_id):
    """Serve a gateway whose names are not those of ROS, and yield its URL."""
    ros, lock, last = RosProcess("gateway", domain_id=domain_id), threading.Lock(), {}
    ros.await_ready()
    ros.tell("listen", topic="/robot1/place", type="geometry_msgs/msg/PointStamped")
    ros.tell("listen", topic="/robot1/pose", type="geometry_msgs/msg/PoseStamped")
    twist = {"topic": "/robot1/cmd_vel", "type": "geometry_msgs/msg/Twist"}
    ros.tell("publish", **twist)
    ros.tell("act", action="/robot1/count", type="test_msgs/action/Fibonacci", script=[])
    lists = {"/apps": [{"id": "arm"}], "/apps/arm/data": [{"id": "its/place", "topic": "/robot1/place"}]}
    raw = {}

    class Handler(BaseHTTPRequestHandler):
        protocol_version, disable_nagle_algorithm = "HTTP/1.1", True

        def answer(self, status, value):
            octets = json.dumps(value).encode()
            self.send_response(status)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(octets)))
            self.end_headers()
            self.wfile.write(octets)

        def do_GET(self):
            with lock:
                for _, _, value in ros.tell("heard", name="/robot1/place")["events"]:
                    header, point = value["header"], value["point"]
                    raw.update({"data": value})
                    last.update({"header": {"stamp": header["stamp"], "frameId": header["frame_id"]}})
                    last.update({f"point{axis.upper()}": one for axis, one in point.items()})
            if self.path == "/openapi.json":
                self.answer(200, {"openapi": "3.1.0", "info": {"title": "x", "version": "1"}, "paths": _paths()})
            elif self.path in lists:
                self.answer(200, {"items": lists[self.path]})
            else:
                found = {"/place": last, "/apps/arm/data/its%2Fplace": raw}.get(self.path)
                self.answer(*((200, found) if found else (404, {})))

        def do_POST(self):
            try:
                body = json.loads(self.rfile.read(int(self.headers.get("Content-Length") or 0)))
                right = body.keys() == VELOCITY.keys() and all(type(one) in {int, float} for one in body.values())
            except (ValueError, AttributeError):
                right = False
            if right:
                parts = {
                    part: {axis: float(body[f"{part}{axis.upper()}"]) for axis in "xyz"}
                    for part in ("linear", "angular")
                }
                with lock:
                    ros.tell("publish", **twist, values=[parts])
            self.answer(200 if right else 422, {})

        def log_message(self, *_):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}/openapi.json"
        server.shutdown()
    ros.close()


def test_names_that_differ_are_mapped_and_a_run_with_the_map_passes(tmp_path, domain_id):
    with _renaming(domain_id) as url:
        path, found = _proposed(url, tmp_path, domain_id)
        selected = [f"ros-gateway/{one}" for one in ("read-exact", "write-exact", "once", "absent")]
        options = ["--ros-play", "--effort", "quick", "--out", tmp_path / "out"]
        options += [word for one in selected for word in ("--select", one)]
        done = ended(sys.executable, "-m", "roaas", "certify", path, *options)
    tables = found["ros"]["operations"]
    assert tables["GET /place"]["fields"] == {
        "/header/stamp": "/header/stamp", "/header/frameId": "/header/frame_id",
        "/pointX": "/point/x", "/pointY": "/point/y", "/pointZ": "/point/z",
    }  # fmt: skip
    assert tables["POST /cmd/velocity"]["fields"] == {
        f"/{part}{axis.upper()}": f"/{part}/{axis}" for part in ("linear", "angular") for axis in "xyz"
    }
    # A list names the topic of a path's value; who publishes on it is not the gateway.
    listed = {"topic": "/robot1/place", "type": "geometry_msgs/msg/PointStamped", "at": "/data", "absent": [404]}
    listed |= {"failure": {"at": "/stale", "values": [True]}}
    assert tables["GET /apps/arm/data/its%2Fplace"] == listed
    assert not any(call.startswith("PUT") for call in tables)
    # Goals may be in one place, beside what sends them.
    words = {"running": ["runs"], "succeeded": ["done"], "aborted": ["failed"], "canceled": ["canceled"]}
    goal = {"state": {"read": "GET /goals/{id}", "at": "/state"} | words, "result": "/output", "id": "/id"}
    goal |= {"action": "/robot1/count", "type": "test_msgs/action/Fibonacci", "cancel": "DELETE /goals/{id}"}
    assert tables["POST /goals/count"] == goal
    # A guess is a comment. The text that is left belongs to the field that is left.
    text = path.read_text(encoding="utf-8")
    guesses = tomllib.loads("\n".join(re.findall('^# (".+)', text, re.MULTILINE)))
    fields = {f"/{axis}": f"/pose/position/{axis}" for axis in "xyz"} | {"/link": "/header/frame_id"}
    fields |= {f"/q{axis}": f"/pose/orientation/{axis}" for axis in "xyzw"}
    fields |= {f"/{part}": f"/header/stamp/{part}" for part in ("sec", "nanosec")}
    pose = {"topic": "/robot1/pose", "type": "geometry_msgs/msg/PoseStamped", "fields": fields}
    assert guesses["GET /pose"] == pose | {"absent": [404]}
    assert guesses["GET /pose/events"] == pose | {"stream": "sse"}
    for line in (
        "# POST /halt: nothing on the graph has its fields, of 3 topics, 0 services and 1 actions",
        "# GET /places/{id}: its path has a parameter: write an operation for each value",
    ):
        assert line in text
    verdicts = {
        one["id"]: one["verdict"] for one in json.loads((tmp_path / "out" / "result.json").read_text())["requirements"]
    }
    assert {verdicts[one] for one in selected} == {"pass"}, done.stdout


WORD = {"type": "string"}
TOLD = {
    "/data": ("get", {"parameters": [{"name": "topic", "in": "query", "required": True, "schema": WORD}]}),
    "/publish": ("post", {"topic": WORD, "type": WORD, "msg": OBJECT}),
    "/services/call": ("post", {"name": WORD, "args": OBJECT}),
    "/turn": (
        "post", {"parameters": [{"name": "data", "in": "query", "required": True, "schema": {"type": "number"}}]},
    ),
}  # fmt: skip
SAID = {"topic": "/robot1/say", "type": "std_msgs/msg/String"}
TURN = {"topic": "/robot1/turn", "type": "std_msgs/msg/Float64"}


class _Told:
    """A gateway that is told the ROS name by a query or a body, or a message by a query."""

    def __init__(self, domain_id):
        self.ros, self.last, self.lock = RosProcess("gateway", domain_id=domain_id), {}, threading.Lock()
        self.ros.await_ready()

    def answer(self, method, path, content):
        if path == "/openapi.json":
            return 200, {"openapi": "3.1.0", "info": {"title": "x", "version": "1"}, "paths": self.paths()}
        with self.lock:
            if path.startswith("/turn"):
                return self.turn(path.partition("?data=")[2])
            return self.read(path.partition("?topic=")[2]) if method == "GET" else self.write(content)

    def turn(self, text):
        try:
            self.ros.tell("publish", **TURN, values=[{"data": float(text)}])
        except ValueError:
            return 422, {}
        return 200, {}

    @staticmethod
    def paths():
        found = {}
        for path, (method, said) in TOLD.items():
            body = {"content": {"application/json": {"schema": {"type": "object", "properties": said}}}}
            found[path] = {method: {"responses": {"200": {"description": "done"}}}}
            found[path][method] |= said if "parameters" in said else {"requestBody": body | {"required": True}}
        return found

    def read(self, topic):
        graph = self.ros.tell("graph")["topics"]
        if topic not in graph:
            return 404, {}
        self.ros.tell("listen", topic=topic, type=graph[topic]["types"][0])
        for *_, value in self.ros.tell("heard", name=topic, count=not self.last.get(topic), within_s=2.0)["events"]:
            self.last[topic] = value
        return (200, {"name": topic, "message": self.last[topic]}) if self.last.get(topic) else (404, {})

    def write(self, content):
        try:
            said = json.loads(content)
            kinds = {str} if said["type"] == SAID["type"] else {int, float}
            if said["msg"].keys() != {"data"} or type(said["msg"]["data"]) not in kinds:
                return 422, {}
            self.ros.tell("publish", topic=said["topic"], type=said["type"], values=[said["msg"]])
        except (ValueError, LookupError, TypeError, AttributeError, ProbeError):
            return 422, {}
        return 200, {}


def test_a_name_in_a_query_or_a_body_is_written_out_and_a_run_with_the_map_passes(tmp_path, domain_id):
    robot, told = RosProcess("robot", domain_id=domain_id), _Told(domain_id)
    robot.await_ready()
    robot.tell("publish", topic="/robot1/state", type=SAID["type"], values=[{"data": "ok"}], repeat_s=0.1)
    robot.tell("listen", **SAID)
    robot.tell("listen", **TURN)
    robot.tell("serve", service="/robot1/enable", type="std_srvs/srv/SetBool", script=[])
    with closing(told.ros), serving(told.answer) as url:
        with closing(robot):
            path, found = _proposed(f"{url}/openapi.json", tmp_path, domain_id)
        tables = found["ros"]["operations"]
        assert tables == {
            "GET /data?topic=/robot1/state": {"topic": "/robot1/state", "type": SAID["type"], "at": "/message"},
            "POST /turn?data={data}": {"publishes": TURN["topic"], "type": TURN["type"], "in_url": {"data": "/data"}},
            **{
                f"POST /publish#{one['topic']}": {"publishes": one["topic"], "type": one["type"], "at": "/msg"}
                | {"body": one}
                for one in (SAID, TURN)
            },
        }
        selected = [f"ros-gateway/{one}" for one in ("read-exact", "write-exact", "once")]
        options = ["--ros-play", "--effort", "quick", "--out", tmp_path / "out"]
        options += [word for one in selected for word in ("--select", one)]
        done = ended(sys.executable, "-m", "roaas", "certify", path, *options)
    verdicts = {
        one["id"]: one["verdict"] for one in json.loads((tmp_path / "out" / "result.json").read_text())["requirements"]
    }
    assert {verdicts[one] for one in selected} == {"pass"}, done.stdout

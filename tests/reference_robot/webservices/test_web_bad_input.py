"""Bad input is refused with a 4xx that names it, reaches no robot, and the next good request is answered."""

import json
from urllib.parse import unquote

import pytest
from web_messages import delivery_path, goal, twist
from web_robot import ForeignRobot, Served, problem

VELOCITY = "/robot/velocity/"
GOAL = "/robot/navigation/action/goal/"
GOOD = json.dumps(twist())

NO_JSON = {
    "empty": b"",
    "not closed": b'{"linear": {',
    "text": b"forward",
    "single quotes": GOOD.replace('"', "'").encode(),
    "trailing comma": GOOD.replace("}}", "},}").encode(),
    "two documents": (GOOD + GOOD).encode(),
    "byte order mark": b"\xef\xbb\xbf" + GOOD.encode(),
    "UTF-16": GOOD.encode("utf-16"),
    "not UTF-8": b'{"linear": "\xff"}',
    "NaN": GOOD.replace("0.1", "NaN").encode(),
    "Infinity": GOOD.replace("0.1", "-Infinity").encode(),
    "deep lists": b"[" * 100_000 + b"]" * 100_000,
    "deep objects": b'{"a":' * 100_000 + b"1" + b"}" * 100_000,
    "null byte": GOOD.encode() + b"\0",
}
WRONG_JSON = {
    "null": "null",
    "list": "[]",
    "number": "7",
    "missing part": json.dumps({"linear": twist()["linear"]}),
    "missing component": GOOD.replace('"z": 0.0', '"y2": 0', 1),
    "unknown field": json.dumps(twist() | {"stamp": 1}),
    "string for number": json.dumps(twist(x="0.1")),
    "true for number": json.dumps(twist(x=True)),
    "null for number": json.dumps(twist(x=None)),
    "list for number": json.dumps(twist(x=[0.1])),
    "list for object": json.dumps(twist() | {"linear": [0.1, 0, 0]}),
    "5,000 digits": GOOD.replace("0.1", "9" * 5000),
    "400 digits": GOOD.replace("0.1", "9" * 400),
    "duplicate": GOOD.replace('"x": 0.1', '"x": 0.1, "x": 0.1', 1),
    "duplicate part": GOOD[:-1] + ', "linear": ' + json.dumps(twist()["linear"]) + "}",
    "surrogate in a name": GOOD.replace('"x"', '"\\ud800"', 1),
}
XML = "<Twist><linear><x>{}</x><y>0</y><z>0</z></linear><angular><x>0</x><y>0</y><z>0</z></angular></Twist>"
NO_XML = {
    "empty": "",
    "not closed": "<Twist>",
    "two roots": "<Twist/><Twist/>",
    "DOCTYPE": "<!DOCTYPE Twist>" + XML.format(0.1),
    "entity": '<!DOCTYPE Twist [<!ENTITY x "0.1">]>' + XML.format("&x;"),
    "external entity": '<!DOCTYPE Twist [<!ENTITY x SYSTEM "file:///etc/hostname">]>' + XML.format("&x;"),
    "external DTD": '<!DOCTYPE Twist SYSTEM "http://127.0.0.1:1/x.dtd">' + XML.format(0.1),
    "billion laughs": '<!DOCTYPE Twist [<!ENTITY a "0">'
    + "".join(f'<!ENTITY {chr(98 + i)} "{("&" + chr(97 + i) + ";") * 10}">' for i in range(9))
    + "]>"
    + XML.format("&j;"),
    "DOCTYPE after a comment": "<!-- x --><!DOCTYPE Twist>" + XML.format(0.1),
    "processing instruction": "<?robot go?>" + XML.format(0.1),
    "processing instruction inside": XML.format("<?robot go?>0.1"),
    "undefined entity": XML.format("&robot;"),
    "deep": "<a>" * 50_000 + "</a>" * 50_000,
    "attributes": "<Twist " + " ".join(f'a{i}=""' for i in range(20_000)) + "/>",
    "control character": XML.format("\x01"),
}
WRONG_XML = {
    "other root": XML.format(0.1).replace("Twist", "Vector3"),
    "namespace": XML.format(0.1).replace("<Twist>", '<Twist xmlns="urn:x">'),
    "text": XML.format("fast"),
    "NaN": XML.format("NaN"),
    "INF": XML.format("INF"),
    "empty number": XML.format(""),
    "hexadecimal": XML.format("0x1"),
    "underscore": XML.format("0_1"),
    "Arabic digits": XML.format("\N{ARABIC-INDIC DIGIT ZERO}"),
    "missing": XML.format(0.1).replace("<y>0</y>", "", 1),
    "twice": XML.format(0.1).replace("<y>0</y>", "<y>0</y><y>0</y>", 1),
    "unknown": XML.format(0.1).replace("<y>0</y>", "<y>0</y><w>0</w>", 1),
    "attribute": XML.format(0.1).replace("<y>", '<y unit="m/s">', 1),
    "stray text": XML.format(0.1).replace("<y>", "slow<y>", 1),
    "nested": XML.format("<n>0.1</n>"),
}


def refused(served: Served, foreign: ForeignRobot, answer, status: int) -> None:
    assert problem(answer, status)
    assert "Traceback" not in answer.text
    assert len(answer.content) < 2000
    # What comes next over ROS is the next good request: the bad one reached nobody.
    assert served.call("PUT", VELOCITY, json=twist(x=0.123)).status_code == 200
    assert foreign.next("velocity")["x"] == 0.123


@pytest.mark.parametrize(
    ("media_type", "status", "body"),
    [
        pytest.param(media_type, status, body, id=f"{media_type} {name}")
        for media_type, status, bodies in (
            ("application/json", 400, NO_JSON),
            ("application/json", 422, WRONG_JSON),
            ("application/xml", 400, NO_XML),
            ("application/xml", 422, WRONG_XML),
        )
        for name, body in bodies.items()
    ],
)
def test_what_is_no_document_is_400_and_a_wrong_one_422(served, foreign, media_type, status, body):
    answer = served.call("PUT", VELOCITY, content=body, headers={"Content-Type": media_type})
    refused(served, foreign, answer, status)


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Content-Type": "text/plain"},
        {"Content-Type": "application/x-yaml"},
        {"Content-Type": "text/json"},
        {"Content-Type": "application/json; charset=utf-16"},
        {"Content-Type": "application/xml; charset=iso-8859-1"},
        {"Content-Type": "application/xml; charset=robot"},
        {"Content-Type": "application/json", "Content-Encoding": "gzip"},
        {"Content-Type": "multipart/form-data; boundary=x"},
    ],
)
def test_other_media_types_and_codings_are_415(served, foreign, headers):
    refused(served, foreign, served.call("PUT", VELOCITY, content=GOOD, headers=headers), 415)


@pytest.mark.parametrize("charset", ["", "; charset=utf-8", '; charset="UTF-8"', ";charset=us-ascii", "; x=y"])
def test_json_is_read_with_or_without_a_charset(served, foreign, charset):
    headers = {"Content-Type": "application/json" + charset}
    assert served.call("PUT", VELOCITY, content=GOOD, headers=headers).status_code == 200
    foreign.next("velocity")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_xml_is_read_in_both_encodings(served, foreign, encoding):
    content, headers = XML.format(0.1).encode(encoding), {"Content-Type": "application/xml"}
    assert served.call("PUT", VELOCITY, content=content, headers=headers).status_code == 200
    foreign.next("velocity")


BAD_PARTS = {
    "code": ["coffee", "4.0", "", "5", "0", "-4", "+0007", "4294967300", "9" * 5000],
    "depot_x": ["abc", ""],
    "depot_y": ["NaN", "%31e400"],
    "dest_x": ["Infinity", "-inf", "1e400", "NaN"],
    "dest_y": ["1e400", "-1E+999"],
    "source_x": ["1_0", "0x10", "1,5", "9" * 400],
    "source_y": ["1.", "%D9%A1", "1%20", "%00"],
}


@pytest.mark.parametrize(("name", "sent"), [(name, value) for name, values in BAD_PARTS.items() for value in values])
def test_deliveries_with_bad_values_are_422(served, foreign, name, sent):
    """The refusal names the part of the path, and repeats it as it was sent."""
    answer = served.call("PUT", delivery_path(**{name: sent}))
    refused(served, foreign, answer, 422)
    told = answer.json()["detail"]
    assert told.startswith(f"{name} must be ")
    assert f"not {ascii(unquote(sent))[:100]}" in told
    assert len(told) < 300
    assert served.call("PUT", delivery_path(source_x=0.5)).status_code == 204
    assert foreign.next("delivery")["source_x"] == "3fe0000000000000"


def test_two_large_doubles_are_no_infinity(served, foreign):
    assert served.call("PUT", delivery_path(source_x="1.7e308", source_y="1.7e308")).status_code == 204
    foreign.next("delivery")


@pytest.mark.parametrize(
    ("query", "named"),
    [
        ("", "x"),
        ("x=1", "y"),
        ("x=&y=1", "x"),
        ("x=one&y=1", "one"),
        ("x=NaN&y=1", "NaN"),
        ("x=1&y=Infinity", "Infinity"),
        ("x=1&y=1e400", "not '1e400'"),
        ("x=1&y=%2B1E999", "not '+1E999'"),
        ("x=1&y=1&yaw=-Infinity", "not '-Infinity'"),
        ("x=1&y=1&tolerance=-1", "-1"),
        ("x=1&y=1&yaw=north", "yaw"),
        ("x=1&y=1&frame_id=mars", "mars"),
        ("x=1&y=1&frame_id=", "frame_id"),
        ("x=1&y=1&start_x=here", "start_x"),
        ("x=1&y=1&tolerance=1e39", "tolerance"),
    ],
)
def test_plans_with_bad_parameters_are_422(served, query, named):
    assert named in problem(served.call("GET", f"/robot/navigation/service/plan?{query}"), 422)


def test_a_parameter_given_twice_is_400(served):
    assert served.call("GET", "/robot/navigation/service/plan?x=1&x=2&y=1").status_code == 400


def test_a_goal_id_with_half_a_character_is_422(served, foreign):
    body = json.dumps(goal("HALF")).replace("HALF", "\\ud83d")
    answer = served.call("PUT", GOAL, content=body, headers={"Content-Type": "application/json"})
    refused(served, foreign, answer, 422)


@pytest.mark.parametrize("sent", ["1e400", "-1E+999", "2" * 309])
@pytest.mark.parametrize(("media_type", "document"), [("application/json", GOOD), ("application/xml", XML.format(0.1))])
def test_a_body_s_number_is_repeated_as_it_was_sent(served, foreign, media_type, document, sent):
    headers = {"Content-Type": media_type}
    answer = served.call("PUT", VELOCITY, content=document.replace("0.1", sent), headers=headers)
    refused(served, foreign, answer, 422)
    assert answer.json()["detail"].startswith("linear.x must be a finite number, not ")
    assert sent[:100] in answer.json()["detail"]

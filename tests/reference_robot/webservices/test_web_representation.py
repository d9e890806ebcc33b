"""Messages to the wire and back, without a server: nothing is lost on any way."""

import json
import math
import sys

import pytest
import yaml
from geometry_msgs.msg import Twist
from hypothesis import given, settings
from hypothesis import strategies as st
from nav_msgs.msg import Odometry, Path
from processes import ended
from sensor_msgs.msg import BatteryState, LaserScan

from reference_robot.webservices.representation.messages import message_from, reader_of
from reference_robot.webservices.representation.problems import Problem
from reference_robot.webservices.representation.reading import KnownNames, parsed, read
from reference_robot.webservices.representation.shapes import Record, Series, shape_of
from reference_robot.webservices.representation.writing import write_json, write_text, write_xml

finite = st.floats(allow_nan=False, allow_infinity=False)


@given(st.lists(finite, min_size=6, max_size=6))
@settings(max_examples=50, deadline=None)
def test_a_twist_survives_every_format_bit_for_bit(numbers):
    plain = {
        "linear": dict(zip("xyz", numbers[:3], strict=True)),
        "angular": dict(zip("xyz", numbers[3:], strict=True)),
    }
    shape = shape_of(Twist)
    assert repr(read(write_json(plain), b"application/json", shape)) == repr(plain)
    assert repr(read(write_xml(plain, "Twist"), b"application/xml", shape)) == repr(plain)
    assert repr(yaml.safe_load(write_text(plain))) == repr(plain)
    assert repr(reader_of(Twist)(message_from(shape, plain))) == repr(plain)


@given(st.text(max_size=30))
@settings(max_examples=100, deadline=None)
def test_text_survives_json_and_yaml(text):
    assert json.loads(write_json({"id": text})) == {"id": text}
    assert yaml.safe_load(write_text({"id": text})) == {"id": text}
    write_xml({"id": text}, "GoalID")  # what XML cannot hold is replaced


@pytest.mark.parametrize("kind", [Odometry, Path, LaserScan, BatteryState])
def test_messages_of_all_kinds_come_back_equal(kind):
    message = kind()
    if kind is BatteryState:  # unknown figures are NaN there by definition
        shape = shape_of(kind)
        for name, _ in shape.fields:
            if isinstance(getattr(message, name), float):
                setattr(message, name, 0.5)
    if kind is LaserScan:
        message.ranges = [0.5, 1.25]
    plain = reader_of(kind)(message)
    assert message_from(shape_of(kind), json.loads(write_json(plain))) == message


def test_shapes_come_from_the_definitions():
    shape = shape_of(Odometry)
    pose = shape.field("pose")
    assert isinstance(pose, Record)
    assert pose.field("covariance") == Series(shape_of(Twist).field("linear").field("x"), 36)
    assert shape.field("twists") is None


def test_what_is_not_finite_is_named():
    message = Odometry()
    message.twist.covariance[7] = math.inf
    with pytest.raises(Problem, match=r"Odometry\.twist\.covariance\[7\] is inf"):
        reader_of(Odometry)(message)


@pytest.mark.parametrize(("kind", "value"), [(Path, '{"header": {"frame_id": "map"}, "poses": 1}')])
def test_a_value_for_a_list_is_refused(kind, value):
    with pytest.raises(Problem, match="poses must be a list, not 1"):
        read(value.encode(), b"application/json", shape_of(kind))


# In a process of its own, as what other tests leave free would hide or show what this one takes.
_STRANGERS = """
import resource
from pathlib import Path
from reference_robot.webservices.representation.reading import parsed

def resident_megabytes():
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6

def parse(numbers):
    for number in numbers:
        parsed(b"<a>" + b"".join(b"<n%dx%d%s/>" % (number, each, b"y" * 20) for each in range(30_000)) + b"</a>")

parse(range(10))
before = resident_megabytes()
parse(range(10, 30))
print(resident_megabytes() - before)
"""


def test_names_of_strangers_do_not_fill_the_memory():
    """libxml2 keeps each name that a thread has met: 1.5 MB for each of these documents, if we let it."""
    done = ended(sys.executable, "-c", _STRANGERS)
    assert float(done.stdout) < 15, done.stderr


def named(*names: str) -> bytes:
    return "".join(f"<{name}/>" for name in names).encode()


def test_one_document_of_many_unknown_names_does_not_make_the_next_client_a_stranger():
    names = KnownNames(at_once=100)
    assert not names.has_all(named(*(f"n{number}" for number in range(1990))))
    assert names.has_all(b'<S:Envelope xmlns:S="urn:a"><ns2:Execute xmlns:ns2="urn:b"/></S:Envelope>')


def test_names_are_learnt_again_some_time_after_many_documents_of_strangers():
    now = 0.0
    names = KnownNames(at_once=100, interval=10.0, clock=lambda: now)
    document = 0
    while names.has_all(named(*(f"d{document}n{number}" for number in range(10)))):
        document += 1
    assert document == 10
    assert not names.has_all(named("ours"))
    now = 9.0
    assert not names.has_all(named("ours"))
    now = 11.0
    assert names.has_all(named("ours"))
    assert not names.has_all(named("theirs"))
    assert names.has_all(named("ours", "d0n0"))


def test_a_name_without_end_is_not_learnt():
    assert not KnownNames().has_all(named("n" * 101))


@pytest.mark.parametrize("text", [b"", b"=", b"   = ", b"<", b"<=", b"\t=\n=", b"<a ="])
def test_what_only_looks_like_names_is_malformed(text):
    with pytest.raises(Problem):
        parsed(text)


@pytest.mark.parametrize(
    ("body", "charset", "said"),
    [(b"\xef\xbb\xbf{}", b"utf-8", "byte order mark"), (b"{}", b"utf-16", "charset 'utf-16'")],
)
def test_json_is_utf_8_without_a_byte_order_mark(body, charset, said):
    with pytest.raises(Problem, match=said):
        read(body, b"application/json; charset=" + charset, shape_of(Twist))

"""Operations of a description: which are meant, which may be called, and the requests that are made of them."""

import re
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from conformance.statement.load import ServiceLevel
from loadtests.cli import load
from loadtests.clients.failures import CallError, Declared
from loadtests.clients.robot import Secrets, with_secrets
from loadtests.described import operations, run
from loadtests.described.device import DESCRIBED_ONLY, Device, Named
from loadtests.described.operations import choose, named_alike, robot_of
from loadtests.described.run import streams_to_hear
from loadtests.schedule.plan import rotation, turns_of_all
from loadtests.settings.settings import Selection, SettingsError, Target

NONE = dict.fromkeys([*DESCRIBED_ONLY, *run._PAPERS_ONLY, "rest", "timeout_s", "token_file", "ca_file"])  # noqa: SLF001
OPTIONS = {**NONE, "overlays": (), "allow": (), "never": (), "allow_motion": False}


@pytest.fixture
def device(started):
    """Open a toy device; options for the command and for the device."""

    def start(*toys, statement=None, **options):
        _, port = started("toy_api.py", *toys)
        named = Named(f"http://127.0.0.1:{port}/openapi.json", statement)
        return Device.at(named, {**OPTIONS, **options})

    return start


@pytest.fixture(scope="module")
def description(tmp_path_factory):
    """A device that is not there, by its description in a file."""
    import json  # noqa: PLC0415

    from toy_api import DESCRIPTION  # noqa: PLC0415

    file = tmp_path_factory.mktemp("api") / "openapi.json"
    file.write_text(json.dumps(DESCRIPTION))

    def opened(**options):
        return Device.at(Named(str(file), None), {**OPTIONS, "base_url": "http://127.0.0.1:9", **options})

    return opened


def labels(found):
    return {each.label: weight for each, weight in found.weights.items()}


def test_operations_are_meant_by_label_id_and_pattern_with_weights(description):
    found = choose(description(), ["GET /state=3", "GET /items*"])
    assert labels(found) == {"GET /state": 3, "GET /items": 1, "GET /items/{item_id}": 1}
    assert labels(choose(description(), ["readState"])) == {"GET /state": 1}
    refusing = choose(description(), ["/*"])
    assert "POST /drive" not in labels(refusing)
    assert "POST /drive is not called: it may change something: --call allows it" in refusing.notes
    assert any(
        note.startswith("GET /reset is not called: its name, or a value of it, warns of harm")
        for note in refusing.notes
    )
    assert labels(choose(description(allow=("POST /drive",)), ["POST /drive"])) == {"POST /drive": 1}


@pytest.mark.parametrize(
    ("named", "message"),
    [
        ((), "name the operations to measure with --operation; the description has 'GET /state', 'GET /items'"),
        (("GET /stat",), "no operation 'GET /stat': did you mean 'GET /state'"),
        (("POST /drive",), "POST /drive is not called: it may change something"),
        (("*/drive", "*/halt"), "nothing is left to measure"),
    ],
)
def test_operations_that_cannot_be_measured_are_refused_with_what_to_do(description, named, message):
    with pytest.raises(SettingsError, match=re.escape(message)):
        choose(description(), named)


def test_never_wins_and_too_many_operations_are_too_many(description, monkeypatch):
    with pytest.raises(SettingsError, match="--never excludes it"):
        choose(description(never=("GET /state",)), ["GET /state"])
    monkeypatch.setattr(operations, "MOST", 2)
    with pytest.raises(SettingsError, match="operations are too many for one run: at most 2"):
        choose(description(), ["/*"])


def test_the_statement_names_operations_and_service_levels(device, tmp_path):
    statement = tmp_path / "robot.toml"
    statement.write_text(
        '[slo]\n"GET /state" = { p99_ms = 5, at_rate = 90 }\nreadState = { p50_ms = 2, at_rate = 30 }\n'
    )
    opened = device(statement=statement)
    assert labels(choose(opened, ())) == {"GET /state": 1}
    assert named_alike("readState", opened) == "GET /state"
    with pytest.raises(SettingsError, match=re.escape("[slo] '/*' means 10 operations: name one")):
        named_alike("/*", opened)
    statement.write_text('[load]\noperations = { "GET /text" = 2 }\n[slo]\n"GET /state" = { p99_ms = 5 }\n')
    assert labels(choose(device(statement=statement), ())) == {"GET /text": 2}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{ at_rate = 3 }", "a service level needs a limit"),
        ("{ p42_ms = 3 }", "unknown key 'p42_ms'"),
        ("{ p99_ms = 0 }", "p99_ms = 0"),
        ("{ error_rate = 1 }", "error_rate = 1"),
        ("3", "[slo] 'pose' = 3 must be a table"),
        ('{ p99_ms = 3 }\n[load]\noperations = { "GET /x" = 0 }', "'GET /x' = 0 must be a whole number from 1 to 1000"),
        ('{ p99_ms = 3 }\n[load]\noperations = { "GET /x" = "3" }', "[load.operations] Expected `int`, got `str`"),
        (
            '{ p99_ms = 3 }\n[load]\noperations = { "GET /x" = 3 }',
            "[load] operations is for a device with a description",
        ),
        ("{ p99_ms = 3 }\nother = { p99_ms = 3 }", "[slo] 'other' is no operation"),
    ],
)
def test_service_levels_that_cannot_be_are_refused(tmp_path, text, message):
    statement = tmp_path / "robot.toml"
    statement.write_text(f'[endpoints]\nrest = "http://127.0.0.1:9"\n[slo]\n"pose" = {text}\n')
    ended = CliRunner().invoke(load, [str(statement), "--out", str(tmp_path / "out")])
    assert (ended.exit_code, message in ended.output) == (2, True), ended.output


def test_the_rate_is_that_at_which_each_operation_has_its_own():
    def rate(weights, **rates):
        levels = {name: ServiceLevel(p99_ms=1.0, at_rate=value) for name, value in rates.items()}
        robot = SimpleNamespace()
        return Target(robot, Selection(("a", "b"), weights=weights), moves=False, steps_move=False, slo=levels)

    assert rate((), a=100.0, b=20.0).rate_of_levels == 200
    assert rate((5, 1), a=100.0, b=20.0).rate_of_levels == 120
    assert rate((), a=None).rate_of_levels is None
    assert operations._by_rates(  # noqa: SLF001
        {"a": ServiceLevel(p50_ms=1.0, at_rate=100.0), "b": ServiceLevel(p50_ms=1.0, at_rate=20.0)}
    ) == {"a": 5, "b": 1}


def test_values_come_from_what_the_device_lists_and_all_that_it_accepts_are_used(device):
    opened = device()
    robot = robot_of(opened, list(choose(opened, ["GET /items/{item_id}"]).weights))
    (items,) = robot.described
    assert {octets.split(b" ")[1] for octets in items.octets} == {b"/items/left", b"/items/right"}
    assert items.responses == ((200, ("application/json",)),)
    requests = robot.requests("rest", "GET /items/{item_id}", 1)
    assert len(requests) == 64
    assert robot.method("GET /items/{item_id}") == "GET"
    assert robot.offers("rest", "wire", items.name)
    assert not robot.offers("rest", "zeep", items.name)
    assert not robot.offers("soap", "wire", items.name)


def test_values_of_the_statement_come_first(device, tmp_path):
    statement = tmp_path / "robot.toml"
    statement.write_text('[values]\nitem_id = ["right"]\n')
    opened = device(statement=statement)
    (items,) = robot_of(opened, list(choose(opened, ["GET /items/{item_id}"]).weights)).described
    assert items.octets[0].startswith(b"GET /items/right HTTP/1.1\r\nHost: 127.0.0.1:")


def test_a_stream_is_no_request(device):
    opened = device()
    with pytest.raises(SettingsError, match="GET /events cannot be measured by requests"):
        robot_of(opened, list(choose(opened, ["GET /events"]).weights))


def test_streams_are_operations_and_websockets(device):
    def hear(*names, **pointers):
        return streams_to_hear(opened, {"streams": names, "stamp_field": None, "clock_field": None, **pointers})

    opened = device()
    wanted = hear("GET /events", "ws://127.0.0.1:9/state", "ws://127.0.0.1:9#/odom", clock_field="/now")
    found = wanted.listen
    assert (wanted.stamp, wanted.clock) == (None, "/now")
    assert [(each.name, each.kind) for each in found] == [
        ("GET /events", "sse"),
        ("ws://127.0.0.1:9/state", "websocket"),
        ("ws://127.0.0.1:9#/odom", "rosbridge"),
    ]
    assert found[0].octets.startswith(b"GET /events HTTP/1.1\r\n")
    with pytest.raises(SettingsError, match="no operation 'GET /event'"):
        hear("GET /event")
    with pytest.raises(SettingsError, match="--stream: 'ws://' names no host"):
        hear("ws://")
    for option in ("stamp_field", "clock_field"):
        with pytest.raises(SettingsError, match=r"--(stamp|clock)-field .* a pointer is written /header/stamp"):
            hear(**{option: "header.stamp"})


def test_secrets_stand_in_requests_only_where_they_are_sent(device, tmp_path):
    file = tmp_path / "key"
    file.write_text("t0ken-of-robot")
    opened = device("--auth", "query", api_key="query key", api_key_file=str(file))
    robot = robot_of(opened, list(choose(opened, ["GET /state"]).weights))
    (state,) = robot.described
    assert state.octets[0].startswith(b"GET /state?key=$ROAAS_QUERY_KEY HTTP/1.1\r\n")
    assert robot.requests("rest", "GET /state", 1)[0].octets.startswith(b"GET /state?key=t0ken-of-robot HTTP/1.1\r\n")
    assert "t0ken" not in repr(robot.described)
    bare = with_secrets(robot, Secrets.of(robot))
    assert bare == robot
    with pytest.raises(ValueError, match="credentials that this worker lacks"):
        with_secrets(robot, Secrets())


def test_what_is_declared_decides_what_is_good():
    good = Declared(((200, ("application/json", "text/*")), (204, ())))
    good.require(200, None, b"application/json; charset=utf-8", b"{}")
    good.require(200, None, b"application/json; charset=utf-8", b"{}")
    good.require(200, None, b"text/csv", b"1")
    good.require(204, None, None, b"")
    for status, media_type, kind, message in (
        (200, b"application/xml", "content", "application/xml, declared is application/json or text/"),
        (200, None, "content", "no media type"),
        (201, b"application/json", "status", "status 201, declared is 200, 204"),
        (404, b"application/json", "status", "status 404"),
        (302, b"application/json", "redirect", "status 302"),
    ):
        with pytest.raises(CallError, match=re.escape(message)) as caught:
            good.require(status, "/x", media_type, b"{}")
        assert caught.value.kind == kind


def test_a_rotation_spreads_the_calls_of_each_operation():
    assert rotation((0, 1), ()) == (0, 1)
    assert rotation((0, 1, 2), (3, 1, 2)) == (0, 2, 0, 1, 2, 0)
    assert rotation((0, 2), (4, 9, 2)) == (0, 2, 0)
    assert (turns_of_all((), 2), turns_of_all((3, 1), 2), turns_of_all((500, 1), 2)) == (2, 4, 8)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--basic-file {0} --rest http://127.0.0.1:9", "--basic-file is for a device with a description"),
        ("--stream ws://127.0.0.1:9 --rest http://127.0.0.1:9", "--stream is for a device with a description"),
        ("--operation x --rest http://127.0.0.1:9", "--operation 'x' is not one of delivery, coffee, pose"),
        ("http://127.0.0.1:9/a.json --client zeep", "measured over REST or SOAP, with the client wire"),
        ("http://127.0.0.1:9/a.json http://127.0.0.1:9/b.json", "are several descriptions: name one"),
        ("http://127.0.0.1:9/a.json --interface rosbridge", "measured over REST or SOAP, with the client wire"),
        ("http://127.0.0.1:9/a?wsdl --wsdl http://127.0.0.1:9/b?wsdl", "are several WSDLs: name one"),
        ("{0}.json", "there is no file"),
    ],
)
def test_options_that_do_not_fit_are_refused(tmp_path, words, message):
    file = tmp_path / "file"
    file.write_text("user:password")
    ended = CliRunner().invoke(load, [*words.format(file).split(), "--out", str(tmp_path / "out")])
    assert (ended.exit_code, message in ended.output) == (2, True), ended.output

"""Operations of a WSDL, and pairs over REST and SOAP: which are meant, which may be called, and what is sent."""

import re

import pytest
from click.testing import CliRunner
from soap_devices import CAMERA, SCALE, camera, scale, serving
from toy_api import DESCRIPTION

from loadtests.cli import load
from loadtests.clients.failures import CallError, Reply
from loadtests.described import run
from loadtests.described.device import DESCRIBED_ONLY, Device, Named
from loadtests.described.operations import choose, robot_of
from loadtests.described.run import Choice
from loadtests.measuring.preflight import preflight, values_difference
from loadtests.settings.settings import SettingsError

NONE = dict.fromkeys([*DESCRIBED_ONLY, *run._PAPERS_ONLY, "rest", "timeout_s", "token_file", "ca_file"])  # noqa: SLF001
OPTIONS = {**NONE, "overlays": (), "allow": (), "never": (), "allow_motion": False, "interfaces": ()}


def opened(url, name, statement=None, **options):
    """Open a device by its WSDL."""
    return Device.at(Named(f"{url}/{name}.wsdl", statement), {**OPTIONS, **options})


def bodies(robot):
    return [octets.partition(b"\r\n\r\n")[2].decode() for each in robot.described for octets in each.octets]


def test_operations_are_meant_by_name_and_called_by_the_rules_of_certify():
    with serving(camera()) as url:
        device = opened(url, "camera")
        assert device.interface == "soap"
        found = choose(device, ["GetStatus=3"])
        assert {device.name_of(each): weight for each, weight in found.weights.items()} == {"GetStatus": 3}
        assert choose(device, ["POST /cameraPort/GetStatus"]).weights.keys() == found.weights.keys()
        everything = choose(device, ["cameraPort"])
        assert everything.notes == ("AbsoluteMove is not called: it may change something: --call allows it",)
        with pytest.raises(SettingsError, match="AbsoluteMove is not called: it may change something"):
            choose(device, ["AbsoluteMove"])
        with pytest.raises(SettingsError, match="the description has 'GetStatus', 'AbsoluteMove'"):
            choose(device, [])
        with pytest.raises(SettingsError, match="no operation 'GetState': did you mean 'GetStatus'"):
            choose(device, ["GetState"])
        allowed = opened(url, "camera", allow=("AbsoluteMove",))
        robot = robot_of(allowed, list(choose(allowed, ["AbsoluteMove", "GetStatus"]).weights))
        assert (robot.rest, robot.soap, robot.addresses) == (None, url, [url])
        assert [robot.offers("soap", "wire", name) for name in ("AbsoluteMove", "GetStatus", "Other")] == [1, 1, 0]
        assert not robot.offers("rest", "wire", "GetStatus")
        findings = preflight(robot, [("GetStatus", "soap", "wire"), ("AbsoluteMove", "soap", "wire")], 1)
        assert findings.failures == {}
        assert robot.described[0].octets[0].startswith(b"POST /camera HTTP/1.1\r\n")
        assert b'SOAPAction: "urn:camera/AbsoluteMove"\r\n' in robot.described[0].octets[0]


def test_each_value_of_the_statement_that_is_accepted_is_used(tmp_path):
    statement = tmp_path / "scale.toml"
    statement.write_text('[values]\nchannel = [1, "no number", 3]\nunit = ["g"]\n')
    with serving(scale()) as url:
        device = opened(url, "scale", statement)
        with pytest.raises(SettingsError, match="no valid message can be made for GetLoad without values"):
            robot_of(device, list(choose(device, ["GetLoad"]).weights))
        statement.write_text('[values]\nchannel = [1, 2, 3]\nunit = ["g"]\n')
        refusing = scale()
        refusing.alter = lambda request, status, kind, body: (
            (500, kind, refusing.fault("Client", "no such channel")[1]) if b">2<" in request else (status, kind, body)
        )
    with serving(refusing) as url:
        device = opened(url, "scale", statement)
        robot = robot_of(device, list(choose(device, ["GetLoad"]).weights))
        assert [re.findall("<channel>(.*?)</channel><unit>(.*?)</unit>", body) for body in bodies(robot)] == [
            [("1", "g")],
            [("3", "g")],
        ]
        assert len(robot.requests("soap", "GetLoad", 1)) == 64
    acting = camera()
    statement.write_text("[values]\nPan = [0.1, 0.2]\n")
    with serving(acting) as url:
        device = opened(url, "camera", statement, allow=("AbsoluteMove",))
        assert len(bodies(robot_of(device, list(choose(device, ["AbsoluteMove"]).weights)))) == 1


def test_a_fault_counts_as_a_failure():
    faulty = camera()
    faulty.alter = lambda _, __, kind, ___: (500, kind, faulty.fault("Server", "overheated")[1])
    with serving(faulty) as url:
        device = opened(url, "camera")
        robot = robot_of(device, list(choose(device, ["GetStatus"]).weights))
        findings = preflight(robot, [("GetStatus", "soap", "wire")], 1)
        assert findings.messages() == ["GetStatus over soap (wire): status 500, SOAP fault: overheated"]
        assert {each.kind for each in findings.failures.values()} == {"fault"}


@pytest.mark.parametrize(
    ("element", "status", "body", "kind"),
    [
        (
            "PoseResponse",
            200,
            '<e:Envelope><e:Body><!-- > --><n:PoseResponse xmlns:n="u"/></e:Body></e:Envelope>',
            None,
        ),
        ("PoseResponse", 200, "<SOAP-ENV:Body>\n <PoseResponse>", None),
        ("PoseResponse", 200, "<e:Body><n:PoseResponses/></e:Body>", "content"),
        ("PoseResponse", 200, "<e:Body><n:Other><n:PoseResponse/></n:Other></e:Body>", "content"),
        ("PoseResponse", 200, "", "content"),
        ("PoseResponse", 200, "<SOAP-ENV:Body><SOAP-ENV:Fault><faultstring>no</faultstring>", "fault"),
        ("PoseResponse", 500, "<e:Body><e:Fault><e:Reason><e:Text xml:lang='en'>no</e:Text>", "fault"),
        ("PoseResponse", 401, "<e:Body><n:PoseResponse/></e:Body>", "status"),
        ("PoseResponse", 302, "", "redirect"),
        ("", 202, "", None),
        ("", 200, "<e:Body/>", None),
        ("", 200, "<e:Body><e:Fault/></e:Body>", "fault"),
    ],
)
def test_what_is_a_good_reply(element, status, body, kind):
    reply = Reply(element)
    if kind is None:
        reply.require(status, None, b"text/xml", body.encode())
        return
    with pytest.raises(CallError) as caught:
        reply.require(status, "/x", b"text/xml", body.encode())
    assert caught.value.kind == kind


def test_an_operation_that_two_ports_have_is_named_with_its_port():
    device = camera()
    again = '<port name="again" binding="c:Binding"><soap:address location="ADDRESS/camera"/></port>'
    away = '<port name="away" binding="c:Binding"><soap:address location="http://127.0.0.2:9/camera"/></port>'
    device.wsdl = CAMERA.replace("</service>", again + away + "</service>")
    with serving(device) as url:
        opened_device = opened(url, "camera")
        found = choose(opened_device, ["GetStatus", "again"])
        names = [opened_device.name_of(each) for each in found.weights]
        assert names == ["POST /cameraPort/GetStatus", "POST /again/GetStatus"]
        assert "POST /away/GetStatus is not called: its port is at another server" in found.notes


PAIRS = """
[api]
openapi = "openapi.json"
wsdl = "scale.wsdl"
base_url = "http://127.0.0.1:9"
[load.pairs]
weight = { rest = "GET /state", soap = "GetLoad" }
drive = { rest = "POST /drive", soap = "GetLoad" }
wrong = { rest = "GET /state", soap = "GetLoads" }
several = { rest = "*state", soap = "*" }
many = { rest = "GET /*", soap = "GetLoad" }
[slo]
weight = { p50_ms = 5 }
"GET /items" = { p50_ms = 5 }
"""


@pytest.fixture
def both(tmp_path):
    """A device that is not there, by two descriptions in files; gives its statement."""
    import json  # noqa: PLC0415

    (tmp_path / "openapi.json").write_text(json.dumps(DESCRIPTION))
    (tmp_path / "scale.wsdl").write_text(SCALE.replace("ADDRESS", "http://127.0.0.1:9"))
    statement = tmp_path / "both.toml"
    statement.write_text(PAIRS)
    return statement


def devices_of(statement, *interfaces):
    named = Named.of((str(statement),), {"openapi": None, "wsdl": None})
    return run._select(run._open(named, {**OPTIONS, "interfaces": interfaces}), interfaces)  # noqa: SLF001


def test_a_pair_is_one_operation_over_both_interfaces(both):
    devices = devices_of(both)
    assert [each.interface for each in devices] == ["rest", "soap"]
    choice = Choice.of(devices, ["weight=2"])
    labels = {name: [each.label for each in halves] for name, halves in choice.operations.items()}
    assert labels == {"weight": ["GET /state", "POST /scalePort/GetLoad"]}
    assert (choice.weights, choice.changing) == ({"weight": 2}, [])
    assert choice.notes == ("the pair weight is GET /state over REST and GetLoad over SOAP",)
    assert Choice.of(devices, ["several"]).operations.keys() == {"several"}
    assert Choice.of(devices[:2], []).weights == {"weight": 1}, "the pair that has a service level"
    levels = {"weight", "GET /items"}
    assert choice.levels(partial=True).keys() == levels
    for interface, name in (("rest", "GET /state"), ("soap", "GetLoad")):
        alone = Choice.of(devices_of(both, interface), ["weight=2"])
        assert alone.levels(partial=True).keys() == {name, "GET /items"}
        assert alone.weights == {name: 2}, "the name of a pair stands for the half that is measured"


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (
            ["weigh"],
            "'weigh' is no pair; did you mean 'weight'? To add it, declare it in the statement, as in [load.pairs]",
        ),
        (["GET /state"], "to measure one interface alone, add --interface rest or --interface soap"),
        (["wrong"], "[load.pairs] wrong: soap = 'GetLoads': the description has no operation 'GetLoads': did you mean"),
        (["many"], "[load.pairs] many: rest = 'GET /*' means GET /state, GET /items, "),
        (["drive"], "[load.pairs] drive: rest = 'POST /drive': POST /drive is not called: it may change something"),
    ],
)
def test_pairs_that_cannot_be_are_refused_with_what_to_do(both, names, message):
    with pytest.raises(SettingsError) as caught:
        Choice.of(devices_of(both), names)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("words", "change", "message"),
    [
        ("", ("soap = ", "soup = "), "[load.pairs] Object contains unknown field `soup`"),
        (
            "--interface soap",
            ('wsdl = "scale.wsdl"', ""),
            "--interface soap needs a WSDL: name it with --wsdl, or in [api] wsdl",
        ),
        (
            "--interface rest --operation GetLoad",
            ('openapi = "openapi.json"', ""),
            "--interface rest needs an OpenAPI description: name it with --openapi, or in [api] openapi",
        ),
        ("--against http://127.0.0.1:9", ("", ""), "to compare REST and SOAP, name the other device's statement"),
    ],
)
def test_descriptions_and_options_that_do_not_fit_are_refused(both, tmp_path, words, change, message):
    both.write_text(PAIRS.replace(*change, 1))
    ended = CliRunner().invoke(load, [str(both), *words.split(), "--out", str(tmp_path / "out")])
    assert (ended.exit_code, message in ended.output) == (2, True), ended.output


def test_without_a_pair_it_is_said_how_to_declare_one(both, tmp_path):
    both.write_text(PAIRS.partition("[load.pairs]")[0])
    ended = CliRunner().invoke(load, [str(both), "--operation", "GET /state", "--out", str(tmp_path / "out")])
    assert ended.exit_code == 2
    assert 'as in [load.pairs] pose = { rest = "GET /robot/pose/", soap = "GetPose" }' in ended.output


def test_a_pair_that_returns_more_over_one_interface_is_noted():
    inside = b"<r><p pan='1' tilt='2'/><list>1 2 3</list><s>a b</s></r>"
    soap = b"<e:Envelope xmlns:e='u'><e:Body>" + inside + b"</e:Body></e:Envelope>"
    assert values_difference(b'{"p": {"pan": 1, "tilt": 2}, "list": [1, 2, 3], "s": "a b"}', soap) is None
    assert values_difference(b'{"p": {"pan": 1}}', soap) == "1 values over REST and 6 over SOAP"
    assert values_difference(b"no JSON", soap) is None
    assert values_difference(b"{}", b"no XML") is None

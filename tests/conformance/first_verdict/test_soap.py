"""A camera over SOAP: a right one is not blamed, and what is wrong in one operation is found there."""

import re
import subprocess

import pytest
from aiohttp import web
from camera import FILES, Camera
from small_device import certified, small_device

from conformance.documents.description import DescriptionError
from conformance.statement.endpoints import Endpoints
from conformance.target.describing import soap_contract
from conformance.transport.client import Connection

_OPERATIONS = {
    "GetStatus", "GetPresets", "DescribePreset", "GetNodes", "Stop", "GetSettings", "GetGain", "GetEvents",
    "GetSnapshot",
}  # fmt: skip
_BROKEN = {
    "GetStatus": '<k:Position x="far" y="0"/><k:Mode>IDLE</k:Mode><k:UtcTime>2026-01-31T12:00:00Z</k:UtcTime>',
    "GetPresets": "<k:Preset/>",
    "GetNodes": '<z:GetNodesResponse xmlns:z="urn:other"/>',
    "GetSettings": "fault",
    "GetEvents": "",
}


def _failures(outcome, id_):
    return outcome.requirement(id_)["failures"]


def test_a_right_camera_is_not_blamed(tmp_path):
    with small_device({}, Camera().routes) as url:
        outcome = certified(f"{url}/a/camera.wsdl", tmp_path, "--call", "Stop")
    assert (outcome.exit_code, outcome.blamed) == (0, {}), outcome.text
    called = {one["operation"].rpartition("/")[2] for one in outcome.result["api"]["operations"] if one["requests"]}
    assert called == _OPERATIONS
    # The server of the WSDL is judged beside the verdict.
    beside = outcome.result["web_server"]["requirements"]
    assert {one["verdict"] for one in beside} == {"pass", "fail", "not-claimed"}
    assert [one["id"] for one in beside if one["verdict"] == "fail"] == ["web-server/host-invalid"]
    assert "web-server" not in outcome.result["classes"]


def test_what_is_wrong_in_one_operation_is_found_there(tmp_path):
    with small_device({}, Camera(_BROKEN).routes) as url:
        outcome = certified(f"{url}/a/camera.wsdl", tmp_path)
        assert outcome.exit_code == 1
        assert outcome.blamed == {"soap/response-valid": "fail", "soap/valid-accepted": "warn"}
        wrong = _failures(outcome, "soap/response-valid")
        assert {one["subject"] for one in wrong} == {"GetStatus", "GetPresets", "GetNodes", "GetEvents"}
        refused = _failures(outcome, "soap/valid-accepted")
        assert [one["subject"] for one in refused] == ["GetSettings"]
        # What the result shows does it again, in one line and in any shell; the terminal leaves it to `roaas replay`.
        events = next(one for one in wrong if one["subject"] == "GetEvents")
        assert f"roaas replay {tmp_path} {events['number']}" in outcome.text
        again = subprocess.run(["sh", "-c", events["request"]["curl"]], capture_output=True, check=True)
        assert b"GetEventsResponse" in again.stdout, again


def test_an_operation_that_closes_its_connections_is_a_finding(tmp_path):
    with small_device({}, Camera({"GetEvents": "closed"}).routes) as url:
        outcome = certified(f"{url}/a/camera.wsdl", tmp_path, "--never", "ptz", "--never", "media", effort="standard")
    assert outcome.exit_code == 1
    assert "error" not in outcome.blamed.values(), outcome.text
    assert "GetEvents" in str(_failures(outcome, "soap/answered"))


def test_one_cause_is_one_finding_with_a_valid_message(tmp_path):
    with small_device({}, Camera(media_type="text/plain").routes) as url:
        outcome = certified(f"{url}/a/camera.wsdl", tmp_path)
    assert set(outcome.blamed) == {"soap/media-type"}
    (finding,) = _failures(outcome, "soap/media-type")
    assert "a valid message of" in finding["message"]


def test_a_standards_file_serves_without_the_schemas_of_others(tmp_path):
    """The camera lacks an operation, and the file imports what is nowhere: both are notes."""
    missing = '<xs:import namespace="urn:nowhere" schemaLocation="nowhere.xsd"/>'
    wsdl = FILES["/a/camera.wsdl"].replace("<xs:redefine", f"{missing}<xs:redefine", 1)
    wsdl = wsdl.replace('type="c:Shape" maxOccurs', 'xmlns:n="urn:nowhere" type="n:Shape" maxOccurs')
    for path, text in {**FILES, "/a/camera.wsdl": wsdl}.items():
        place = tmp_path / path[1:]
        place.parent.mkdir(exist_ok=True)
        place.write_text(text.replace("BASE", "http://www.example.org"), encoding="utf-8")
    with small_device({}, Camera({"GetStatus": "fault: not supported"}).routes) as url:
        outcome = certified(tmp_path / "a" / "camera.wsdl", tmp_path / "out", "--base-url", url)
    assert (outcome.exit_code, outcome.blamed) == (0, {}), outcome.text
    assert any("nowhere.xsd could not be read" in note for note in outcome.result["notes"])
    assert "nowhere.xsd could not be read" in outcome.text


def test_a_wsdl_of_which_nothing_is_called_is_inconclusive(tmp_path):
    with small_device({}, Camera().routes) as url:
        outcome = certified(f"{url}/a/camera.wsdl", tmp_path, "--never", "*")
    assert (outcome.exit_code, outcome.result["verdict"]) == (4, "inconclusive")
    assert "no operation could be called" in outcome.text
    assert "GetStatus: --never excludes it" in outcome.requirement("soap/answered")["reason"]


_WSDL = FILES["/a/camera.wsdl"]
_NO_WSDL = {
    "page": (
        "text/html",
        "<!DOCTYPE html><html><title>Sign in</title><body><br></body></html>",
        "HTML page.*'Sign in'",
    ),
    "data": ("application/json", '{"openapi": "3.0.3"}', "JSON: an OpenAPI description goes with --openapi"),
    "nothing": ("text/xml", "", "an empty document"),
    "half": ("text/xml", _WSDL[: len(_WSDL) // 2], "not well-formed XML"),
    "other": ("text/xml", "<a/>", "the root element a instead of wsdl:definitions"),
    "two": ("text/xml", '<description xmlns="http://www.w3.org/ns/wsdl"/>', "WSDL 2.0"),
    "misplaced": ("text/xml", _WSDL.replace("BASE", "http://[::1"), "no port over HTTP"),
    "unplaced": ("text/xml", _WSDL.replace("BASE", ""), "--base-url"),
}


def test_an_address_without_a_wsdl_is_named_with_what_is_there(tmp_path):
    def giving(media_type, text):
        async def handle(_):
            return web.Response(text=text, content_type=media_type)

        return {"GET": handle}

    routes = {f"/{name}": giving(media_type, text) for name, (media_type, text, _) in _NO_WSDL.items()}
    with small_device({}, routes) as url:
        said = {name: _refusal(f"{url}/{name}?wsdl", tmp_path) for name in (*_NO_WSDL, "gone")}
    for name, (_, _, why) in _NO_WSDL.items():
        assert re.search(why, said[name]), said[name]
    assert "the server responded 404" in said["gone"]


def _refusal(source, folder):
    with pytest.raises(DescriptionError) as raised:
        soap_contract(source, None, Endpoints(), Connection(), folder)
    return str(raised.value)

"""SOAP operations are judged as resources: things, their states, and their lists in pages."""

import re

import pytest
from press import WSDL, XSD, press
from small_device import certified
from soap_devices import SOAP_11, serving

from conformance.api.soap.resources import Resources
from conformance.checkers.soap_memory import SoapThings
from conformance.checkers.transitions import barred_by
from conformance.contract.pack import Contract
from conformance.documents.openapi import operations_of
from conformance.documents.wsdl import read_services
from conformance.documents.xsd_shapes import Simple, is_alike
from conformance.transport.exchange import Exchange, Request, Response

pytestmark = pytest.mark.side_by_side
_SELECTED = ("soap/lists", "soap/states", "soap/written-is-read", "soap/deleted-is-gone")
_FAULTS = (
    {"filter ignored": ("soap/lists", "an item with"), "starts again": ("soap/states", "StartJob")},
    {"offset skips": ("soap/lists", "by offset=1"), "copies lost": ("soap/written-is-read", "copies")},
    {"sort ignored": ("soap/lists", "in order by"), "total of the page": ("soap/lists", "as total")},
)


def _certified(device, folder):
    folder.mkdir()
    # What updates a job, which another operation creates, is called by the wildcard; what removes one is named.
    names = ("--call", "POST /pressPort/DeleteJob")
    selected = [part for name in _SELECTED for part in ("--select", name)]
    with serving(device) as url:
        return certified(f"{url}/press.wsdl", folder, "--call", "*", *names, *selected)


def _resources(wsdl=WSDL):
    octets = wsdl.replace("ADDRESS", "http://press").encode()
    found = read_services(octets, "http://press/press.wsdl", lambda _: XSD.encode(), "", lambda _: "")
    return Resources(Contract.load(), found)


def test_operations_are_seen_as_resources():
    assert {(one.id, one.label) for one in operations_of(_resources().contract)} == {
        ("CreateJob", "POST /jobs"),
        ("GetJob", "GET /jobs/{jobId}"),
        ("UpdateJob", "PUT /jobs/{jobId}"),
        ("DeleteJob", "DELETE /jobs/{jobId}"),
        ("StartJob", "POST /jobs/{jobId}/start"),
        ("CancelJob", "POST /jobs/{jobId}/cancel"),
        ("ListJobs", "GET /jobs"),
    }


def test_a_second_port_of_one_version_has_things_of_its_own():
    port = '<port name="other" binding="c:Binding"><soap:address location="ADDRESS/other"/></port></service>'
    found = {place.template for place in _resources(WSDL.replace("</service>", port)).places.values()}
    assert {"/jobs/{jobId}", "/other/jobs/{jobId}"} <= found


def test_the_documentation_of_an_operation_is_that_of_the_values_that_have_none():
    text = "<documentation>Jobs by name. limit: at most that many. total: how many.</documentation>"
    found = _resources(WSDL.replace('<operation name="ListJobs">', f'<operation name="ListJobs">{text}', 1))
    (listed,) = (one for one in operations_of(found.contract) if one.id == "ListJobs")
    says = {one.name: one.says.strip() for one in listed.parameters}
    assert says["limit"] == "limit: at most that many."
    assert listed.shape["properties"]["total"]["description"] == "How many jobs match, on all pages."


@pytest.mark.parametrize(
    ("words", "barred"),
    [
        ("Queued becomes running. In every other state InvalidStateFault.", {"running", "done", "cancelled"}),
        ("Queued becomes running, running becomes done. Otherwise InvalidStateFault.", {"done", "cancelled"}),
        ("InvalidStateFault if the job is done.", {"done"}),
        ("Queued becomes running. In every other state a Client.State fault.", {"running", "done", "cancelled"}),
        ("Queued becomes running. In every other state a motor fault stops it.", set()),
        ("By default at once, if it is queued. A motor fault if it is running stops it.", set()),
    ],
)
def test_states_that_a_documentation_excludes(words, barred):
    found = _resources(WSDL.replace("Queued becomes running. In every other state InvalidStateFault.", words))
    operations = {one.id: one for one in operations_of(found.contract)}
    assert barred_by(operations["StartJob"], operations["GetJob"]).get("state", set()) == barred


def test_a_documentation_may_name_a_fault_that_the_wsdl_does_not_declare():
    text = "Queued becomes running. In every other state a fault."
    wsdl = WSDL.replace("Queued becomes running. In every other state InvalidStateFault.", text)
    found = _resources(re.sub(r"<(?:soap:)?fault\b[^>]*/>|<fault\b[^>]*>.*?</fault>", "", wsdl))
    operations = {one.id: one for one in operations_of(found.contract)}
    assert not any(place.act.operation.faults for place in found.places.values())
    assert "409" in operations["StartJob"].responses
    assert "409" not in operations["GetJob"].responses


_JOB = "<c:jobId>J-0001</c:jobId><c:title>a</c:title><c:copies>1</c:copies><c:material>card</c:material>"


@pytest.mark.parametrize(
    ("header", "status", "answer", "seen"),
    [
        ("", 500, "<s:Fault/>", 404),
        ("", 200, f"<c:GetJobResponse><c:job>{_JOB}<c:state>done</c:state></c:job></c:GetJobResponse>", 200),
        # A device may refuse any message with such a header block, by a rate limit, or answer without a thing.
        ('<s:Header><x:Strange xmlns:x="urn:example:strange"/></s:Header>', 500, "<s:Fault/>", None),
        ("", 503, "<s:Fault/>", 500),
        ("", 200, "<c:GetJobResponse/>", 500),
    ],
)
def test_what_a_read_says_of_a_thing(header, status, answer, seen):
    def message(inside, blocks=""):
        spaces = f'xmlns:s="{SOAP_11}" xmlns:c="urn:press"'
        return f"<s:Envelope {spaces}>{blocks}<s:Body>{inside}</s:Body></s:Envelope>".encode()

    sent = message("<c:GetJob><c:jobId>J-0001</c:jobId></c:GetJob>", header)
    response = Response(status, (("Content-Type", "text/xml"),), message(answer), 1.0)
    found = _resources().as_rest(Exchange(Request("POST", "http://press/press", (), sent), response))
    assert (found and (found.request.target, found.response.status)) == (seen and ("/jobs/J-0001", seen))


@pytest.mark.parametrize(
    ("charset", "written", "said"),
    [
        ("utf-8", "Gr\u00f6\u00dfe", "wrote it"),
        ("iso-8859-1", "Gr\u00f6\u00dfe", "wrote it in iso-8859-1"),
        ("utf-8", "Gr&#246;&#223;e", "wrote it with character references"),
    ],
)
def test_a_lost_text_is_shown_with_the_form_in_which_it_was_written(charset, written, said):
    spaces = f'xmlns:s="{SOAP_11}" xmlns:c="urn:press"'

    def called(name, sent, seen):
        documents = [
            f"<s:Envelope {spaces}><s:Body><c:{one}>{inside}</c:{one}></s:Body></s:Envelope>"
            for one, inside in ((name, sent), (f"{name}Response", seen))
        ]
        octets = f'<?xml version="1.0" encoding="{charset}"?>{documents[0]}'.encode(charset)
        headers = (("Content-Type", f"text/xml; charset={charset}"),)
        request = Request("POST", "http://press/press", headers, octets)
        response = Response(200, (("Content-Type", "text/xml"),), documents[1].encode(), 1.0)
        return Exchange(request, response)

    id_, rest = "<c:jobId>J-0001</c:jobId>", "<c:copies>1</c:copies><c:material>card</c:material>"
    read = [f"<c:job>{_JOB.replace('>a<', f'>{one}<')}<c:state>queued</c:state></c:job>" for one in ("a", "Gr??e")]
    steps = (
        called("GetJob", id_, read[0]),
        called("UpdateJob", f"{id_}<c:title>{written}</c:title>{rest}", ""),
        called("GetJob", id_, read[1]),
    )
    judge = SoapThings(_resources())
    (found,) = {case.expected for step in steps for case in judge(step) if not case.holds}
    assert found.endswith(said)


@pytest.mark.parametrize(
    ("builtin", "text", "same", "other"),
    [("duration", "PT90S", "PT1M30S", "PT90M"), ("time", "12:00:00Z", "12:00:00.0+00:00", "12:00:00")],
)
def test_forms_of_one_value(builtin, text, same, other):
    assert is_alike(Simple(builtin), text, same)
    assert not is_alike(Simple(builtin), text, other)


def test_a_right_device_is_not_blamed(tmp_path):
    device = press()
    outcome = _certified(device, tmp_path / "right")
    assert outcome.blamed == {}, outcome.text
    assert {outcome.requirement(name)["verdict"] for name in _SELECTED} == {"pass"}


@pytest.mark.parametrize("faults", _FAULTS, ids=" and ".join)
def test_faults_of_things_states_and_lists_are_found(tmp_path, faults):
    outcome = _certified(press(*faults), tmp_path / "wrong")
    for fault, (requirement, text) in faults.items():
        found = [
            one["subject"] + one["expected"] + one["observed"] for one in outcome.requirement(requirement)["failures"]
        ]
        assert any(text in one for one in found), f"{fault}: {found}"

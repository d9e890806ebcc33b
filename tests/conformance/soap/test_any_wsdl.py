"""The class soap of devices that are known by their WSDL: right ones are not blamed, mutants by rule are killed."""

import contextlib
import json
import re
import sys
from decimal import Decimal
from itertools import count
from types import SimpleNamespace

import pytest
from processes import ended
from soap_devices import PASSWORD, SOAP_11, TABLE, USER, camera, scale, serving, table

from conformance.api.call_rules import CallRules
from conformance.contract.pack import Contract
from conformance.documents.wsdl import WsdlError, read_services
from conformance.documents.wsdl_pack import write_soap_pack
from conformance.documents.xsd_shapes import Simple, beyond
from conformance.rules.soap import test_soap
from conformance.scenarios.described_messages import DescribedMessages
from conformance.scenarios.rule import Rule
from conformance.scenarios.scenario import NotPossibleError
from conformance.scenarios.soap_survey import soap_survey, wsdl_faults
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import Statement
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.effort import Effort
from conformance.verdict.evidence import Case
from conformance.verdict.run import Run

_DEVICES = {"camera": camera, "scale": scale, "table": table}
_SOURCE = "http://device/d.wsdl"
# Those that judge a trace; the others play what checkers judge (test_soap_changes).
_RULES = [one for one in vars(test_soap).values() if isinstance(one, Rule) and one.on[0] in {soap_survey, wsdl_faults}]


@pytest.fixture
def secret(tmp_path):
    path = tmp_path / "user"
    path.write_text(f"{USER}:{PASSWORD}", encoding="utf-8")
    return path


def _judged(device, tmp_path, secret):
    """Return the requirements that a device breaks, without HTTP, and those that were judged."""
    documents = {
        _SOURCE: device.wsdl.replace("ADDRESS", "http://device").encode(),
        f"http://device/{device.name}.xsd": device.xsd.encode(),
    }

    def fetch(place):
        if place not in documents:
            raise ValueError("404")
        return documents[place]

    found = read_services(documents[_SOURCE], _SOURCE, fetch)
    contract = Contract.load(write_soap_pack(tmp_path / device.name, found, _SOURCE, documents))

    def send(method, path, *, headers=(), body=b""):
        if method == "GET":
            altered = 404, "text/plain", b""
        else:
            status, octets = device.respond(body)
            media_type = "text/xml" if device.soap == SOAP_11 else "application/soap+xml"
            altered = device.alter(body, status, media_type, octets)
        status, media_type, octets = altered
        fields = (("Content-Type", media_type),) if media_type else ()
        return Exchange(Request(method, f"http://device{path}", headers, body), Response(status, fields, octets, 1.0))

    statement = Statement(endpoints=Endpoints(rest="http://device", username_token_file=str(secret)))
    run = Run(statement, contract, effort=Effort("standard"))
    client = SimpleNamespace(send=send, base_url="http://device")
    api = SimpleNamespace(run=run, client=client, alive=lambda: True, call_rules=CallRules(("*",)))
    traces = {wsdl_faults: wsdl_faults.play(run)}
    with contextlib.suppress(NotPossibleError):
        traces[soap_survey] = soap_survey.play(api)
    cases = [
        (rule.requirement, one)
        for rule in _RULES
        for scenario in rule.on
        if scenario in traces
        for one in rule.outcomes(traces[scenario], {"run": run}.get)
        if isinstance(one, Case)
    ]
    return {name for name, one in cases if not one.holds}, {name for name, _ in cases}


@pytest.mark.parametrize("name", _DEVICES)
def test_a_right_service_breaks_nothing(name, tmp_path, secret):
    broken, judged = _judged(_DEVICES[name](), tmp_path, secret)
    assert broken == set()
    assert len(judged) == len(_RULES)


def _replacing(old, new, *, faults=False):
    """Return a mutant that changes the body of successes, or of faults."""
    on = _on_faults if faults else _on_success
    return on(lambda status, media_type, body: (status, media_type, re.sub(old, new, body, count=1)))


def _on_faults(change):
    return lambda _, *answer: change(*answer) if answer[0] != 200 else answer


def _on_success(change):
    return lambda _, *answer: change(*answer) if answer[0] == 200 else answer


def test_facets_are_broken_by_little():
    """A bound on both sides, a length, and a pattern that the value matches but for one character."""
    number, text = Simple("int", minimum=Decimal(1), maximum=Decimal(9)), Simple("token", max_length=4)
    assert set(beyond(number, "3")) == {"1", "0", "9", "10"}
    assert {"mappp", "map~"} <= set(beyond(text, "map"))
    assert {"1234", "123455", "12345~"} <= set(beyond(Simple("token", patterns=("[0-9]{5}",)), "12345"))
    assert "0.049" in set(beyond(Simple("double", minimum=Decimal("0.05")), "1"))
    assert set(beyond(Simple("string", enumeration=("a",)), "a")) == {"a~"}


def _taking(pattern, device):
    """Return a mutant that answers messages with a pattern as if they were right."""
    right = device.envelope(next(iter(device.answers.values())))

    def alter(request, status, media_type, body):
        return (200, media_type, right) if status != 200 and re.search(pattern, request) else (status, media_type, body)

    return alter


def _now_and_then(change, every):
    calls = count(1)
    return lambda _, *answer: change(*answer) if next(calls) % every == 0 else answer


def _after_refusal(change):
    """Return a mutant that changes successes once it has refused a message."""
    refused = []

    def alter(_, *answer):
        if answer[0] != 200:
            refused.append(1)
            return answer
        return change(*answer) if refused else answer

    return alter


def _mutants(device):
    page = (b"<html><body>busy</body></html>", "text/html")
    fault = device.fault("Server" if device.soap == SOAP_11 else "Receiver", "it broke")
    trace = b'Traceback (most recent call last):\n  File "/srv/app.py", line 3, in do\nKeyError: 1'
    yield "cut", _on_success(lambda status, media, body: (status, media, body[:-9]))
    yield "cut-faults", _on_faults(lambda _, media, body: (500, media, body[:-9]))
    yield "page", _on_success(lambda status, _, __: (status, page[1], page[0]))
    yield "empty", _on_success(lambda status, media, _: (status, media, b""))
    yield "no-envelope", _replacing(rb"s:Envelope", b"s:Letter")
    yield "other-version", _replacing(device.soap.encode(), b"urn:other")
    yield "two-bodies", _replacing(rb"<s:Body>", b"<s:Body/><s:Body>")
    yield "no-body", _replacing(rb"s:Body(.*)s:Body", rb"s:Corpse\1s:Corpse")
    yield "undeclared-prefix", _replacing(rb"c:(\w+Response) ", rb"z:\1 ")
    yield "json", _on_success(lambda status, _, body: (status, "application/json", body))
    yield "media-type-of-faults", _on_faults(lambda status, _, body: (status, "text/html", body))
    yield "other-payload", _replacing(rb"(\w+)Response", rb"\1Result")
    yield "other-namespace", _replacing(rb'xmlns:c="urn:', b'xmlns:c="urn:not-')
    yield "payload-twice", _replacing(rb"<s:Body>(<c:.*)</s:Body>", rb"<s:Body>\1\1</s:Body>")
    yield "strange-child", _replacing(rb"(<c:\w+Response[^/>]*>)", rb"\1<Strange/>")
    yield "text-for-number", _replacing(rb"(pan=\"|<grams>|<c:Angle>)[\d.]+", rb"\1far")
    yield "fault-as-200", _on_faults(lambda _, media, body: (200, media, body))
    yield "fault-as-404", _on_faults(lambda _, media, body: (404, media, body))
    yield "fault-without-code", _replacing(rb"<faultcode>.*</faultcode>|<s:Code>.*</s:Code>", b"", faults=True)
    yield "fault-without-text", _replacing(rb"<faultstring>.*</faultstring>|<s:Reason>.*</s:Reason>", b"", faults=True)
    yield "fault-of-unknown-prefix", _replacing(rb">s:(Client|Sender)<", rb">q:\1<", faults=True)
    other = b"s:Sender" if device.soap == SOAP_11 else b"s:Client"
    yield "code-of-the-other-version", _replacing(rb"s:(?:Client|Sender)", other, faults=True)
    yield "doctype-in-success", _on_success(lambda status, media, body: (status, media, b"<!DOCTYPE x>" + body))
    yield (
        "fault-with-namespace",
        _replacing(rb"faultcode>(.*)faultcode>|s:Value", rb"s:faultcode>\1s:faultcode>", faults=True),
    )
    yield "traceback", _replacing(rb"not valid", trace, faults=True)
    yield "bare-error", _on_faults(lambda _, __, ___: (500, *reversed(page)))
    yield "bare-error-at-times", _now_and_then(lambda *_: (500, *reversed(page)), 7)
    yield "refuses-all", _on_success(lambda _, media, __: (fault[0], media, fault[1]))
    yield "fails-at-times", _now_and_then(lambda *answer: (fault[0], answer[1], fault[1]), 5)
    yield "fails-after-refusal", _after_refusal(lambda _, media, __: (fault[0], media, fault[1]))
    yield "old-answer-after-refusal", _after_refusal(lambda status, media, _: (status, media, b""))
    yield "takes-garbage", _taking(rb"^roaas$", device)
    yield "takes-nothing", _taking(rb"^$", device)
    yield (
        "takes-other-versions",
        _taking(rb"<n\d:Envelope|urn:example:roaas\W+><\w+:Header|Envelope xmlns:\w+=.urn:example", device),
    )
    yield "understands-all", _taking(rb"Strange", device)
    yield "takes-doctypes", _taking(rb"DOCTYPE", device)
    yield "takes-unknown-elements", _taking(rb"no_such_element", device)


@pytest.mark.parametrize("name", _DEVICES)
def test_mutants_by_rule_are_killed(name, tmp_path, secret):
    """At least 95 %, on each device."""
    survivors, number = [], 0
    for mutant, alter in _mutants(_DEVICES[name]()):
        device = _DEVICES[name]()
        device.alter = alter
        number += 1
        if not _judged(device, tmp_path, secret)[0]:
            survivors.append(mutant)
    assert number >= 35
    assert len(survivors) <= 0.05 * number, survivors


@pytest.mark.parametrize(("answer", "wrong"), [((200, "", b""), False), (None, True)])
def test_a_one_way_operation_has_no_message_in_its_response(answer, wrong, tmp_path, secret):
    """WS-I BP 1.1, R2714."""
    device = camera()
    device.wsdl = device.wsdl.replace('<output message="c:AbsoluteMoveOut"/>', "")
    device.alter = lambda request, *came: answer if answer and b"AbsoluteMove" in request and came[0] == 200 else came
    broken, judged = _judged(device, tmp_path, secret)
    assert "soap/response-valid" in judged
    assert broken == ({"soap/response-valid"} if wrong else set())


@pytest.mark.parametrize(
    ("after", "more", "wrong"),
    [
        ("</s:Value>", "<s:Subcode><s:Value>s:NotKnown</s:Value></s:Subcode>", False),
        ("</s:Reason>", "<s:Node>urn:table</s:Node><s:Role>urn:table</s:Role><s:Detail/>", False),
        ("</s:Value>", "<s:Subcode>s:NotKnown</s:Subcode>", True),
        ("</s:Reason>", "<s:Role>urn:table</s:Role><s:Node>urn:table</s:Node>", True),
        ("</s:Reason>", "<detail/>", True),
    ],
)
def test_a_fault_of_soap_1_2_has_the_parts_of_its_schema(after, more, wrong, tmp_path, secret):
    device = table()
    device.alter = _replacing(after.encode(), f"{after}{more}".encode(), faults=True)
    assert _judged(device, tmp_path, secret)[0] == ({"soap/fault"} if wrong else set())


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ('schemaLocation="camera.xsd"', 'schemaLocation="other.xsd"'),
        ('element="c:GetStatusResponse"', 'element="c:GetState"'),
        ('message="c:GetStatusOut"', 'message="c:GetStatusOff"'),
        ('<operation name="AbsoluteMove"><soap', '<operation name="Move"><soap'),
    ],
)
def test_a_wsdl_that_does_not_hold_together_is_told(right, wrong, tmp_path, secret):
    device = camera()
    device.wsdl = device.wsdl.replace(right, wrong, 1)
    try:
        broken, _ = _judged(device, tmp_path, secret)
    except WsdlError:
        return  # nothing can be called by it
    assert "soap/wsdl" in broken


@pytest.mark.parametrize("name", _DEVICES)
def test_certify_by_a_wsdl(name, tmp_path, secret):
    """Over HTTP: right services pass, and only what reads is called."""
    with serving(_DEVICES[name]()) as url:
        more = ["--username-token-file", str(secret), "--effort", "quick", "--out", str(tmp_path / "out")]
        done = ended(sys.executable, "-m", "roaas", "certify", "--wsdl", f"{url}/{name}.wsdl", *more)
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    called = {one["operation"].rpartition("/")[2] for one in result["api"]["operations"] if one["requests"]}
    assert called == {one for one in ("GetStatus", "GetLoad", "GetAngle") if one in str(result["api"])}
    verdicts = {one["id"]: one["verdict"] for one in result["requirements"]}
    # Nothing that writes is called, so that nothing is read back.
    unseen = {name for name, verdict in verdicts.items() if verdict != "pass"}
    assert unseen == {
        f"soap/{name}"
        for name in ("written-is-read", "refused-keeps", "created-is-there", "deleted-is-gone", "lists", "states")
    }
    assert not {verdicts[name] for name in unseen} & {"fail", "warn", "error"}
    assert PASSWORD not in (tmp_path / "out" / "result.json").read_text(encoding="utf-8")


def test_an_address_takes_the_place_of_what_the_wsdl_says(tmp_path):
    """As for the WSDL of a standard, which names an example, or has bindings alone."""
    for without in ("<service.*</service>", "never"):
        device = camera()
        device.wsdl = re.sub(without, "", device.wsdl.replace("ADDRESS", "http://www.example.org"))
        (tmp_path / "camera.wsdl").write_text(device.wsdl, encoding="utf-8")
        (tmp_path / "camera.xsd").write_text(device.xsd, encoding="utf-8")
        with serving(device) as url:
            more = ["--base-url", f"{url}/services/camera", "--effort", "quick", "--out", str(tmp_path / "out")]
            done = ended(sys.executable, "-m", "roaas", "certify", str(tmp_path / "camera.wsdl"), *more)
        assert (done.returncode, "1 of 2 operations called" in done.stdout) == (0, True), done.stdout + done.stderr


def test_a_pattern_that_may_take_python_too_long_still_makes_messages():
    trim = r'<xs:restriction base="xs:token"><xs:pattern value="[0-9]{1,4}( [0-9]{1,4}){3}"/></xs:restriction>'
    other = TABLE.replace(
        "<xs:sequence/>",
        f'<xs:sequence><xs:element name="Trim"><xs:simpleType>{trim}</xs:simpleType></xs:element></xs:sequence>',
        1,
    )
    found = read_services(other.replace("ADDRESS", "http://device").encode(), _SOURCE, lambda _: b"")
    _, node = DescribedMessages(found, {}).usual(found.ports[0].operations[0])
    assert re.fullmatch(r"\d+( \d+){3}", node.children[0].text)

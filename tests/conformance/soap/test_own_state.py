"""Faults that the state of a right device explains are no findings; those that it does not explain are."""

import pytest

from conformance.documents.wsdl import ENVELOPE_12, SoapOperation, SoapPort
from conformance.rules.soap.own_state import probes_left
from conformance.scenarios.soap_survey import Kind, SoapProbe
from conformance.transport.exchange import Exchange, Request, Response

_S = "http://schemas.xmlsoap.org/soap/envelope/"
_KINDS = {"u": Kind.USUAL, "a": Kind.AGAIN, "v": Kind.VARIED, "t": Kind.TRIED, "i": Kind.INVALID}
_NAMES = ("GetAlarm", "GetJob", "GetCurrentJob", "AcknowledgeAlarm", "StartJob", "EndJob", "DeleteAlarm", "SetMode")


class _Found:
    """What a WSDL describes: each operation declares Invalid and a fault of its own."""

    ports = (
        SoapPort(
            "s",
            "p",
            "http://device/",
            _S,
            tuple(
                SoapOperation(name, "", name, name, faults=frozenset({"{urn:d}Invalid", f"{{urn:d}}No{name}"}))
                for name in _NAMES
            ),
        ),
    )


def _probe(step):
    """Return a probe: kind, operation, id, and what came: ok, declared, other (undeclared), or Invalid."""
    kind, name, id_, came = step.split()
    sent = f"<d:{name}><d:id>{id_}</d:id></d:{name}>" if id_ != "-" else f"<d:{name}/>"
    detail = {"declared": f"<d:No{name}/>", "Invalid": "<d:Invalid/>"}.get(came, "")
    fault = f"<s:Fault><faultcode>s:Client</faultcode><detail>{detail}</detail></s:Fault>"
    request, answer = (
        f'<s:Envelope xmlns:s="{_S}" xmlns:d="urn:d"><s:Body>{inside}</s:Body></s:Envelope>'.encode()
        for inside in (sent, "<d:Ok/>" if came == "ok" else fault)
    )
    fields = (("Content-Type", "text/xml"),)
    response = Response(200 if came == "ok" else 500, fields, answer, 1.0)
    exchange = Exchange(Request("POST", "http://device/", fields, request), response)
    return SoapProbe(f"POST /p/{name}", _KINDS[kind], step, _S, "Ok", exchange)


def _counting(*steps):
    """Return which faulted probes count."""
    probes = [_probe("i GetJob x Invalid"), *map(_probe, steps)]
    return [one.says for one in probes_left(probes, _Found()) if not one.is_success and one.kind is not Kind.INVALID]


@pytest.mark.parametrize(
    "steps",
    [
        ("u AcknowledgeAlarm 1 ok", "u AcknowledgeAlarm 1 declared", "a AcknowledgeAlarm 1 declared"),
        ("u AcknowledgeAlarm 1 ok", "a AcknowledgeAlarm 1 other", "a AcknowledgeAlarm 1 other"),
        ("u StartJob 1 ok", "u StartJob 1 ok", "u StartJob 1 ok", "a StartJob 1 other", "a StartJob 1 other"),
        ("u StartJob 1 ok", "u StartJob 1 other", "a StartJob 1 other", "a StartJob 1 ok"),
        ("u SetMode 1 ok", "a SetMode 1 declared", "a SetMode 1 ok"),
        ("u GetAlarm 1 ok", "u DeleteAlarm 1 ok", "a GetAlarm 1 declared"),
        ("u GetAlarm 1 ok", "u DeleteAlarm 1 ok", "a GetAlarm 1 other"),
        ("u GetJob 1 ok", "t EndJob 1 ok", "a GetJob 1 other", "v GetJob 1 other"),
        ("u GetJob 1 ok", "a GetJob 1 declared"),
        ("u GetCurrentJob - ok", "u GetCurrentJob - declared", "u GetCurrentJob - ok"),
        ("u GetJob 1 ok", "u StartJob 2 ok", "u GetJob 1 declared", "u StartJob 2 ok", "u GetJob 1 ok"),
    ],
)
def test_what_the_state_explains_does_not_count(steps):
    assert _counting(*steps) == []


@pytest.mark.parametrize(
    ("steps", "wrong"),
    [
        (("u GetAlarm 1 ok", "a GetAlarm 1 other"), "a GetAlarm 1 other"),
        (("u GetAlarm 1 ok", "u DeleteAlarm 2 ok", "a GetAlarm 1 other"), "a GetAlarm 1 other"),
        (("u GetAlarm 1 ok", "u GetAlarm 1 Invalid"), "u GetAlarm 1 Invalid"),
        (("u GetJob 1 ok", "a GetJob 1 declared", "a GetJob 1 ok"), "a GetJob 1 declared"),
        (("u SetMode 1 ok", "a SetMode 1 other"), "a SetMode 1 other"),
        ((*["u StartJob 1 ok"] * 3, "a StartJob 1 other", "a StartJob 1 ok"), "a StartJob 1 other"),
    ],
)
def test_what_it_does_not_explain_counts(steps, wrong):
    assert _counting(*steps) == [wrong]


def test_a_fault_of_soap_12_is_read_as_well():
    """Its detail is written in another way."""
    probe = _probe("a GetJob 1 declared")
    body = probe.exchange.response.body.replace(_S.encode(), ENVELOPE_12.encode()).replace(b"detail>", b"Detail>")
    exchange = Exchange(probe.exchange.request, Response(500, probe.exchange.response.headers, body, 1.0))
    found = SoapProbe(probe.operation, Kind.AGAIN, "", ENVELOPE_12, "Ok", exchange)
    assert probes_left([_probe("u GetJob 1 ok"), found], _Found()) == [_probe("u GetJob 1 ok")]

"""What becomes of attacks is judged rightly, whatever a robot does with them."""

import pytest

from conformance.api.soap.attack_runner import attack_verdict
from conformance.api.soap.attacks import IGNORED_SLOT, MARK, VALUE_SLOT, Attack, Template, attacks
from conformance.transport.exchange import Exchange, NoAnswer, Request, Response, Unanswered

REQUEST = Request("POST", "http://robot/ws")
OPEN = b'<s:Envelope xmlns:s="http://schemas.xmlsoap.org/soap/envelope/"><s:Body>'
DONE = OPEN + b"<Done/></s:Body></s:Envelope>"
FAULT = OPEN + b"<s:Fault><faultcode>s:Client</faultcode><faultstring>no</faultstring></s:Fault></s:Body></s:Envelope>"
REFUSABLE = Attack("doctype", "a DOCTYPE", b"<!DOCTYPE a><a/>")
TOLERABLE = Attack("xinclude", "XInclude", b"<a/>", must_refuse=False)
ENTITY = Attack("internal-entity", "an entity", b"&b;")


def answered(body: bytes, status: int = 200) -> Exchange:
    return Exchange(REQUEST, Response(status, (("Content-Type", "text/xml"),), body, 1.0))


def unanswered(kind: NoAnswer, problem: str = "nothing came") -> Unanswered:
    return Unanswered(REQUEST, problem, kind)


@pytest.mark.parametrize(
    ("attack", "attempt", "holds"),
    [
        (REFUSABLE, answered(DONE), False),
        (REFUSABLE, answered(FAULT, 500), True),
        (REFUSABLE, answered(b"no", 400), True),
        (REFUSABLE, answered(b"<html/>"), False),
        (REFUSABLE, unanswered(NoAnswer.CLOSED), False),
        (REFUSABLE, unanswered(NoAnswer.MALFORMED, "connection closed in the middle"), False),
        (REFUSABLE, unanswered(NoAnswer.TIMEOUT), False),
        (TOLERABLE, answered(DONE), True),
        (TOLERABLE, unanswered(NoAnswer.TIMEOUT), False),
        (TOLERABLE, answered(b"root:x:0:0:root:/root:/bin/sh"), False),
        (REFUSABLE, answered(b"<a>; for 16-bit app support</a>", 500), False),
        (ENTITY, answered(FAULT.replace(b"no<", f"is {MARK}<".encode()), 500), False),
    ],
)
def test_what_becomes_of_an_attack(attack, attempt, holds):
    assert attack_verdict(attack, attempt).holds is holds


def test_an_echo_of_the_request_is_no_expansion():
    echoed = Attack("internal-entity", "an entity", MARK.encode())
    assert attack_verdict(echoed, answered(FAULT.replace(b"no<", f"{MARK}<".encode()), 500)).holds


@pytest.mark.parametrize("slot", [IGNORED_SLOT, ""])
def test_attacks_fill_their_template(slot):
    template = Template(f"<m><v>{VALUE_SLOT}</v>{slot}</m>", "m", "12")
    made = list(attacks(template, lambda canary: f"http://callbacks/{canary}", 99, "here"))
    assert template.octets() == b"<m><v>12</v></m>"
    assert len({attack.name for attack in made}) == 14
    for attack in made:
        assert VALUE_SLOT.encode() not in attack.body
        assert IGNORED_SLOT.encode() not in attack.body
        if attack.canary:
            assert f"http://callbacks/{attack.canary}".encode() in attack.body

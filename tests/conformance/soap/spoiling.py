"""Faults for a proxy to put on what passes through it: functions of a request and of what forwards it."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, replace

BP = "soap-basic-profile/"


@dataclass(frozen=True)
class Ask:
    method: str
    target: str
    headers: dict[str, str]
    body: bytes


@dataclass(frozen=True)
class Reply:
    status: int
    headers: dict[str, str]
    body: bytes

    def having(self, **changes: object) -> Reply:
        return replace(self, **changes)

    def swapped(self, old: bytes, new: bytes) -> Reply:
        return replace(self, body=self.body.replace(old, new))


def answer(change):
    """Spoil every SOAP answer."""

    def fault(ask, forward):
        reply = forward(ask)
        return change(reply) if ask.method == "POST" else reply

    return fault


def to_fault(change):
    """Spoil every SOAP fault."""
    return answer(lambda reply: change(reply) if b"Fault" in reply.body else reply)


def to_response(change):
    """Spoil every SOAP response that is no fault."""
    return answer(lambda reply: reply if b"Fault" in reply.body or reply.status >= 400 else change(reply))


def described(old, new):
    """Spoil the WSDL."""

    def fault(ask, forward):
        reply = forward(ask)
        if ask.method != "GET":
            return reply
        assert re.search(old, reply.body), reply.body.decode()
        return reply.having(body=re.sub(old, new, reply.body))

    return fault


def asked(change):
    """Change what reaches the robot."""
    return lambda ask, forward: forward(change(ask)) if ask.method == "POST" else forward(ask)


def one_in(count, spoil):
    """Spoil every count-th answer only."""
    turn = itertools.count(1)
    return answer(lambda reply: spoil(reply) if next(turn) % count == 0 else reply)


def instead(when, made):
    """Answer some requests in place of the robot."""
    return lambda ask, forward: made(ask, forward) if ask.method == "POST" and when(ask) else forward(ask)


def cleaned(pattern, new=b""):
    return asked(lambda ask: replace(ask, body=re.sub(pattern, new, ask.body)))


def envelope_of(body):
    return (
        b'<s:Envelope xmlns:s="http://schemas.xmlsoap.org/soap/envelope/"><s:Body>' + body + b"</s:Body></s:Envelope>"
    )


def done(_ask, _forward):
    """Success, whatever was asked."""
    body = envelope_of(b'<r:ExecuteDeliveryRequestResponse xmlns:r="http://soap.turtlebot.mybot.org/"/>')
    return Reply(200, {"Content-Type": "text/xml; charset=utf-8"}, body)


def renamed(old, new):
    return lambda reply: reply.having(body=re.sub(old, new, reply.body))


def unreadable(when):
    """Let the robot have no XML in place of some requests."""
    return instead(when, lambda ask, forward: forward(replace(ask, body=b"<")))

"""The verdict on one attack: refused, harmless, or a breach."""

import re
from dataclasses import dataclass
from http import HTTPStatus
from typing import Final

from conformance.api.soap.attacks import LEAKS, MARK, Attack
from conformance.api.soap.calls import read_exchange
from conformance.contract.classes import LIMIT_OCTETS
from conformance.transport.exchange import Attempt, NoAnswer, Unanswered

_LEAK: Final = re.compile(LEAKS)
_REFUSED: Final = 400


@dataclass(frozen=True)
class AttackVerdict:
    """The verdict on one attack.

    Attributes:
        holds: whether the robot withstood it.
        expected: what the requirement asks for, as a noun phrase.
        found: what came instead, as a noun phrase; empty: status and media type of the response.
        cause: breaches of the same cause are one finding.
    """

    holds: bool
    expected: str
    found: str = ""
    cause: str = ""


def attack_verdict(attack: Attack, attempt: Attempt) -> AttackVerdict:
    """Return the verdict on one attack by its response, or by the lack of one."""
    # What a coding hides is over the limit once it is unpacked.
    over = len(attack.body) > LIMIT_OCTETS or any(name.lower() == "content-encoding" for name, _ in attack.headers)
    may_close = over or not attack.must_refuse
    expected = f"{'a refusal' if attack.must_refuse else 'a response'}{' or a closed connection' if may_close else ''}"
    expected += f" for {attack.what}"
    if isinstance(attempt, Unanswered):
        return AttackVerdict(is_closed(attempt) and may_close, expected)
    body = attempt.response.body
    leak = _LEAK.search(body)
    if leak:
        found = f"a response that shows {ascii(leak[0][:60])[2:-1]!r}, from a file of the robot"
        return AttackVerdict(
            holds=False, expected=f"a response without any file of the robot for {attack.what}", found=found
        )
    if attack.name == "internal-entity" and MARK.encode() in body and MARK.encode() not in attack.body:
        return AttackVerdict(
            holds=False, expected="a response without the text of an entity", found="a response with that text"
        )
    if not attack.must_refuse:
        return AttackVerdict(holds=True, expected=expected)
    answer = read_exchange(attempt)
    refused = answer.fault is not None or answer.status >= _REFUSED
    refused = refused and (may_close or answer.status != HTTPStatus.BAD_GATEWAY)
    return AttackVerdict(refused, expected, answer.describe(), f"{attack.name} taken" if answer.accepted else "")


def is_closed(attempt: Unanswered) -> bool:
    """Return whether the robot closed the connection, also in the middle of a response, which is then malformed."""
    return attempt.kind is NoAnswer.CLOSED or "closed" in attempt.problem

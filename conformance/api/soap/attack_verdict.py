"""What an attack's outcome says of a robot: refused, harmless, or a breach."""

import re
from dataclasses import dataclass
from typing import Final

from conformance.api.soap.attacks import LEAKS, MARK, Attack
from conformance.api.soap.calls import read_exchange
from conformance.transport.exchange import Attempt, NoAnswer, Unanswered

_LEAK: Final = re.compile(LEAKS)
_REFUSED: Final = 400


@dataclass(frozen=True)
class AttackVerdict:
    """What became of an attack.

    Attributes:
        holds: whether the robot did no wrong.
        expected: what was asked of it.
        found: what came instead, where what came does not say it by itself.
        cause: breaches of the same cause are one.
    """

    holds: bool
    expected: str
    found: str = ""
    cause: str = ""


def attack_verdict(attack: Attack, attempt: Attempt) -> AttackVerdict:
    """Judge one attack by its answer, or by there being none."""
    expected = f"a refusal, or the connection closed, for {attack.what}" if attack.must_refuse else "an answer"
    if isinstance(attempt, Unanswered):
        return AttackVerdict(is_closed(attempt), expected)
    body = attempt.response.body
    leak = _LEAK.search(body)
    if leak:
        found = f"the answer shows {ascii(leak[0][:60])[2:-1]!r}, of a file of the robot"
        return AttackVerdict(holds=False, expected=f"no file in the answer to {attack.what}", found=found)
    if attack.name == "internal-entity" and MARK.encode() in body and MARK.encode() not in attack.body:
        return AttackVerdict(holds=False, expected="an entity that is not expanded", found="the answer shows its text")
    if not attack.must_refuse:
        return AttackVerdict(holds=True, expected=expected)
    answer = read_exchange(attempt)
    refused = answer.fault is not None or answer.status >= _REFUSED
    return AttackVerdict(refused, expected, answer.describe(), f"{attack.name} taken" if answer.accepted else "")


def is_closed(attempt: Unanswered) -> bool:
    """Whether the robot broke the connection off, be it in the middle of an answer, which is then malformed."""
    return attempt.kind is NoAnswer.CLOSED or "closed" in attempt.problem

"""Send attacks, each over a connection of its own, followed by a harmless request; and judge them."""

import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Final

from conformance.api.expectation import expect
from conformance.api.soap.attacks import LEAKS, MARK, Attack
from conformance.api.soap.callback_server import CallbackServer
from conformance.api.soap.calls import read_exchange
from conformance.contract.classes import LIMIT_OCTETS
from conformance.transport.exchange import Attempt, Exchange, NoAnswer, NoAnswerError, Unanswered
from conformance.verdict.evidence import Judge

_LEAK: Final = re.compile(LEAKS)
_REFUSED: Final = 400
#: Below this share of the standard effort, one attack for each requirement is sent.
HALF: Final = 0.5
#: More than the number of attacks for any requirement: send all.
ALL: Final = 99


@dataclass(frozen=True)
class AttackVerdict:
    """The verdict on one attack.

    Attributes:
        holds: whether the robot withstood it.
        expected: what the requirement asks for, as a noun phrase.
        found: what came instead, as a noun phrase; empty means status and media type of the response.
        cause: breaches of the same cause are one finding.
    """

    holds: bool
    expected: str
    found: str = ""
    cause: str = ""


def attack_verdict(attack: Attack, attempt: Attempt) -> AttackVerdict:
    """Return the verdict on one attack by its response, or by the missing response."""
    # Compressed content may exceed the limit after decompression.
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
    return AttackVerdict(refused, expected, answer.describe(), f"{attack.name} taken" if answer.is_taken else "")


def is_closed(attempt: Unanswered) -> bool:
    """Return whether the robot closed the connection, also in the middle of a response, which is then malformed."""
    return attempt.kind is NoAnswer.CLOSED or "closed" in attempt.problem


# A robot is responsive if it responds within 20 times its usual time, or within a second.
_SLOWER: Final = 20
_ALWAYS_MS: Final = 1000.0
_TRIES: Final = 3
# After this many attacks that used up a deadline, the remaining attacks are left out.
_TROUBLES: Final = 3


@dataclass
class AttackRunner:
    """Attacks on one endpoint.

    Attributes:
        judge: takes what is seen.
        send: sends an attack, and returns what became of it.
        ask: sends the harmless request.
        usual_ms: how long the robot usually takes for that, ms.
        ids: the requirements that an attack is a case of.
        troubles: how often the robot let a deadline pass or was slow afterwards; after three, no more attacks are sent.
        with_canary: the attacks so far that name an address of the callback server, with their requirements.
        tempted: when the response to the last of them came, s of the monotonic clock.
    """

    judge: Judge
    send: Callable[[Attack], Attempt]
    ask: Callable[[], Exchange]
    usual_ms: float
    ids: Callable[[Attack], tuple[str, ...]] = lambda attack: (f"xml-security/{attack.name}",)
    troubles: int = 0
    with_canary: list[tuple[Attack, Attempt, tuple[str, ...]]] = field(default_factory=list)
    tempted: float = 0.0

    def attack(self, attack: Attack) -> None:
        """Send one attack and judge its outcome.

        Raises:
            NoAnswerError: the robot answers nothing any more.
        """
        if self.troubles >= _TROUBLES:
            return
        ids = self.ids(attack)
        self.judge.at_risk = (*ids, "xml-security/responsive")
        attempt = self.send(attack)
        if isinstance(attempt, Unanswered) and not is_closed(attempt):
            self.troubles += 1
        verdict = attack_verdict(attack, attempt)
        for id_ in ids:
            expect(self.judge, id_, attempt).that(verdict.holds, verdict.expected, verdict.found, cause=verdict.cause)
        if attack.canary:
            self.with_canary.append((attack, attempt, ids))
            self.tempted = time.monotonic()
        self._well(attack, attempt)
        self.judge.at_risk = ()

    def _well(self, attack: Attack, attempt: Attempt) -> None:
        """Send the harmless request; one response in time is enough, as the suite's machine may be loaded."""
        allowed = max(_ALWAYS_MS, _SLOWER * self.usual_ms)
        fastest = float("inf")
        for _ in range(_TRIES):
            fastest = min(fastest, self.ask().response.elapsed_ms)
            if fastest <= allowed:
                break
        else:
            self.troubles += 1
        expect(self.judge, "xml-security/responsive", attempt).that(
            fastest <= allowed,
            f"a response to a harmless request within {allowed:.0f} ms after {attack.what}",
            f"a response after {fastest:.0f} ms",
            cause=f"slow after {attack.name}",
        )


def judge_calls(judge: Judge, callbacks: CallbackServer, runners: Sequence[AttackRunner]) -> None:
    """Judge whether any attack made a robot open a connection, after a moment for a robot that does so late."""
    with_canary = [unanswered for runner in runners for unanswered in runner.with_canary]
    if with_canary:
        callbacks.settle(max(runner.tempted for runner in runners))
    for attack, exchange, ids in with_canary:
        for id_ in {"xml-security/no-callback": None, **dict.fromkeys(ids)}:
            expect(judge, id_, exchange).that(
                not callbacks.calls(attack.canary),
                f"no request from the robot for {attack.what}",
                f"a request from the robot for {callbacks.url(attack.canary)}",
                cause=f"called for {attack.name}",
            )


def outcome(send: Callable[[], Exchange]) -> Attempt:
    """Send an attack and return its outcome; a broken connection is an outcome as well.

    Raises:
        NoAnswerError: no connection could be opened.
    """
    try:
        return send()
    except NoAnswerError as none:
        if none.kind in {NoAnswer.REFUSED, NoAnswer.TLS, NoAnswer.CIRCUIT_OPEN, NoAnswer.HURRIED}:
            raise
        return none.unanswered

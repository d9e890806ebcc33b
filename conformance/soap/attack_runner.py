"""Sending attacks: each over a connection of its own, with the robot asked afterwards whether it is still well."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from conformance.soap.attacks import LEAKS, MARK
from conformance.soap.calls import read_exchange
from conformance.transport.exchange import NoAnswer, NoAnswerError, Unanswered

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from conformance.soap.attacks import Attack
    from conformance.soap.callback_server import Trap
    from conformance.transport.exchange import Attempt, Exchange
    from conformance.verdict.evidence import Judge

_LEAK: Final = re.compile(LEAKS)
# A robot is well if it answers within 20 times its usual time, and within a second in any case.
_SLOWER: Final = 20
_ALWAYS_MS: Final = 1000.0
_TRIES: Final = 3
# Attacks that cost a deadline, after which the rest is left out: what a robot does then is known.
_TROUBLES: Final = 3
_REFUSED: Final = 400


@dataclass
class Siege:
    """Attacks on one endpoint.

    Attributes:
        judge: takes what is seen.
        send: sends an attack, and returns what became of it, whether the robot answered or not.
        ask: sends the harmless request.
        usual_ms: how long the robot takes for that.
        ids: the requirements that an attack is a case of.
        troubles: how often the robot let a deadline pass or was slow afterwards. After three that is known.
        lured: the attacks so far that name an address of the trap, with what they are cases of.
    """

    judge: Judge
    send: Callable[[Attack], Attempt]
    ask: Callable[[], Exchange]
    usual_ms: float
    ids: Callable[[Attack], tuple[str, ...]] = lambda attack: (f"xml-security/{attack.name}",)
    troubles: int = 0
    lured: list[tuple[Attack, Attempt, tuple[str, ...]]] = field(default_factory=list)

    def attack(self, attack: Attack) -> None:
        """Send one attack and judge what became of it.

        Raises:
            NoAnswerError: the robot answers nothing any more.
        """
        if self.troubles >= _TROUBLES:
            return
        ids = self.ids(attack)
        self.judge.at_risk = (*ids, "xml-security/responsive")
        attempt = self.send(attack)
        if isinstance(attempt, Unanswered) and not _closed(attempt):
            self.troubles += 1
        for id_ in ids:
            self._judge(id_, attack, attempt)
        if attack.lure:
            self.lured.append((attack, attempt, ids))
        self._well(attack, attempt)
        self.judge.at_risk = ()

    def _judge(self, id_: str, attack: Attack, attempt: Attempt) -> None:
        refusal = f"a refusal, or the connection closed, for {attack.what}"
        if isinstance(attempt, Unanswered):
            self.judge.check(id_, _closed(attempt), attempt, refusal if attack.must_refuse else "an answer")
            return
        answer, body, exchange = read_exchange(attempt), attempt.response.body, attempt
        leak = _LEAK.search(body)
        if leak:
            found = f"the answer shows {ascii(leak[0][:60])[2:-1]!r}, of a file of the robot"
            self.judge.check(id_, False, exchange, f"no file in the answer to {attack.what}", found=found)  # noqa: FBT003 - the condition
        elif attack.name == "internal-entity" and MARK.encode() in body and MARK.encode() not in attack.body:
            self.judge.check(id_, False, exchange, "an entity that is not expanded", found="the answer shows its text")  # noqa: FBT003 - the condition
        elif not attack.must_refuse:
            self.judge.check(id_, True, exchange, "an answer")  # noqa: FBT003 - the condition
        else:
            self.judge.check(
                id_,
                answer.fault is not None or answer.status >= _REFUSED,
                exchange,
                refusal,
                found=answer.describe(),
                cause=f"{attack.name} taken" if answer.accepted else "",
            )

    def _well(self, attack: Attack, attempt: Attempt) -> None:
        """Ask the harmless request: one answer in time is enough, for a loaded machine is no attacked robot."""
        allowed = max(_ALWAYS_MS, _SLOWER * self.usual_ms)
        fastest = float("inf")
        for _ in range(_TRIES):
            fastest = min(fastest, self.ask().response.elapsed_ms)
            if fastest <= allowed:
                break
        else:
            self.troubles += 1
        self.judge.check(
            "xml-security/responsive",
            fastest <= allowed,
            attempt,
            f"an answer within {allowed:.0f} ms after {attack.what}",
            found=f"{fastest:.0f} ms",
            cause=f"slow after {attack.name}",
        )


def judge_calls(judge: Judge, trap: Trap, sieges: Iterable[Siege]) -> None:
    """Judge whether any attack made a robot call, after a moment for a robot that calls in its own time."""
    lured = [one for siege in sieges for one in siege.lured]
    if lured:
        trap.settle()
    for attack, exchange, ids in lured:
        for id_ in {"xml-security/no-callback": None, **dict.fromkeys(ids)}:
            judge.check(
                id_,
                not trap.calls(attack.lure),
                exchange,
                f"no connection for {attack.what}",
                found=f"the robot asked for {trap.url(attack.lure)}",
                cause=f"called for {attack.name}",
            )


def outcome(send: Callable[[], Exchange]) -> Attempt:
    """Send an attack; a connection that breaks is an outcome as well.

    Raises:
        NoAnswerError: no connection came about.
    """
    try:
        return send()
    except NoAnswerError as none:
        if none.kind in {NoAnswer.REFUSED, NoAnswer.TLS, NoAnswer.CIRCUIT_OPEN}:
            raise
        return none.unanswered


def _closed(attempt: Unanswered) -> bool:
    """Whether the robot broke the connection off, be it in the middle of an answer, which is then malformed."""
    return attempt.kind is NoAnswer.CLOSED or "closed" in attempt.problem

"""Sending attacks: each over a connection of its own, with the robot asked afterwards whether it is still well."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

from conformance.api.soap.attack_verdict import attack_verdict, is_closed
from conformance.api.soap.attacks import Attack
from conformance.api.soap.callback_server import CallbackServer
from conformance.transport.exchange import Attempt, Exchange, NoAnswer, NoAnswerError, Unanswered
from conformance.verdict.evidence import Judge

# A robot is well if it answers within 20 times its usual time, and within a second in any case.
_SLOWER: Final = 20
_ALWAYS_MS: Final = 1000.0
_TRIES: Final = 3
# Attacks that cost a deadline, after which the rest is left out: what a robot does then is known.
_TROUBLES: Final = 3


@dataclass
class AttackRunner:
    """Attacks on one endpoint.

    Attributes:
        judge: takes what is seen.
        send: sends an attack, and returns what became of it, whether the robot answered or not.
        ask: sends the harmless request.
        usual_ms: how long the robot takes for that.
        ids: the requirements that an attack is a case of.
        troubles: how often the robot let a deadline pass or was slow afterwards. After three that is known.
        with_canary: the attacks so far that name an address of the callback server, with what they are cases of.
        tempted: when the last of them was answered, s of the monotonic clock.
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
        """Send one attack and judge what became of it.

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
            self.judge.check(id_, verdict.holds, attempt, verdict.expected, found=verdict.found, cause=verdict.cause)
        if attack.canary:
            self.with_canary.append((attack, attempt, ids))
            self.tempted = time.monotonic()
        self._well(attack, attempt)
        self.judge.at_risk = ()

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


def judge_calls(judge: Judge, callbacks: CallbackServer, runners: Sequence[AttackRunner]) -> None:
    """Judge whether any attack made a robot call, after a moment for a robot that calls in its own time."""
    with_canary = [one for runner in runners for one in runner.with_canary]
    if with_canary:
        callbacks.settle(max(runner.tempted for runner in runners))
    for attack, exchange, ids in with_canary:
        for id_ in {"xml-security/no-callback": None, **dict.fromkeys(ids)}:
            judge.check(
                id_,
                not callbacks.calls(attack.canary),
                exchange,
                f"no connection for {attack.what}",
                found=f"the robot asked for {callbacks.url(attack.canary)}",
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

"""What a check expects of one response: each method judges one case of one requirement, and words the finding."""

from __future__ import annotations

from dataclasses import dataclass

from conformance.transport.exchange import Attempt, Exchange, NoAnswer, Unanswered
from conformance.verdict.evidence import Judge


@dataclass(frozen=True)
class Expectation:
    """One requirement, to be judged on one request and what became of it.

    A finding reads "Sent GET /x. Expected {expected}. Got {got}.": so both are noun phrases, and neither repeats the
    request.

    Attributes:
        judge: takes the evidence.
        requirement: id of the requirement.
        attempt: the request with its response, or why there is none; None where no request was sent.
        got: describes the response; empty: its status and media type, which a finding says anyway.
    """

    judge: Judge
    requirement: str
    attempt: Attempt | None
    got: str = ""

    def that(
        self,
        holds: bool,  # noqa: FBT001 - reads as a sentence: expect(judge, id, exchange).that(length < 5, ...)
        expected: str,
        got: str = "",
        *,
        cause: str = "",
    ) -> bool:
        """Judge one case, and return ``holds``.

        Args:
            holds: whether the response meets the requirement.
            expected: what the requirement asks for, as a noun phrase.
            got: what a look at the response showed, as a noun phrase; empty: status and media type show it.
            cause: failures of the same cause are one finding; empty: the texts without their numbers.
        """
        return self.judge.check(self.requirement, holds, self.attempt, expected, found=got or self.got, cause=cause)

    def status(
        self, *allowed: int | str, when: str = "", closed: bool = False, or_else: bool = False, cause: str = ""
    ) -> bool:
        """Judge that the response has one of some statuses.

        Args:
            allowed: statuses (404) and classes of them ("4xx").
            when: what is special about the request: "the body is text/plain".
            closed: whether the robot may close the connection instead of responding.
            or_else: whether the response meets the requirement for another reason.
            cause: by default each status is a cause of its own.
        """
        expected = f"status {' or '.join(map(str, allowed))}" + (" or a closed connection" if closed else "")
        expected += f" when {when}" if when else ""
        if isinstance(self.attempt, Exchange):
            status = self.attempt.response.status
            return self.that(or_else or is_one_of(status, allowed), expected, cause=cause or f"{status}")
        is_closed = isinstance(self.attempt, Unanswered) and self.attempt.kind is NoAnswer.CLOSED
        return self.that(or_else or (closed and is_closed), expected, cause=cause)

    def taken(self, when: str, *, or_else: bool = False, cause: str = "") -> bool:
        """Judge that a valid request was accepted, or only put off with 409 (a goal of the robot's own is active)."""
        return self.status("2xx", 409, when=when, or_else=or_else, cause=cause)

    def media_type(self, *allowed: str, when: str = "") -> bool:
        """Judge that the response has one of some media types."""
        found = self.attempt.response.media_type if isinstance(self.attempt, Exchange) else ""
        expected = f"Content-Type: {' or '.join(allowed)}" + (f" when {when}" if when else "")
        return self.that(found in allowed, expected, cause=found)

    def header(self, name: str) -> bool:
        """Judge that the response has a header field."""
        there = isinstance(self.attempt, Exchange) and self.attempt.response.header(name) is not None
        return self.that(there, f"the header field {name}", f"no header field {name}")


def expect(judge: Judge, requirement: str, attempt: Attempt | None) -> Expectation:
    """Return what a requirement expects of one request's response, to be judged by one of the methods."""
    return Expectation(judge, requirement, attempt)


def is_one_of(status: int, allowed: tuple[int | str, ...]) -> bool:
    """Return whether a status is one of some statuses (404) and classes of statuses ("4xx")."""
    return status in allowed or f"{status // 100}xx" in allowed

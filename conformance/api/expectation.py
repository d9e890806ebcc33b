"""Judge one response by one requirement: each method judges one case and words the finding."""

from dataclasses import dataclass

from conformance.transport.exchange import Attempt, Exchange, NoAnswer, Unanswered
from conformance.verdict.evidence import Judge


@dataclass(frozen=True)
class Expectation:
    """One requirement and one exchange to judge it by.

    A finding reads "Sent GET /x. Expected {expected}. Got {got}.", so both texts are noun phrases without the request.

    Attributes:
        judge: records the evidence.
        requirement: id of the requirement.
        attempt: the request with its response or the reason for a missing one; None if no request was sent.
        got: description of the response; empty means status and media type, which the finding contains anyway.
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
        """Record whether the response meets the requirement; return ``holds``.

        Args:
            holds: whether it does.
            expected: what the requirement demands, as a noun phrase.
            got: what the response showed, as a noun phrase; empty means status and media type.
            cause: failures of the same cause are one finding; empty means the texts without their numbers.
        """
        return self.judge.check(self.requirement, holds, self.attempt, expected, found=got or self.got, cause=cause)

    def status(
        self, *allowed: int | str, when: str = "", closed: bool = False, or_else: bool = False, cause: str = ""
    ) -> bool:
        """Record whether the response has one of the statuses.

        Args:
            allowed: statuses (404) and classes of statuses ("4xx").
            when: the special property of the request: "the body is text/plain".
            closed: whether the robot may close the connection instead.
            or_else: whether the response meets the requirement for another reason.
            cause: by default, each status is a cause of its own.
        """
        expected = f"status {' or '.join(map(str, allowed))}" + (" or a closed connection" if closed else "")
        expected += f" when {when}" if when else ""
        if isinstance(self.attempt, Exchange):
            status = self.attempt.response.status
            return self.that(or_else or is_one_of(status, allowed), expected, cause=cause or f"{status}")
        is_closed = isinstance(self.attempt, Unanswered) and self.attempt.kind is NoAnswer.CLOSED
        return self.that(or_else or (closed and is_closed), expected, cause=cause)

    def accepts(self, when: str, *, or_else: bool = False, cause: str = "") -> bool:
        """Record whether a valid request was accepted, or deferred with 409 because a goal is active."""
        return self.status("2xx", 409, when=when, or_else=or_else, cause=cause)

    def media_type(self, *allowed: str, when: str = "") -> bool:
        """Record whether the response has one of the media types."""
        found = self.attempt.response.media_type if isinstance(self.attempt, Exchange) else ""
        expected = f"Content-Type: {' or '.join(allowed)}" + (f" when {when}" if when else "")
        return self.that(found in allowed, expected, cause=found)

    def header(self, name: str) -> bool:
        """Record whether the response has a header."""
        if not isinstance(self.attempt, Exchange):
            return self.that(False, f"the header field {name}")  # noqa: FBT003 - see that()
        return self.that(
            self.attempt.response.header(name) is not None, f"the header field {name}", f"no header field {name}"
        )


def expect(judge: Judge, requirement: str, attempt: Attempt | None) -> Expectation:
    """Return the Expectation of a requirement for one exchange; its methods judge."""
    return Expectation(judge, requirement, attempt)


def is_one_of(status: int, allowed: tuple[int | str, ...]) -> bool:
    """Return whether a status is in a list of statuses (404) and classes of statuses ("4xx")."""
    return status in allowed or f"{status // 100}xx" in allowed

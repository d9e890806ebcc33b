"""Conditions and ranges (RFC 9110 13, 14): 304 only for a current copy, 206 only for a requested part."""

import re
from collections.abc import Iterator
from http import HTTPStatus

from conformance.checkers.occasion import Occasion
from conformance.verdict.evidence import Case

_PART = re.compile(r"bytes (?P<first>\d+)-(?P<last>\d+)/", re.IGNORECASE)
_TAG = re.compile(r'"[^"]*"')


class Conditional:
    """Judges responses to conditions, by the entity tags and dates that the run has seen."""

    def __init__(self) -> None:
        # By URL: the entity tags that were sent, and whether a time of change was.
        self._tags: dict[str, set[str]] = {}
        self._dated: set[str] = set()

    def __call__(self, occasion: Occasion) -> Iterator[Case]:
        """Yield the cases of one exchange."""
        url, answer = occasion.request.url, occasion.response
        # What comes with 304 may be what the client itself has sent.
        if answer.status != HTTPStatus.NOT_MODIFIED:
            self._tags.setdefault(url, set()).update(_TAG.findall(answer.header("etag") or ""))
            if answer.header("last-modified") is not None:
                self._dated.add(url)
        asked = {name.lower(): value for name, value in occasion.request.headers}
        yield from self._not_modified(occasion, asked)
        if "range" in asked or answer.status == HTTPStatus.PARTIAL_CONTENT:
            yield _range(occasion, asked)

    def _not_modified(self, occasion: Occasion, asked: dict[str, str]) -> Iterator[Case]:
        id_, is_unchanged = "http/preconditions", occasion.response.status == HTTPStatus.NOT_MODIFIED
        tags = _TAG.findall(asked.get("if-none-match", ""))
        if tags and asked["if-none-match"].strip() != "*":
            expected = "another status than 304 when the robot never sent the entity tag"
            has_sent = not self._tags.get(occasion.request.url, set()).isdisjoint(tags)
            yield occasion.case(id_, has_sent or not is_unchanged, expected)
        elif "if-modified-since" in asked and "if-none-match" not in asked:
            # Where a robot says when something was changed, by whatever clock, that may have been longer ago.
            expected = "another status than 304 when the resource has no Last-Modified"
            yield occasion.case(id_, not is_unchanged or occasion.request.url in self._dated, expected)
        elif is_unchanged and "if-none-match" not in asked:
            yield occasion.case(id_, False, "another status than 304 for a request without a condition")  # noqa: FBT003


def _range(occasion: Occasion, asked: dict[str, str]) -> Case:
    """Judge a request for a part: the response is the whole, or 206 with its Content-Range."""
    answer = occasion.response
    # A server may send less than was asked for, or more, and then says so (RFC 9110 15.3.7).
    part = _PART.match(answer.header("content-range") or "")
    fits = part is not None and len(answer.body) == int(part["last"]) - int(part["first"]) + 1
    fits |= occasion.context.is_head or answer.media_type == "multipart/byteranges"
    return occasion.case(
        "http/range",
        answer.status != HTTPStatus.PARTIAL_CONTENT or ("range" in asked and fits),
        "another status than 206, or a part that was asked for, and the header field Content-Range that fits it",
        f"status 206 with {len(answer.body)} bytes and Content-Range: {answer.header('content-range')}",
    )

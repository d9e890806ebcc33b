"""Content negotiation: the response format that a client's Accept field selects (RFC 9110 12.5.1)."""

from collections.abc import Sequence
from functools import lru_cache

from reference_robot.webservices.representation.problems import PROBLEM_JSON, PROBLEM_XML, Problem
from reference_robot.webservices.representation.writing import JSON, XML


@lru_cache(maxsize=256)
def chosen(accept: bytes | None, offers: Sequence[str]) -> str:
    """Return the offered media type that the client prefers, the first of equals; without Accept, the first offer.

    Raises:
        Problem: 406, if no offer is acceptable (RFC 9110 15.5.7).
    """
    ranges = _ranges(accept)
    best = max(offers, key=lambda offer: _quality(ranges, offer))  # max keeps the first of equals
    if _quality(ranges, best) > 0:
        return best
    field = (accept or b"").decode("latin-1")
    raise Problem(406, f"Accept: {field[:200]!a} excludes all formats of this resource: {', '.join(offers)}")


@lru_cache(maxsize=256)
def problem_format(accept: bytes | None) -> str:
    """Return the media type for error responses: XML if the client prefers XML to JSON, otherwise JSON."""
    ranges = _ranges(accept)
    likes_json = max(_quality(ranges, JSON), _quality(ranges, PROBLEM_JSON))
    likes_xml = max(_quality(ranges, XML), _quality(ranges, PROBLEM_XML))
    return PROBLEM_XML if likes_xml > likes_json else PROBLEM_JSON


def _ranges(accept: bytes | None) -> dict[str, float]:
    """Return the weight of each media range in an Accept field; members without a slash are ignored."""
    if accept is None or not accept.strip():
        return {"*/*": 1.0}
    ranges: dict[str, float] = {}
    for member in accept.decode("latin-1").lower().split(","):
        media_range, *parameters = (part.strip() for part in member.split(";"))
        quality = 1.0
        for parameter in parameters:
            name, _, value = parameter.partition("=")
            if name.strip() == "q":
                quality = _qvalue(value.strip())
        if "/" in media_range:
            ranges[media_range] = max(quality, ranges.get(media_range, 0.0))
    return ranges


def _qvalue(text: str) -> float:
    """Return a weight (RFC 9110 12.4.2: 0 to 1, at most three decimals); 0 for an invalid weight."""
    whole, _, decimals = text.partition(".")
    if whole not in {"0", "1"} or (decimals and not (decimals.isascii() and decimals.isdigit())):
        return 0.0
    return min(float(text), 1.0)


def _quality(ranges: dict[str, float], offer: str) -> float:
    """Return the weight of the most specific media range that matches an offer (RFC 9110 12.5.1)."""
    for media_range in (offer, offer.partition("/")[0] + "/*", "*/*"):
        if media_range in ranges:
            return ranges[media_range]
    return 0.0

"""The Accept header (RFC 9110 12.5.1)."""

import re
from functools import lru_cache

_QUALITY = re.compile(r"0(?:\.\d{0,3})?|1(?:\.0{0,3})?", re.ASCII)


@lru_cache(maxsize=512)
def quality(media_type: str, accept: str | None) -> float:
    """Return the quality value of a media type by the most specific matching range; 0 if no range matches.

    A range with parameters also matches the type without them, since the server may choose.

    Args:
        media_type: in lower case, without parameters.
        accept: value of the header; None or empty accepts everything.
    """
    if accept is None or not accept.strip():
        return 1.0
    by_range: dict[str, float] = {}
    for member in accept.lower().split(","):
        name, *parameters = (part.strip() for part in member.split(";"))
        if name:
            by_range[name] = max(by_range.get(name, 0.0), _weight(parameters))
    for candidate in (media_type, f"{media_type.split('/', 1)[0]}/*", "*/*"):
        if candidate in by_range:
            return by_range[candidate]
    return 0.0


def _weight(parameters: list[str]) -> float:
    for parameter in parameters:
        name, _, value = parameter.partition("=")
        if name.strip() == "q":
            return float(value.strip()) if _QUALITY.fullmatch(value.strip()) else 0.0
    return 1.0


def accept_of(headers: tuple[tuple[str, str], ...]) -> str | None:
    """Return the Accept header of a request, several lines joined; None without one."""
    values = [value for name, value in headers if name.lower() == "accept"]
    return ", ".join(values) if values else None

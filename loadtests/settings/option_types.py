"""Options whose text has a form of its own: lists of numbers, and a percentage."""

from collections.abc import Callable
from typing import Any

import click


def _parsed(read: Callable[[str], Any], expected: str) -> Callable[[click.Context, click.Parameter, str | None], Any]:
    """Return a callback that parses an option's text with `read`, or raises a usage error with `expected`."""

    def callback(_: click.Context, __: click.Parameter, value: str | None) -> Any:
        try:
            return read(value or "")
        except ValueError:
            raise click.BadParameter(f"{value!r} is not {expected}") from None

    return callback


RATES = _parsed(
    lambda text: tuple(float(part) for part in text.split(",")) if text else (), "a list of rates such as 100,200,400"
)
COUNTS = _parsed(
    lambda text: tuple(sorted({int(part) for part in text.split(",")})) if text else (),
    "a list of numbers such as 1,8,32,128,512",
)
SHARE = _parsed(lambda text: float(text.removesuffix("%")) / 100, "a percentage such as 5%")

"""Format numbers with their significant digits, and missing numbers as a dash."""

from collections.abc import Sequence

NONE = "\N{EN DASH}"

# From these values on, further digits are not significant.
_TENTHS_MS = 10
_WHOLE_MS = 1000
_WHOLE_RATE = 100
_WHOLE_PERCENT = 10


def ms(value: float | None) -> str:
    """Return milliseconds as text with three decimals below 10, and fewer above: 0.074, 12.3, 1,810."""
    if value is None:
        return NONE
    size = abs(value)
    digits = 3 if size < _TENTHS_MS else 1 if size < _WHOLE_MS else 0
    return f"{value:,.{digits}f}"


def ratio(value: float | None) -> str:
    """Return a ratio as text with two decimals, or a dash for None."""
    return NONE if value is None else f"{value:.2f}"


def rate(value: float | None) -> str:
    """Return requests per second as text: 4,000, or 12.5; a dash for None."""
    if value is None:
        return NONE
    return f"{value:,.0f}" if value >= _WHOLE_RATE or value == int(value) else f"{value:.1f}"


def share(value: float | None) -> str:
    """Return a share as a percentage with two significant digits, whole from 10 %: 0.043 %, 120 %."""
    if value is None:
        return NONE
    percent = value * 100
    return f"{percent:,.0f} %" if percent >= _WHOLE_PERCENT else f"{percent:.2g} %"


def interval(bounds: Sequence[float] | None, *, of_ratio: bool = False) -> str:
    """Return an interval of milliseconds or of ratios as text: 1.58 to 1.63; a dash for None."""
    if bounds is None:
        return NONE
    write = ratio if of_ratio else ms
    return f"{write(bounds[0])} to {write(bounds[1])}"

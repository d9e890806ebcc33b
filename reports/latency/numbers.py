"""How figures are written: as many digits as they carry, units apart, and a dash where there is none."""

from collections.abc import Sequence

NONE = "\N{EN DASH}"

# From these figures on, further digits say nothing.
_TENTHS_MS = 10
_WHOLE_MS = 1000
_WHOLE_RATE = 100
_WHOLE_PERCENT = 10


def ms(value: float | None) -> str:
    """Milliseconds with microsecond resolution below 10, fewer digits above: 0.074, 12.3, 1,810."""
    if value is None:
        return NONE
    size = abs(value)
    digits = 3 if size < _TENTHS_MS else 1 if size < _WHOLE_MS else 0
    return f"{value:,.{digits}f}"


def ratio(value: float | None) -> str:
    """A ratio with two decimals."""
    return NONE if value is None else f"{value:.2f}"


def rate(value: float | None) -> str:
    """Requests a second: 4,000, or 12.5."""
    if value is None:
        return NONE
    return f"{value:,.0f}" if value >= _WHOLE_RATE or value == int(value) else f"{value:.1f}"


def share(value: float | None) -> str:
    """A share as a percentage with two significant digits, and whole from 10 % on: 0.043 %, 120 %."""
    if value is None:
        return NONE
    percent = value * 100
    return f"{percent:,.0f} %" if percent >= _WHOLE_PERCENT else f"{percent:.2g} %"


def interval(bounds: Sequence[float] | None, *, of_ratio: bool = False) -> str:
    """An interval as "1.58 to 1.63"; both bounds in the form of their kind."""
    if bounds is None:
        return NONE
    write = ratio if of_ratio else ms
    return f"{write(bounds[0])} to {write(bounds[1])}"

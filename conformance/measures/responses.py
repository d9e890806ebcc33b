"""Find how a device's numbers change while it is driven: as a velocity, as a position, or not at all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import median
from typing import Final, NamedTuple

from conformance.measures.samples import SEVERAL, Noise, Sample, slope

# A number has changed by a drive if it moved by _FAR standard deviations, and at least by _LEAST.
_FAR: Final = 6.0
_LEAST: Final = 1e-6
# A number that changes at rest by this share of its rate while driving changes by itself, like a clock.
_BY_ITSELF: Final = 0.3
# Share of its driving value that a velocity may have at rest.
_RESTS: Final = 0.3
# First share of a drive, in which the device accelerates.
_RISES: Final = 0.4
# Two drives agree if their ratios differ by less than this share.
_ALIKE: Final = 0.4


class Response(NamedTuple):
    """How one number responds to a velocity.

    Attributes:
        is_position: whether it changes and stays; else it rises and falls back.
        ratio: its rate, or its value, for velocity 1.
        sigma: the standard deviation of its noise at rest.
    """

    is_position: bool
    ratio: float
    sigma: float


def response_to(
    velocity: float, before: Sequence[Sample], during: Sequence[Sample], after: Sequence[Sample]
) -> Response | None:
    """Return how a number responds to a velocity; None if it does not, or not usably.

    Args:
        velocity: what was commanded, other than 0.
        before: at rest.
        during: from the response to the first command until the velocity ended.
        after: at rest again.
    """
    if min(len(before), len(during), len(after)) < SEVERAL:
        return None
    noise = Noise.of([value for _, value in before])
    start, end = median(value for _, value in before), median(value for _, value in after[-SEVERAL:])
    begun = during[0][0] + _RISES * (during[-1][0] - during[0][0])
    steady = [pair for pair in during if pair[0] >= begun]
    rate, by_itself = slope(steady), slope(before)
    level = median(value for _, value in steady) - start
    least = max(_FAR * noise.sigma, _LEAST, 1e-9 * abs(start))
    if rate is None or max(abs(end - start), abs(level)) <= least:
        return None
    if abs(by_itself or 0.0) * (before[-1][0] - before[0][0]) > least and abs(by_itself or 0.0) > _BY_ITSELF * abs(
        rate
    ):
        return None
    if abs(start) <= _RESTS * abs(level + start) and abs(end - start) <= _RESTS * abs(level) and abs(level) > least:
        return Response(is_position=False, ratio=(level + start) / velocity, sigma=noise.sigma)
    if abs(end - start) > least and rate * (end - start) > 0:
        return Response(is_position=True, ratio=rate / velocity, sigma=noise.sigma)
    return None


def agreement(responses: Sequence[Response | None]) -> Response | None:
    """Return a number's response, if drives forth and back at one velocity agree; else None."""
    found = [response for response in responses if response is not None]
    if len(found) < len(responses) or not found or len({response.is_position for response in found}) > 1:
        return None
    ratio = sum(response.ratio for response in found) / len(found)
    if any(abs(response.ratio - ratio) > _ALIKE * abs(ratio) for response in found):
        return None
    return Response(found[0].is_position, ratio, max(response.sigma for response in found))


def rests_from(samples: Sequence[Sample], sigma: float, moving: float) -> float | None:
    """Return the time from which a number stays at its final value; None if it still changes.

    Args:
        samples: after the last command.
        sigma: the standard deviation of its noise.
        moving: how fast it changes under way, per second.
    """
    last = samples[-2 * SEVERAL :]
    if len(last) < 2 * SEVERAL:
        return None
    rate = slope(last)
    room = max(_FAR * sigma, _LEAST)
    if rate is None or abs(rate) * (last[-1][0] - last[0][0]) > max(
        room, 0.1 * abs(moving) * (last[-1][0] - last[0][0])
    ):
        return None
    end = median(value for _, value in last)
    since = math.inf
    for moment, value in reversed(samples):
        if abs(value - end) > max(room, 0.02 * abs(moving)):
            break
        since = moment
    return since

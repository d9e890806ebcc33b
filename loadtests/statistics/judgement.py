"""Decide which claim a comparison supports, by its interval and by the A/A control (an interface against itself).

The A/A control is measured in the same blocks and for as long as the comparison. Where its own interval does not
contain 1, the method is biased in this run, by up to that much. Where the effect lies inside its interval, an interface
differs as much from itself. Neither is called a difference.
"""

import math
from dataclasses import dataclass, replace
from typing import Literal

from loadtests.statistics.rounds import Interval

Verdict = Literal["differs", "bounded", "noise", "none"]
#: An interval that includes both twice as long and half as long is inconclusive.
_SHARP = 2.0


@dataclass(frozen=True)
class Judgement:
    """The claim that a comparison supports.

    Attributes:
        verdict: `differs`: the ratio is significant; `bounded`: it is at least beyond `bound`; `noise`: it is not
            significant, and one beyond `bound` is excluded; `none`: inconclusive.
        bound: a ratio; for `noise` a factor of 1 or more, whichever side is slower.
        reason: why no more can be claimed.
    """

    verdict: Verdict
    bound: float | None = None
    reason: str | None = None


def judge(ratio: float, effect: Interval | None, control: Interval | None) -> Judgement:
    """Judge a ratio by its 95 % interval and by the interval of the A/A control."""
    if effect is None or control is None:
        return Judgement("none", reason=f"the run is too short for an {'' if effect is None else 'A/A '}interval")
    if ratio < 1:  # the same question from the other side
        mirrored = judge(1 / ratio, (1 / effect[1], 1 / effect[0]), (1 / control[1], 1 / control[0]))
        return mirrored if mirrored.verdict != "bounded" else replace(mirrored, bound=1 / (mirrored.bound or 1.0))
    low, high = effect
    reach = max(control[1], 1 / control[0])
    biased = not control[0] <= 1 <= control[1]
    if not biased and ratio > reach and low > 1:
        return Judgement("differs")
    if biased and (bound := _beyond_bias(ratio, low, control)) > 1:
        return Judgement("bounded", bound, _biased(control))
    bound = max(high, 1 / low) * (reach if biased else 1.0)
    if bound > _SHARP:
        return Judgement("none", bound, f"even a factor of {_SHARP:g} is not excluded")
    inside = _biased(control) if biased else "an interface differs from itself by as much (A/A control)"
    return Judgement("noise", bound, inside)


def _beyond_bias(ratio: float, low: float, control: Interval) -> float:
    """Return the least ratio that is left after the bias that the A/A control shows.

    Ratio and bias come from different blocks, so that their uncertainties add as variances do (JCGM 100:2008, GUM,
    5.1.2), on the logarithmic scale. The direction of the bias is unknown: the worse one is assumed.
    """
    bias, uncertain = math.sqrt(control[0] * control[1]), math.log(control[1] / control[0]) / 2
    return ratio / max(bias, 1 / bias) * math.exp(-math.hypot(math.log(ratio / low), uncertain))


def _biased(control: Interval) -> str:
    return f"the A/A control came to {min(control):.3f} to {max(control):.3f} times, which does not include 1"

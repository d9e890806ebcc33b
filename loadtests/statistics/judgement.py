"""What a comparison may claim: its interval and the A/A run, one interface against itself, decide together.

The A/A run is measured by the same blocks and as long as the duel. Where its own interval does not hold 1 the method
is biased in this run, by up to that much; where the effect lies inside of it, an interface differs as much from
itself. Neither is called a difference.
"""

import math
from dataclasses import dataclass, replace
from typing import Literal

from loadtests.statistics.between_runs import Interval

Verdict = Literal["differs", "bounded", "noise", "none"]
#: An interval that leaves open whether a side takes twice as long, or half, carries no statement.
_SHARP = 2.0


@dataclass(frozen=True)
class Judgement:
    """What may be claimed.

    Attributes:
        verdict: `differs`: the ratio is what it is, within its interval; `bounded`: it is beyond `bound`; `noise`: no
            difference can be told from noise, and one beyond `bound` is excluded; `none`: nothing can be said.
        bound: a ratio; as a factor of 1 or more for `noise`, whichever side is the slower.
        reason: why there is no more to say.
    """

    verdict: Verdict
    bound: float | None = None
    reason: str | None = None


def judge(ratio: float, effect: Interval | None, noise: Interval | None) -> Judgement:
    """Judge a ratio by its 95 % interval and by the interval of the A/A control."""
    if effect is None or noise is None:
        return Judgement("none", reason=f"the run is too short for an {'' if effect is None else 'A/A '}interval")
    if ratio < 1:  # the same question from the other side
        mirrored = judge(1 / ratio, (1 / effect[1], 1 / effect[0]), (1 / noise[1], 1 / noise[0]))
        return mirrored if mirrored.verdict != "bounded" else replace(mirrored, bound=1 / (mirrored.bound or 1.0))
    low, high = effect
    reach = max(noise[1], 1 / noise[0])
    biased = not noise[0] <= 1 <= noise[1]
    if not biased and ratio > reach and low > 1:
        return Judgement("differs")
    if biased and (bound := _beyond_bias(ratio, low, noise)) > 1:
        return Judgement("bounded", bound, _biased(noise))
    bound = max(high, 1 / low) * (reach if biased else 1.0)
    if bound > _SHARP:
        return Judgement("none", bound, f"even a factor of {_SHARP:g} is not excluded")
    inside = _biased(noise) if biased else "the effect is no greater than an interface may differ from itself"
    return Judgement("noise", bound, inside)


def _beyond_bias(ratio: float, low: float, noise: Interval) -> float:
    """Return the least ratio that is left after the bias that the A/A control shows.

    Ratio and bias are known by their intervals, each by blocks of its own, so that their uncertainties add as variances
    do (JCGM 100:2008, GUM, 5.1.2), on the logarithmic scale. Which way the bias goes is not known: the worse is taken.
    """
    bias, uncertain = math.sqrt(noise[0] * noise[1]), math.log(noise[1] / noise[0]) / 2
    return ratio / max(bias, 1 / bias) * math.exp(-math.hypot(math.log(ratio / low), uncertain))


def _biased(noise: Interval) -> str:
    return f"an interface against itself came to {min(noise):.3f} to {max(noise):.3f} times, which leaves 1 out"

"""Going on with the comparison of two robots while it is undecided."""

from collections.abc import Callable, Sequence

from loadtests.schedule.plan import Plan
from loadtests.settings.settings import Against
from loadtests.statistics.against import UNCLEAR, against
from loadtests.statistics.comparisons import aa_controls
from loadtests.statistics.measured import Measured
from loadtests.statistics.recorder import Recorder


def until_decided(
    plan: Plan,
    other: Against,
    recorder: Recorder,
    carry_out: Callable[[Plan], None],
    is_over: Callable[[], bool],
    tell: Callable[[str], None],
) -> Plan:
    """Measure further parts while the comparison is undecided and the settings allow it; return the last plan.

    Args:
        plan: what was carried out before.
        other: the settings of the comparison.
        recorder: the records.
        carry_out: carries out a plan.
        is_over: whether the run has to end.
        tell: says what happens.
    """
    plans = [plan]
    for look in other.looks[1:]:
        if is_over() or not _is_unclear(plans, other, recorder):
            break
        seconds = (look - len(plans)) * plan.load.duration_s
        tell(f"not clear yet whether this robot is slower than the other: measuring for another {seconds:g} s")
        while len(plans) < look and not is_over():
            plans.append(plans[-1].more())
            carry_out(plans[-1])
    return plans[-1]


def _is_unclear(plans: Sequence[Plan], other: Against, recorder: Recorder) -> bool:
    recorder.flush()
    measured = Measured(plans, recorder)
    return against(measured, aa_controls(measured), other.tolerance, len(other.looks), {}).verdict == UNCLEAR

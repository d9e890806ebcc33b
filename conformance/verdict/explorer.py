"""Explore cases with Hypothesis: it generates and shrinks them, and the judge records the failures."""

from __future__ import annotations

import os
import time
import zlib
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hypothesis import HealthCheck, Phase, Verbosity, given, seed, settings
from hypothesis.configuration import set_hypothesis_home_dir
from hypothesis.errors import Flaky
from hypothesis.internal.conjecture import providers
from hypothesis.stateful import RuleBasedStateMachine, run_state_machine_as_test

from conformance.transport.exchange import NoAnswerError
from conformance.verdict.effort import Tally
from conformance.verdict.evidence import RefutedError
from conformance.verdict.time_limit import TimeIsOverError

if TYPE_CHECKING:
    from collections.abc import Callable

    from hypothesis.strategies import SearchStrategy

    from conformance.verdict.effort import Effort

# Hypothesis also takes values from the source of loaded modules outside site-packages. The cases would then depend on
# how the suite is installed, and reading the source takes a quarter of a second.
providers._get_local_constants = lambda: providers._local_constants  # noqa: SLF001 - there is no setting for it
# Do not write Hypothesis's folder into the user's working directory. Kept once, its table of characters saves a third
# of a second.
if "HYPOTHESIS_STORAGE_DIRECTORY" not in os.environ:
    with suppress(RuntimeError):  # a user without a home, as in some containers
        set_hypothesis_home_dir(Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "roaas/hypothesis")


class Explorer:
    """Runs properties with cases that depend only on the run's seed and the check's name.

    Args:
        run_seed: seed of the run.
        name: name of the check.
        effort: how many cases, and how much time.
        tally: counts of generated cases; updated.
    """

    def __init__(self, run_seed: int, name: str, effort: Effort, tally: Tally | None = None) -> None:
        self._run_seed = run_seed
        self._name = name
        self._effort = effort
        self._tally = tally or Tally()
        self._count = 0

    def __call__(self, strategy: SearchStrategy[Any], try_case: Callable[[Any], None], *, cases: int) -> None:
        """Call ``try_case`` with values of ``strategy``, and shrink a failing value.

        Args:
            strategy: generates values.
            try_case: sends requests and calls the judge; judge.require() ends a failing case.
            cases: number of cases at standard effort.

        Raises:
            NoAnswerError: the robot did not respond.
            TimeIsOverError: the time of the run is over.
        """
        until = time.monotonic() + self._effort.longest_s
        self._tally.planned += self._effort.cases(cases)
        silence: list[NoAnswerError | TimeIsOverError] = []
        refuted: list[bool] = []

        def judge_in_time(value: Any) -> None:
            if silence:
                return
            if time.monotonic() > until:
                # After a failure, the remaining examples only make it smaller: they are no cases.
                if not refuted:
                    self.left_out(1)
                return
            try:
                try_case(value)
            except (NoAnswerError, TimeIsOverError) as none:
                silence.append(none)
            except RefutedError:
                refuted.append(True)
                raise

        prop = seed(self._next_seed())(self._settings(cases)(given(strategy)(judge_in_time)))
        _swallow_refuted(prop)
        if silence:
            raise silence[0]

    def machine(self, factory: Callable[[], RuleBasedStateMachine], *, cases: int, steps: int) -> None:
        """Run a Hypothesis state machine: ``cases`` sequences of up to ``steps`` steps at standard effort.

        Raises:
            NoAnswerError: the robot did not respond.
        """
        # Sequences of steps are not made smaller: on a moving robot each try would cost seconds.
        chosen = settings(self._settings(cases), stateful_step_count=steps, phases=(Phase.generate,))
        self._tally.planned += self._effort.cases(cases) * steps
        # A new function each time: Hypothesis stores the seed on it, and the factory may be a class.
        seeded: Any = seed(self._next_seed())(partial(factory))
        _swallow_refuted(lambda: run_state_machine_as_test(seeded, settings=chosen))

    def left_out(self, cases: int) -> None:
        """Record how many generated cases were not tried because time ran out."""
        if cases:
            self._tally.cut_short[self._name] = self._tally.cut_short.get(self._name, 0) + cases

    def _next_seed(self) -> int:
        self._count += 1
        return zlib.crc32(f"{self._run_seed}/{self._name}/{self._count}".encode())

    def _settings(self, cases: int) -> settings:
        return settings(
            max_examples=self._effort.cases(cases),
            database=None,
            deadline=None,
            derandomize=False,
            phases=(Phase.explicit, Phase.generate, Phase.shrink),
            suppress_health_check=list(HealthCheck),
            report_multiple_bugs=False,
            print_blob=False,
            verbosity=Verbosity.quiet,
        )


def _swallow_refuted(run: Callable[[], object]) -> None:
    """Run a property and ignore failures, which the judge has recorded.

    This includes Hypothesis's error about an intermittent failure that it cannot reproduce.
    """
    try:
        run()
    except (RefutedError, Flaky):
        return
    except BaseExceptionGroup as group:
        _, rest = group.split((RefutedError, Flaky))
        if rest is not None:
            raise

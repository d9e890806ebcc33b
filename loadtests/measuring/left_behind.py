"""The file that a worker leaves when its master is gone: the figures of its own share, for people to read.

Nothing reads the file, and it contains no verdict, because the other workers' shares are missing. But the figures of a
long run are not lost.
"""

import os
import platform
from pathlib import Path
from typing import Any

import msgspec

from conformance.commandline.out_folder import write_json
from loadtests.schedule.plan import Plan
from loadtests.statistics.recorder import Recorder

FORMAT = "roaas-worker/1"


class LeftBehind:
    """The reports of a worker, kept so that the worker can write them to a file if the master dies."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.recorder = Recorder()
        self.plans: list[Plan] = []
        self._place = (0, 0)

    def begin(self, plan: Plan, worker: int) -> None:
        """Set the plan to which the next reports belong; reports of load steps are not kept."""
        self._place = (worker, plan.workers)
        if plan.step_rate is None:
            self.plans.append(plan)

    def add(self, report: dict[str, Any]) -> None:
        """Keep a report in the format of `Recorder.take`."""
        self.recorder.merge(Recorder.unpack(report))

    @property
    def requests(self) -> int:
        """Return how many requests are kept."""
        return sum(cell.service.total + cell.errors for cell in self.recorder.cells.values())

    def write(self, why: str) -> Path | None:
        """Write the reports to a file and return its path; return None if there are no reports.

        Raises:
            OSError: the folder cannot be written to.
        """
        if not self.plans or not self.requests:
            return None
        # SciPy comes with these and takes a second to import, which no worker of a master that lives has to wait for.
        from loadtests.statistics import figures, over_time  # noqa: PLC0415
        from loadtests.statistics.measured import Measured  # noqa: PLC0415

        worker, workers = self._place
        document = {
            "format": FORMAT,
            "why": why,
            "worker": worker + 1,
            "workers": workers,
            "host": platform.node(),
            "pid": os.getpid(),
            "requests": self.requests,
            "plan": self.plans[0].as_message(),
            "series": msgspec.to_builtins(figures.series(Measured(self.plans, self.recorder), {})),
            "errors": over_time.errors(self.recorder, self.plans[0].operations),
        }
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"worker-{platform.node()}-{os.getpid()}.json"
        return write_json(path, document, indent=1, allow_nan=False)

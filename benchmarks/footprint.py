"""What a process uses, as Linux tells it."""

import os
from dataclasses import dataclass
from pathlib import Path


@dataclass
class Footprint:
    """Resident megabytes (what processes share counts in each), descriptors, threads, seconds of processor so far."""

    megabytes: float
    descriptors: int
    threads: int
    processor: float

    @classmethod
    def of(cls, pid: int) -> "Footprint":
        """Look at a process."""
        proc = Path(f"/proc/{pid}")
        pages = int((proc / "statm").read_text().split()[1])
        fields = (proc / "stat").read_text().rpartition(")")[2].split()
        return cls(
            pages * os.sysconf("SC_PAGE_SIZE") / 1e6,
            len(list((proc / "fd").iterdir())),
            len(list((proc / "task").iterdir())),
            (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"),
        )

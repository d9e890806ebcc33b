"""The files that come of a run, each written completely or not at all."""

import io
import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

from hdrh.histogram import HdrHistogram

from conformance.commandline.atomic_write import write_atomically, write_json
from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.result_command import CommandResult

FORMAT = "roaas-latency/1"
_NO_NAME = re.compile(r"[^A-Za-z0-9.-]+")
_TICKS = 5  # percentiles reported for each halving of the distance to 100 %
_US_PER_MS = 1000.0


def write(folder: Path, result: dict[str, Any]) -> Path:
    """Write everything into a folder, which is made if need be; returns latency.json's path."""
    folder.mkdir(parents=True, exist_ok=True)
    taken: Counter[str] = Counter()
    for series in result["series"]:
        name = _NO_NAME.sub("_", series["operation"]).strip("_")  # GET /axes/{id} is no name of a file
        stem = f"{name}-{series['interface']}-{series['client']}"
        taken[stem] += 1
        stem += f"-{taken[stem]}" if taken[stem] > 1 else ""
        for time, key in (("service", "histogram"), ("response", "response_histogram")):
            write_atomically(folder / f"{stem}-{time}.hgrm", percentile_distribution(series[key]))
    return write_json(folder / "latency.json", result, indent=1, allow_nan=False)


def with_unstopped(result: CommandResult, why: str) -> CommandResult:
    """Write into latency.json that the robot may still move, and why; return the result, which has not passed then.

    Raises:
        OSError: the file cannot be written.
    """
    if result.file is not None:
        document = json.loads(result.file.read_text(encoding="utf-8"))
        document |= {"stop_undelivered": why, "notes": [why, *document["notes"]]}
        document["exit_code"] = document["exit_code"] or int(ExitCode.INCONCLUSIVE)
        write_json(result.file, document, indent=1, allow_nan=False)
    return result._replace(exit_code=result.exit_code or ExitCode.INCONCLUSIVE)


def percentile_distribution(encoded: str) -> str:
    """Return HdrHistogram's percentile distribution as text, in milliseconds, for its plotter."""
    histogram = HdrHistogram.decode(encoded)
    text = io.BytesIO()
    histogram.output_percentile_distribution(text, _US_PER_MS, _TICKS)
    return text.getvalue().decode("ascii")

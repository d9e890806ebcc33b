"""The files that come of a run, each written completely or not at all; and results stored by name as baselines.

A baseline is a folder of latency.json files, named by when they were measured; a later run is compared with the latest.
"""

import io
import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

from hdrh.histogram import HdrHistogram

from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.help_pages import inert
from conformance.commandline.out_folder import write_atomically, write_json
from conformance.commandline.result_command import CommandResult

FORMAT = "roaas-latency/1"
_NO_NAME = re.compile(r"[^A-Za-z0-9.-]+")
_TICKS = 5  # percentiles reported for each halving of the distance to 100 %
_US_PER_MS = 1000.0


def write(folder: Path, result: dict[str, Any]) -> Path:
    """Write all files into a folder, created if needed; return latency.json's path."""
    folder.mkdir(parents=True, exist_ok=True)
    taken: Counter[str] = Counter()
    for series in result["series"]:
        # an operation such as GET /axes/{id} is no valid file name
        name = _NO_NAME.sub("_", series["operation"]).strip("_")
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


def with_operators(result: CommandResult, found: dict[str, Any], code: int) -> CommandResult:
    """Write the stops beside other operators into latency.json; their exit code counts if the run itself passed."""
    if result.file is None:
        return result
    document = json.loads(result.file.read_text(encoding="utf-8"))
    document |= {"operators": found, "exit_code": document["exit_code"] or int(code)}
    write_json(result.file, document, indent=1, allow_nan=False)
    return result._replace(exit_code=result.exit_code or code)


def stops_lines(file: Path | None) -> list[str]:
    """Return lines on the stops in latency.json, one for each number of operators beside them."""
    found = None if file is None else json.loads(file.read_text(encoding="utf-8")).get("operators")
    if found is None:
        return []
    promised = f" (by the motion map: {found['promised_ms']:g} ms)" if found["promised_ms"] else ""
    lines = []
    for each in found["by_number"]:
        if not each["stops"]:
            continue
        rest, answer = each["rest_ms"], each["answer_ms"]
        late = f"; it moved on for too long after {each['late']} of {each['stops']}" if each["late"] else ""
        who = f"{each['operators']} operator{'' if each['operators'] == 1 else 's'}"
        lines.append(
            f"{who}: the device rested {rest['p50']:.0f} ms after a stop at the median, {rest['max']:.0f} ms at most, "
            f"known to {each['known_to_ms']:.0f} ms{promised}; the response took {answer['p50']:.1f} ms at the median, "
            f"{answer['max']:.1f} ms at most{late}"
        )
    return [*lines, *([f"operators: {inert(found['error'])}"] if found["error"] else [])]


def percentile_distribution(encoded: str) -> str:
    """Return HdrHistogram's percentile distribution as text, in milliseconds, for its plotter."""
    histogram = HdrHistogram.decode(encoded)
    text = io.BytesIO()
    histogram.output_percentile_distribution(text, _US_PER_MS, _TICKS)
    return text.getvalue().decode("ascii")


FOLDER = Path(".roaas", "baselines")
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
_PATTERN = "20*.json"


class BaselineError(ValueError):
    """Raised for an unusable baseline; the message names the remedy."""


def folder_of(baselines: Path, name: str) -> Path:
    """Return the folder of a baseline.

    Raises:
        BaselineError: the name is not allowed.
    """
    if not _NAME.fullmatch(name):
        raise BaselineError(f"baseline {name!r}: a name consists of letters, digits, '.', '_' and '-'")
    return baselines / name


def newest(folder: Path) -> Path:
    """Return the result that was stored last.

    Raises:
        BaselineError: there is no result.
    """
    stored = sorted(folder.glob(_PATTERN))
    if not stored:
        raise BaselineError(f"there is no baseline in {str(folder)!r}: store one with --save {folder.name}")
    return stored[-1]


def store(result: Path, folder: Path) -> Path | None:
    """Store a result as a baseline and return its path; return None for an invalid result, which cannot be a baseline.

    Raises:
        BaselineError: the folder cannot be written to.
    """
    text = result.read_text(encoding="utf-8")
    document = json.loads(text)
    if not document["valid"]:
        return None
    moment = re.sub(r"[^0-9TZ]", "", document["started"])
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return write_atomically(folder / f"{moment}.json", text)
    except OSError as error:
        raise BaselineError(f"baseline folder {str(folder)!r}: {error.strerror or error}") from None

"""Traces as a file: written at the end of a run, so that a later rule can judge them without the device.

The file is JSON, compressed by gzip (RFC 1952): one object with the traces by scenario. A trace is read by the return
annotation of its scenario; msgspec does both.
"""

from __future__ import annotations

import gzip
import typing
from typing import TYPE_CHECKING, Any

import msgspec

from conformance.scenarios.scenario import Recording, Recordings, Scenario

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

TRACES_NAME = "traces.json.gz"
_FAST = 1


class TracesError(ValueError):
    """A file of traces that cannot be used; the message says why."""


def write_traces(recordings: Recordings, folder: Path) -> Path | None:
    """Write what was recorded to ``folder/traces.json.gz``; return the path, or None where there is no trace.

    Raises:
        OSError: it cannot be written.
    """
    traces = {name: recording.trace for name, recording in recordings.played.items() if recording.trace is not None}
    if not traces:
        return None
    path = folder / TRACES_NAME
    path.write_bytes(gzip.compress(msgspec.json.encode(traces, enc_hook=_plain), _FAST, mtime=0))
    return path


def read_traces(path: Path, scenarios: Iterable[Scenario]) -> Recordings:
    """Return the recordings of a file, of those scenarios that are known.

    Raises:
        TracesError: the file cannot be read, or a trace in it is not of its scenario's type.
    """
    try:
        raw = msgspec.json.decode(gzip.decompress(path.read_bytes()), type=dict[str, msgspec.Raw])
    except (OSError, EOFError, msgspec.DecodeError) as error:
        raise TracesError(f"{path} holds no traces: {error}") from error
    played: dict[str, Recording] = {}
    for scenario in scenarios:
        if scenario.name in raw and scenario.name not in played:
            try:
                trace = msgspec.json.decode(raw[scenario.name], type=_type_of(scenario), dec_hook=_rich)
            except msgspec.ValidationError as error:
                raise TracesError(f"{path}: the trace of {scenario.name} is not well made: {error}") from error
            played[scenario.name] = Recording(trace)
    return Recordings(played)


def _type_of(scenario: Scenario) -> Any:
    return typing.get_type_hints(scenario.play)["return"]


def _plain(value: Any) -> Any:
    """Return JSON for what msgspec does not know: a slice, as its bounds."""
    if isinstance(value, slice):
        return [value.start, value.stop]
    raise TypeError(f"a trace holds {type(value).__name__}, which cannot be written")


def _rich(kind: type, value: Any) -> Any:
    """Return the value that _plain() has written."""
    if kind is slice:
        return slice(*value)
    raise TypeError(f"a trace holds {kind.__name__}, which cannot be read")

"""The file of traces, written at the end of a run, so that later rules can judge them without the device.

The file is gzipped JSON (RFC 1952): one object with the traces by scenario. The return annotation of a scenario is the
type of its trace; msgspec encodes and decodes.
"""

import gzip
import typing
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import msgspec

from conformance.commandline.given_files import read_octets, unzipped
from conformance.commandline.out_folder import write_octets
from conformance.commandline.secrecy import SECRETS
from conformance.scenarios.scenario import Recording, Recordings, Scenario

TRACES_NAME = "traces.json.gz"
_FAST = 1
# Bytes of a run's traces: a hundred times what a long run writes.
_MOST = 256 * 1024 * 1024


class TracesError(ValueError):
    """Raised for an invalid file of traces; the message explains why."""


def write_traces(recordings: Recordings, folder: Path) -> Path | None:
    """Write the traces to ``folder/traces.json.gz``; return its path, or None if there is no trace.

    Variables are in place of secrets, in bytes before they are encoded as well.

    Raises:
        OSError: the file cannot be written.
    """
    traces = {name: recording.trace for name, recording in recordings.played.items() if recording.trace is not None}
    if not traces:
        return None
    path = folder / TRACES_NAME
    if SECRETS:
        plain = msgspec.to_builtins(traces, builtin_types=(bytes,), str_keys=True, enc_hook=_plain)
        traces = SECRETS.masked_json(plain)
    return write_octets(path, gzip.compress(msgspec.json.encode(traces, enc_hook=_plain), _FAST, mtime=0))


def read_traces(path: Path, scenarios: Iterable[Scenario], report: Callable[[str, Exception], None]) -> Recordings:
    """Read a file of traces; return the recordings of known scenarios.

    Args:
        path: the file.
        scenarios: scenarios that are known.
        report: is called for a trace that is not of its scenario's type, as one of an earlier version may be.

    Raises:
        TracesError: the file cannot be read.
    """
    try:
        octets = unzipped(read_octets(path), _MOST)
        raw = msgspec.json.decode(octets, type=dict[str, msgspec.Raw])
    except (OSError, ValueError, RecursionError) as error:
        raise TracesError(f"{path} holds no traces: {error}") from error
    played: dict[str, Recording] = {}
    for scenario in scenarios:
        if scenario.name in raw and scenario.name not in played:
            try:
                kind = typing.get_type_hints(scenario.play)["return"]
                trace = msgspec.json.decode(raw[scenario.name], type=kind, dec_hook=_rich)
            except (ValueError, RecursionError) as error:
                report(f"the trace of {scenario.name}", error)
            else:
                played[scenario.name] = Recording(trace)
    return Recordings(played)


def _plain(value: Any) -> Any:
    """Return a JSON value for a type that msgspec does not support: the bounds of a slice."""
    if isinstance(value, slice):
        return [value.start, value.stop]
    raise TypeError(f"a trace holds {type(value).__name__}, which cannot be written")


def _rich(kind: type, value: Any) -> Any:
    """Return the value that _plain() encoded."""
    if kind is slice:
        return slice(*value)
    raise TypeError(f"a trace holds {kind.__name__}, which cannot be read")

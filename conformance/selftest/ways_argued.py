"""Why a requirement is not judged by some ways in: read from a pack's ``ways.toml``, and shown in the tables.

``[about]`` names the ways that a requirement speaks of, by patterns. ``[[argued]]`` says why one of these cannot carry
the requirement, or which other way covers it.
"""

from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Final

import msgspec

from conformance.contract.toml_file import Text, TomlFileError, read_toml

#: Beside a pack's ``ways.json``.
FILE: Final = "ways.toml"
#: Properties of a request that are ways in of their own; every requirement speaks of them.
TRAITS: Final = ("a negative number", "a request that was sent before")
#: What a cell shows by which a requirement says nothing.
SILENT: Final = "·"


class Argument(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One reason for cells without a case.

    Attributes:
        why: the reason, as a sentence.
        requirements: patterns of the ids of requirements.
        ways: patterns of the ways in.
    """

    why: Text
    requirements: tuple[str, ...]
    ways: tuple[str, ...]

    def covers(self, requirement: str, way: str) -> bool:
        """Return whether a cell is argued by it."""
        return _matches(requirement, self.requirements) and _matches(way, self.ways)


class Arguments(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The file.

    Attributes:
        about: patterns of the ways that requirements speak of, by pattern of their ids; the first that matches counts.
        argued: reasons; the first that covers a cell counts.
    """

    about: dict[str, tuple[str, ...]] = {}
    argued: tuple[Argument, ...] = ()

    def of(self, requirement: str, way: str) -> Argument | str:
        """Return why a cell has no case: an argument, SILENT, or empty if nobody has said."""
        argument = next((one for one in self.argued if one.covers(requirement, way)), None)
        if argument is not None:
            return argument
        ways = next((ways for id_, ways in self.about.items() if fnmatchcase(requirement, id_)), None)
        return "" if ways is None or way in TRAITS or _matches(way, ways) else SILENT

    def unused(self, cells: list[tuple[str, str]]) -> Iterator[str]:
        """Yield a sentence for each part of the file that fits none of the given cells: requirement and way."""
        for pattern in self.about:
            if not any(fnmatchcase(id_, pattern) for id_, _ in cells):
                yield f"{FILE}: about {pattern!r} fits no requirement"
        for one in self.argued:
            if not any(one.covers(*cell) for cell in cells):
                yield f"{FILE}: no cell has to do with the argument {one.why!r}"


class WaysFileError(TomlFileError):
    """Raised for a ``ways.toml`` that cannot be used."""


def arguments_in(folder: Path) -> Arguments | None:
    """Read the arguments of a pack; None if it has none.

    Raises:
        WaysFileError: the file cannot be used.
    """
    path = folder / FILE
    return read_toml(path, Arguments, WaysFileError) if path.is_file() else None


def _matches(name: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in patterns)

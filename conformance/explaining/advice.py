"""Texts beside the ledger: advice by subject (advice.toml), and the sources in own words (sources.toml)."""

import re
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import Final

import msgspec

from conformance.contract.toml_file import Text, read_toml

#: The frameworks that advice names, with their titles and the language of their code.
FRAMEWORKS: Final = {
    "fastapi": ("FastAPI", "python"),
    "flask": ("Flask", "python"),
    "express": ("Express", "javascript"),
    "spring": ("Spring", "java"),
    "jaxrs": ("JAX-RS", "java"),
    "go": ("Go", "go"),
}
_CLAUSES = re.compile(r", | and ")


class Topic(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Advice on one subject.

    Attributes:
        title: the subject.
        requirements: ids that it is about, as patterns.
        why: what breaks when a device does not meet them.
        fix: what to do, in any language.
        code: what to write, by framework.
    """

    title: Text
    requirements: tuple[Text, ...]
    why: Text
    fix: Text
    code: dict[str, Text] = msgspec.field(default_factory=dict, name="in")


class _Norm(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    names: tuple[Text, ...]
    title: Text
    clauses: dict[str, Text] = {}


class _Topics(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    topic: tuple[Topic, ...]


class _Norms(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    norm: tuple[_Norm, ...]


@dataclass(frozen=True)
class Source:
    """One source of a requirement.

    Attributes:
        name: as the ledger names it, with all clauses.
        title: the norm's title; empty for one that is not known here, such as a section of a pack's own contract.
        meanings: what each clause says in own words, by clause; those that are not known are left out.
    """

    name: str
    title: str
    meanings: dict[str, str]


@cache
def topics() -> tuple[Topic, ...]:
    """Return all advice, special subjects before whole classes."""
    return read_toml(Path(__file__).with_name("advice.toml"), _Topics).topic


@cache
def _norms() -> dict[str, _Norm]:
    norms = read_toml(Path(__file__).with_name("sources.toml"), _Norms).norm
    return {name: norm for norm in norms for name in norm.names}


def topic_of(requirement: str) -> Topic | None:
    """Return the first advice with a pattern that fits the id, or None, as for a pack's own class."""
    return next(
        (topic for topic in topics() if any(fnmatchcase(requirement, name) for name in topic.requirements)), None
    )


def sources_of(source: str) -> tuple[Source, ...]:
    """Return each source of a requirement (``RFC 9110 9.3.2, 8.6; contract.md#http``) with its meaning."""
    return tuple(map(_source, source.split("; ")))


def _source(name: str) -> Source:
    known = max((norm for norm in _norms() if name.startswith(norm)), key=len, default=None)
    if known is None:
        return Source(name, "", {})
    norm = _norms()[known]
    clauses = _CLAUSES.split(name[len(known) :].lstrip(" ,-"))
    whole = ", ".join(clauses)
    return Source(
        name,
        norm.title,
        {clause: norm.clauses[clause] for clause in dict.fromkeys([*clauses, whole]) if clause in norm.clauses},
    )

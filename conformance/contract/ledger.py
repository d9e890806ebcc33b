"""The requirement ledger: each requirement once, with its class, level, text and source."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

LEVELS = ("MUST", "SHOULD", "MAY")
NEEDS = ("motion", "observer", "probe")
# What each conformance class holds.
CLASS_TITLES = {
    "rest-resources": "Table 1 of the paper over REST, as JSON",
    "rest-delivery": "The delivery PUT",
    "rest-formats": "The same resources as XML and plain text, chosen by Accept",
    "http": "Method, negotiation and error rules of RFC 9110, 9457 and 8259",
    "soap-delivery": "The publishers service with its two operations",
    "soap-subscribers": "The subscribers service: the read side of Table 1 over SOAP",
    "soap-basic-profile": "Rules of message and fault of WS-I Basic Profile 1.1 and SOAP 1.1",
    "strict-input": "Contract-invalid input is refused over both interfaces and never reaches ROS",
    "xml-security": "DTD, entity, expansion, depth and size attacks are refused, and the robot stays responsive",
    "equivalence": "SOAP, REST and ROS tell the same story",
    "safety": "Velocity stops by itself, limits hold, cancel takes effect at once",
    "describe": "WSDL, OpenAPI and WADL are served and agree with behaviour",
}
CLASSES = tuple(CLASS_TITLES)
PROFILES = {"paper": ("rest-resources", "rest-delivery", "soap-delivery"), "full": CLASSES}
_KEYS = {"level", "text", "source", "needs", "own", "untestable"}


class LedgerError(Exception):
    """A ledger that cannot be used; the message names the requirement and the offending value."""


@dataclass(frozen=True)
class Requirement:
    """One requirement.

    Attributes:
        id: ``CLASS/NAME``.
        class_: the conformance class that it is in.
        level: MUST, SHOULD or MAY.
        text: one sentence.
        source: paper section, contract page, RFC clause or WS-I id.
        needs: what a run must have to judge it (see NEEDS).
        own: whether it speaks of RoAAS's own resources.
        untestable: why no check can judge it, or None.
    """

    id: str
    class_: str
    level: str
    text: str
    source: str
    needs: tuple[str, ...] = ()
    own: bool = False
    untestable: str | None = None


def load_ledger(path: Path) -> dict[str, Requirement]:
    """Read a ``requirements.toml``.

    Raises:
        LedgerError: the file cannot be read, or a requirement in it is not well made.
    """
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise LedgerError(f"{path} cannot be read: {error}") from error
    ledger: dict[str, Requirement] = {}
    for class_, requirements in tables.items():
        if class_ not in CLASSES:
            raise LedgerError(f"{path}: {class_!r} is no conformance class; there are {', '.join(CLASSES)}")
        for name, fields in requirements.items():
            requirement = _requirement(path, class_, name, fields)
            ledger[requirement.id] = requirement
    return ledger


def _requirement(path: Path, class_: str, name: str, fields: dict[str, Any]) -> Requirement:
    id_ = f"{class_}/{name}"
    unknown = set(fields) - _KEYS
    if unknown:
        raise LedgerError(f"{path}: {id_} has unknown keys: {', '.join(sorted(unknown))}")
    for key in ("level", "text", "source"):
        if not isinstance(fields.get(key), str) or not fields[key].strip():
            raise LedgerError(f"{path}: {id_} has no {key}")
    if fields["level"] not in LEVELS:
        raise LedgerError(f"{path}: {id_} has level {fields['level']!r}; levels are {', '.join(LEVELS)}")
    needs = tuple(fields.get("needs", ()))
    for need in needs:
        if need not in NEEDS:
            raise LedgerError(f"{path}: {id_} needs {need!r}; needs are {', '.join(NEEDS)}")
    return Requirement(
        id_,
        class_,
        fields["level"],
        fields["text"],
        fields["source"],
        needs,
        own=bool(fields.get("own", False)),
        untestable=fields.get("untestable"),
    )

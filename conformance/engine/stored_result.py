"""Read a result.json that may come from anybody, with the types that a replay relies on."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec

from conformance.commandline.given_files import read_json, read_octets
from conformance.commandline.help_pages import inert
from conformance.contract.generic import generic_ledger

_FORMAT: Final = "roaas-result/1"
_SHOWN: Final = 300
#: Exceptions that a result file of the right types may still raise, for example if its description contradicts itself.
MALFORMED: Final = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)


class StoredResultError(ValueError):
    """Raised for a file that is no result; the message is one line and safe to print."""


class _Sent(msgspec.Struct):
    at_s: float
    method: str
    url: str
    headers: list[tuple[str, str]]
    body: str | None
    raw: str | None


class _Response(msgspec.Struct):
    status: int | None
    headers: dict[str, str | list[str]] | None = None
    body: str | None = None


class _Failure(msgspec.Struct):
    message: str
    response: _Response | None
    number: int | str | None = None
    sequence: list[_Sent] | None = None


class _Requirement(msgspec.Struct):
    id: str
    failures: list[_Failure]
    aliases: list[str] = []


class _WebServer(msgspec.Struct):
    requirements: list[_Requirement] = []


class _Target(msgspec.Struct):
    rest: str | None = None


class _Result(msgspec.Struct):
    """The parts of a result that a replay reads."""

    requirements: list[_Requirement]
    web_server: _WebServer | None = None
    suite: dict[str, Any] = {}
    pack: dict[str, Any] = {}
    target: _Target = msgspec.field(default_factory=_Target)
    statement: dict[str, Any] = {}
    classes: dict[str, str] = {}
    seed: Annotated[int, msgspec.Meta(ge=0)] | None = None
    effort: str | None = None


def read_result(path: Path) -> dict[str, Any]:
    """Return the content of a result file.

    Raises:
        StoredResultError: it cannot be read, or is no result.
    """
    try:
        document = read_json(read_octets(path))
    except (OSError, ValueError) as error:
        raise StoredResultError(f"{path} cannot be read: {inert(str(error))[:_SHOWN]}") from error
    if not isinstance(document, dict) or document.get("format") != _FORMAT:
        raise StoredResultError(f"{path} is no {_FORMAT}")
    try:
        msgspec.convert(document, _Result)
    except (ValueError, OverflowError, RecursionError) as error:
        raise not_well_made(path, error) from error
    return document


def not_well_made(path: Path, error: Exception) -> StoredResultError:
    """Return the error for a result whose content raised another error."""
    said = inert(f"{type(error).__name__}: {error}")[:_SHOWN]
    return StoredResultError(f"{path} is no well-made {_FORMAT}: {said}")


def findings(result: Mapping[str, Any], chosen: str | None) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield (requirement id, finding) for all findings of a result.

    Args:
        result: the result.
        chosen: only those of this requirement (by any id that it had), or the one with this number; None: all.
    """
    known = generic_ledger().get(chosen or "")
    names = {chosen, *(known.aliases if known else ())}
    for item in (*result["requirements"], *result.get("web_server", {}).get("requirements", ())):
        whole = chosen is None or not names.isdisjoint({item["id"], *item.get("aliases", ())})
        for failure in item["failures"]:
            if whole or chosen == str(failure.get("number")):
                yield item["id"], failure

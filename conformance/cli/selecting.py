"""Choose requirements by the options: by id, by class, or those that failed in the last run."""

import json
from collections.abc import Container, Iterable, Mapping
from difflib import get_close_matches
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Final

from conformance.contract.ledger import Requirement

_BROKEN: Final = frozenset({"fail", "error"})


class SelectionError(ValueError):
    """Raised for a selection that selects nothing; the message names the pattern."""


def select_ids(
    ledger: Mapping[str, Requirement],
    claims: Container[str],
    select: Iterable[str] = (),
    exclude: Iterable[str] = (),
    among: frozenset[str] | None = None,
) -> tuple[frozenset[str], frozenset[str]] | None:
    """Return the ids of the selected requirements, and those whose checks are played; None if nothing was selected.

    Checkers judge a requirement by the exchanges of its whole class, so the checks of its class are played with it.

    Args:
        ledger: the requirements by id.
        claims: the judged classes.
        select: ids, classes or patterns with `*`; empty means all.
        exclude: the same; they win.
        among: ids that are chosen from; None means all.

    Raises:
        SelectionError: a pattern fits no requirement that is judged, or nothing is left.
    """
    select, exclude = tuple(select), tuple(exclude)
    if not (select or exclude or among is not None):
        return None
    judged = {id_: one for id_, one in ledger.items() if any(name in claims for name in one.classes)}
    chosen = frozenset(judged) if among is None else among & frozenset(judged)
    if select:
        chosen &= frozenset().union(*(_fitting(pattern, judged, "--select") for pattern in select))
    excluded = frozenset().union(*(_fitting(pattern, judged, "--exclude") for pattern in exclude))
    chosen -= excluded
    if not chosen:
        raise SelectionError("--select and --exclude leave no requirement to judge")
    classes = {name for id_ in chosen for name in judged[id_].classes}
    return chosen, frozenset(id_ for id_, item in judged.items() if not classes.isdisjoint(item.classes)) - excluded


def _fitting(pattern: str, judged: Mapping[str, Requirement], option: str) -> frozenset[str]:
    found = frozenset(
        id_
        for id_, one in judged.items()
        if pattern in one.classes or any(fnmatchcase(name, pattern) for name in (id_, *one.aliases))
    )
    if not found:
        names = [*judged, *{name for requirement in judged.values() for name in requirement.classes}]
        near = get_close_matches(pattern, names, 1)
        meant = f"; did you mean {near[0]}?" if near else ""
        raise SelectionError(f"{option} {pattern!r} fits no requirement and no class that is judged{meant}")
    return found


def failed_before(result: Path) -> frozenset[str]:
    """Return the ids that failed or were inconclusive in the run of this result.json.

    Raises:
        SelectionError: there is no such result, or nothing failed in it.
    """
    try:
        document = json.loads(result.read_bytes())
        found = {item["id"] for item in document["requirements"] if item["verdict"] in _BROKEN}
    except FileNotFoundError:
        raise SelectionError(f"--last-failed: there is no {result}; run without it first") from None
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise SelectionError(f"--last-failed: {result} is no result of a run: {error}") from None
    if not found:
        raise SelectionError(f"--last-failed: nothing failed in {result}")
    return frozenset(map(str, found))

"""Compare two conformance results requirement by requirement.

A failure is a requirement that was judged and not met, whatever its level, and whether or not the baseline accepts it.
So a change of the level or of the baseline does not count as a change of the robot.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

Requirement = Mapping[str, Any]


class Kind(StrEnum):
    """The kind of change of a requirement between two results, the worst kind first."""

    NEW_FAILURE = "new failures"
    LOST = "lost coverage"
    NEW_WARNING = "new warnings"
    ACCEPTED = "newly accepted failures"
    OUT_OF_SIGHT = "failures no longer judged"
    FIXED = "fixed"
    FIRST_JUDGED = "judged for the first time"
    LEVEL = "changed levels"
    TEXT = "changed texts"
    MERGED = "renamed or merged"
    ADDED = "added to the requirements"
    REMOVED = "removed from the requirements"


MEANINGS = {
    Kind.NEW_FAILURE: "A MUST that fails now and did not before.",
    Kind.LOST: "It passed before and could not be judged now, so it is unknown whether it still passes.",
    Kind.NEW_WARNING: "A recommendation (SHOULD) that is not followed now and was before.",
    Kind.ACCEPTED: "The baseline accepts a failure that is new, or that it did not accept before.",
    Kind.OUT_OF_SIGHT: "It failed before and could not be judged now. It may not be fixed.",
    Kind.FIXED: "It failed before and passes now.",
    Kind.FIRST_JUDGED: "It was not judged before, so there is nothing to compare.",
    Kind.LEVEL: "The suite changed the level of the requirement. The robot did not change.",
    Kind.TEXT: "The suite changed the text of the requirement, so the two verdicts may mean different things.",
    Kind.MERGED: "The suite has another id for it now, or one requirement where it had several. Verdicts are compared.",
    Kind.ADDED: "The older suite did not have it, so there is nothing to compare.",
    Kind.REMOVED: "The newer suite does not have it.",
}


@dataclass(frozen=True, slots=True)
class Change:
    """A change of one requirement: its entries in the old and the new result, None where the requirement is absent."""

    id: str
    kind: Kind
    old: Requirement | None
    new: Requirement | None

    @property
    def text(self) -> str:
        """Return the requirement's text, from the newer result if the requirement is there."""
        return str((self.new or self.old or {})["text"])

    @property
    def course(self) -> str:
        """Return the level and the verdict, each as "before → now" if different, such as "MUST, pass → fail"."""
        levels = [item["level"] for item in (self.old, self.new) if item]
        verdicts = [item["verdict"] if item else "absent" for item in (self.old, self.new)]
        level = levels[0] if levels[0] == levels[-1] else f"{levels[0]} → {levels[-1]}"
        return f"{level}, {verdicts[0]} → {verdicts[1]}"

    @property
    def reason(self) -> str:
        """Return the reason that the newer result gives for the requirement's verdict, or an empty string."""
        if self.kind is Kind.MERGED:
            return "It was " + ", ".join((self.old or {})["was"]) + "."
        return str((self.new or {}).get("reason") or "")

    @property
    def regression(self) -> bool:
        """Return whether a MUST fails that did not fail before, or passed before and could not be judged now.

        What is judged beside a verdict is no regression.
        """
        if (self.new or {}).get("beside"):
            return False
        return self.kind is Kind.NEW_FAILURE or (
            self.kind is Kind.LOST and self.new is not None and self.new["level"] == "MUST"
        )


@dataclass(frozen=True, slots=True)
class Difference:
    """The comparison of an old and a new conformance result.

    Attributes:
        changes: the changed requirements, the worst kind of change first.
        circumstances: settings in which the two runs differ: name, value before, value now.
        still: how many requirements failed or warned before and fail now, and how many warn now, without those beside
            the verdict.
    """

    old: Mapping[str, Any]
    new: Mapping[str, Any]
    changes: tuple[Change, ...]
    circumstances: tuple[tuple[str, str, str], ...]
    still: tuple[int, int]

    @property
    def groups(self) -> dict[Kind, tuple[Change, ...]]:
        """Return the changes grouped by kind, the worst kind first."""
        return {
            kind: found for kind in Kind if (found := tuple(change for change in self.changes if change.kind is kind))
        }

    @property
    def is_explained(self) -> bool:
        """Return whether something is known to have changed between the runs."""
        return any(_changes(self.old, self.new))

    @property
    def origin(self) -> str:
        """Return in a sentence what changed between the runs: what judges, what was called, or the device."""
        changed = list(_changes(self.old, self.new))
        if not changed:
            return (
                "Suite, statement, motion map, description, classes, effort and the operations called are the same in "
                "both runs. A changed verdict comes from the device, or from a fault that does not show in every run."
            )
        others = [item for item in changed if not item.startswith("the device")]
        told = f"Changed between the runs: {', '.join(changed)}."
        these = "these" if len(others) > 1 else "this"
        return f"{told} A changed verdict may come from {these}, and not from the device." if others else told

    @property
    def regressions(self) -> tuple[Change, ...]:
        """Return the changes that are regressions (see `Change.regression`)."""
        return tuple(change for change in self.changes if change.regression)


def difference(old: Mapping[str, Any], new: Mapping[str, Any]) -> Difference:
    """Compare two valid `roaas-result/1` documents and return the changes."""
    before = dict(_by_present_id(old, new))
    now = {item["id"]: item for item in (*new["requirements"], *_beside(new))}
    changes = [
        Change(id_, kind, before.get(id_), now.get(id_))
        for id_ in {**before, **now}
        for kind in _kinds(before.get(id_), now.get(id_))
    ]
    order = list(Kind)
    changes.sort(key=lambda change: (order.index(change.kind), change.id))
    judged = {id_: item for id_, item in now.items() if not item.get("beside")}
    kept = [judged[id_]["verdict"] for id_, item in before.items() if _has_failed(item) and id_ in judged]
    still = (kept.count("fail"), kept.count("warn"))
    return Difference(old, new, tuple(changes), tuple(_circumstances(old, new)), still)


_WORST_FIRST = ("fail", "warn", "error", "skip", "pass", "not-claimed")


def _by_present_id(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[tuple[str, Requirement]]:
    """Yield the old requirements by the ids that the new result has for them; of several with one id, the worst."""
    present = (*new["requirements"], *_beside(new))
    renamed = {alias: item["id"] for item in present for alias in item.get("aliases", ())}
    by_id: dict[str, list[Requirement]] = {}
    for item in (*old["requirements"], *_beside(old)):
        by_id.setdefault(renamed.get(item["id"], item["id"]), []).append(item)
    for id_, items in by_id.items():
        worst = min(items, key=lambda item: _WORST_FIRST.index(item["verdict"]))
        was = [item["id"] for item in items]
        yield id_, worst if was == [id_] else {**worst, "was": was}


def _beside(result: Mapping[str, Any]) -> Iterator[Requirement]:
    """Yield the requirements beside a verdict, for which a failure is a warning."""
    for item in result.get("web_server", {}).get("requirements", ()):
        yield {
            **item,
            "beside": True,
            "verdict": {"fail": "warn", "error": "skip"}.get(item["verdict"], item["verdict"]),
        }


def _kinds(old: Requirement | None, new: Requirement | None) -> Iterator[Kind]:
    if new is None:
        yield Kind.REMOVED
    elif old is None:
        yield Kind.ADDED
    elif "was" in old:
        yield Kind.MERGED
        yield from _course(old, new)
    else:
        if old["level"] != new["level"]:
            yield Kind.LEVEL
        if old["text"] != new["text"]:
            yield Kind.TEXT
        yield from _course(old, new)


def _course(old: Requirement, new: Requirement) -> Iterator[Kind]:
    """Yield the kinds of change that follow from a requirement's old and new verdict."""
    if old["verdict"] == "not-claimed" and _is_judged(new):
        yield Kind.FIRST_JUDGED
    elif _has_failed(new):
        if "expected_failure" in new:
            if "expected_failure" not in old:
                yield Kind.ACCEPTED
        elif not _has_failed(old):
            yield Kind.NEW_WARNING if new["verdict"] == "warn" else Kind.NEW_FAILURE
        elif "expected_failure" in old and new["verdict"] == "fail":
            yield Kind.NEW_FAILURE
    elif _has_failed(old):
        yield Kind.FIXED if _is_judged(new) else Kind.OUT_OF_SIGHT
    elif _is_judged(old) and not _is_judged(new):
        yield Kind.LOST
    elif _is_judged(new) and not _is_judged(old):
        yield Kind.FIRST_JUDGED


def _has_failed(item: Requirement) -> bool:
    return item["verdict"] in {"fail", "warn"}


def _is_judged(item: Requirement) -> bool:
    return item["verdict"] in {"pass", "fail", "warn"}


def _changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    """Yield what differs of what judges and what is judged, with the versions if they differ."""
    files = "the description" if "api" in new else "the contract"
    robots = [_at(item, "statement.robot.version") for item in (old, new)]
    where = "" if robots[0] == robots[1] else ", at least the device's version in it"
    for name, version, digest in (
        ("the suite", "suite.version", "suite.digest"),
        (f"the statement{where}", "", "digests.statement"),
        ("the motion map", "", "digests.map"),
        (files, "api.version", "digests.contract"),
    ):
        before, now = _at(old, digest), _at(new, digest)
        # An older suite wrote fewer digests.
        known = old["suite"]["digest"] == new["suite"]["digest"] or "none" not in {before, now}
        if before != now and known and not (digest == "suite.digest" and _is_by_description(old, new)):
            versions = [_at(item, version) for item in (old, new)] if version else []
            if "none" in {before, now}:
                versions = ["none" if each == "none" else "given" for each in (before, now)]
            yield name + (f" ({' → '.join(versions)})" if len(set(versions)) > 1 else "")
    judged = [{name for name, found in item["classes"].items() if found != "not-claimed"} for item in (old, new)]
    if judged[0] != judged[1]:
        yield f"the classes judged ({' → '.join(', '.join(sorted(each)) for each in judged)})"
    if old.get("selected") != new.get("selected"):
        yield "the requirements selected"
    called = [{each["operation"] for each in _operations(item) if each["called"]} for item in (old, new)]
    if called[0] != called[1]:
        yield f"the operations called ({len(called[0])} → {len(called[1])})"
    for name, path in (("the effort", "effort"), ("the permission to move", "statement.motion_allowed")):
        before, now = _at(old, path), _at(new, path)
        if before != now:
            yield f"{name} ({before} → {now})"
    if robots[0] != robots[1]:
        yield f"the device ({' → '.join(robots)})"


def _is_by_description(old: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
    """Return whether the suite's digest may be another one because of the description alone, whose files it covers."""
    is_same_version = _at(old, "suite.version") == _at(new, "suite.version")
    return is_same_version and "api" in new and _at(old, "digests.contract") != _at(new, "digests.contract")


def _operations(result: Mapping[str, Any]) -> Iterable[Mapping[str, Any]]:
    """Return the operations of a described device, with whether each was called."""
    found: Iterable[Mapping[str, Any]] = result.get("api", {}).get("operations", ())
    return found


def _circumstances(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    for name, path in _CIRCUMSTANCES.items():
        before, now = (_at(result, path) for result in (old, new))
        if before != now and not (path == "suite.digest" and _is_by_description(old, new)):
            yield name, before, now


_CIRCUMSTANCES = {
    "robot": "statement.robot.name",
    "vendor": "statement.robot.vendor",
    "firmware": "statement.robot.version",
    "suite": "suite.version",
    "suite's digest": "suite.digest",
    "contract": "suite.contract",
    "requirement set": "requirement_set.name",
    "effort": "effort",
    "seed": "seed",
    "motion allowed": "statement.motion_allowed",
    "ROS domain watched": "target.ros_domain_id",
    "baseline": "baseline.digest",
    "verdict": "verdict",
}


def _at(result: Mapping[str, Any], path: str) -> str:
    value: Any = result
    for key in path.split("."):
        value = value.get(key) if isinstance(value, Mapping) else None
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "none" if value is None else str(value)

"""Check the outcomes of a run: whether they agree with one another, and with the ledger of the installed suite.

A vendor who holds the key can sign anything. These checks find what a suite never writes: a requirement that is not
there, or twice, at another level, or untested in a class that passed.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping

import msgspec

from reports.attestation.statement import (
    CONTRACT_SUBJECT,
    PROPERTY,
    Extent,
    Run,
    Statement,
    passed_classes,
    property_name,
    seed_of,
)

_LEVELS = frozenset({"MUST", "SHOULD", "MAY"})
_VERDICTS = frozenset({"pass", "fail", "warn", "skip", "not-claimed", "error"})
_CLASS_VERDICTS = frozenset({"pass", "fail", "inconclusive", "not-claimed"})
_RUN_VERDICTS = frozenset({"conformant", "not-conformant", "inconclusive"})
TESTED = frozenset({"pass", "fail", "warn"})
# Statuses of a MUST in a passed class, unless its failure was accepted. It may warn if conforming devices may do so.
_KEPT = frozenset({"pass", "not-claimed", "warn"})
_NAMED = 3


class Entry(msgspec.Struct, frozen=True):
    """The installed suite's ledger entry on one requirement.

    Attributes:
        level: MUST, SHOULD or MAY.
        classes: the classes that it binds, its own first.
        text: the rule.
        aliases: ids that it had before.
        sets: names of the requirement sets that contain it.
        decides: whether a class cannot pass unless it was tested, or does not apply to the robot.
        beside: whether a run that does not claim its class leaves it out of the requirements.
    """

    level: str
    classes: tuple[str, ...]
    text: str = ""
    aliases: tuple[str, ...] = ()
    sets: tuple[str, ...] = ()
    decides: bool = False
    beside: bool = False


def outcomes_of(run: Run) -> Iterator[tuple[str, str, str]]:
    """Yield id, level and verdict of each requirement that a run lists."""
    for level, verdicts in run.outcomes.items():
        for verdict, ids in verdicts.items():
            for id_ in ids:
                yield id_, level, verdict


def first_names(names: Collection[str]) -> str:
    """Return up to three names in words, and how many there are beside."""
    first = ", ".join(list(names)[:_NAMED])
    return first if len(names) <= _NAMED else f"{first} and {len(names) - _NAMED} more"


def contradictions(run: Run) -> list[str]:
    """Return contradictions in a run's result, in words; empty if there are none."""
    listed = list(outcomes_of(run))
    verdicts = {id_: verdict for id_, _, verdict in listed}
    found = [
        *(f"{word!r} is no verdict of a requirement" for word in sorted({one[2] for one in listed} - _VERDICTS)),
        *(f"{word!r} is no level" for word in sorted({one[1] for one in listed} - _LEVELS)),
        *(f"{word!r} is no verdict of a class" for word in sorted({*run.classes.values()} - _CLASS_VERDICTS)),
        *(f"{word!r} is no verdict of a run" for word in {run.verdict} - _RUN_VERDICTS),
    ]
    twice = [id_ for id_, count in Counter(one[0] for one in listed).items() if count > 1]
    if twice:
        found.append(f"{first_names(twice)} is listed more than once")
    counts = Counter(verdict for _, _, verdict in listed)
    if run.outcomes and counts != Counter(run.requirements):
        said, there = (dict(sorted(item.items())) for item in (run.requirements, counts))
        found.append(f"it counts {said} requirements, but lists {there}")
    for id_, level, verdict in listed:
        name = id_.partition("/")[0]
        if level == "MUST" and verdict == "fail" and run.classes.get(name) == "pass":
            found.append(f"class {name} passed, although {id_} failed")
    if unlisted := sorted({*run.accepted, *run.intermittent} - verdicts.keys()):
        found.append(f"{first_names(unlisted)} is accepted or intermittent, but not listed")
    claimed = {name for name, verdict in run.classes.items() if verdict != "not-claimed"}
    if run.verdict == "conformant" and ({run.classes[name] for name in claimed} != {"pass"}):
        found.append("the run is conformant, although not all claimed classes passed")
    if run.nonce is not None and run.seed != seed_of(run.nonce):
        found.append("the seed was not derived from the nonce")
    return found if run.extent is None else [*found, *_beyond(run, run.extent, claimed)]


def _beyond(run: Run, extent: Extent, claimed: set[str]) -> Iterator[str]:
    """Yield findings of a run on things that it did not test, in words."""
    if unclaimed := sorted(claimed - {*extent.claims}):
        yield f"{first_names(unclaimed)} has a verdict, but was not claimed"
    if not extent.requests and any(verdict == "pass" for _, _, verdict in outcomes_of(run)):
        yield "requirements passed, although no request was sent"
    if run.verdict == "conformant" and extent.suite_errors:
        yield f"the run is conformant, although the suite could not judge {first_names(extent.suite_errors)}"


def statement_contradictions(statement: Statement) -> list[str]:
    """Return contradictions in a signed statement, in words; empty if there are none."""
    predicate, run = statement.predicate, statement.predicate.roaas
    found = contradictions(run)
    if sorted(predicate.properties) != sorted(PROPERTY + property_name(name) for name in passed_classes(run)):
        found.append("its properties are not the classes that passed")
    if predicate.verifier.id != f"urn:roaas:suite:{run.suite.version}:{run.suite.digest}":
        found.append("its verifier is not the suite that it names")
    if predicate.time_created != run.finished:
        found.append("its time is not the end of the run")
    contract = {one.name: one.sha256 for one in statement.subject if one.name.startswith(CONTRACT_SUBJECT)}
    if {one.name: one.sha256 for one in predicate.verifier.policies} != contract:
        found.append("its policies are not the files of the contract")
    names = [subject.name for subject in statement.subject]
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        found.append(f"it has two digests of {first_names(twice)}")
    return found


def demanded_entries(run: Run, ledger: Mapping[str, Entry], set_: str, *, same: bool) -> dict[str, Entry]:
    """Return the requirements that a run must list, by id: all of the same suite's ledger, or those of a frozen set."""
    return {
        id_: entry
        for id_, entry in ledger.items()
        if (same or set_ in entry.sets) and (not entry.beside or entry.classes[0] in run.classes)
    }


def departures(run: Run, ledger: Mapping[str, Entry], set_: str, *, same: bool) -> list[str]:
    """Return how a run's requirements differ from the installed suite's ledger, in words; empty if they do not.

    Args:
        run: what the certificate says.
        ledger: the requirements of the installed suite, by id.
        set_: name of the requirement set that scored the run; the installed suite knows the set.
        same: whether the installed suite judged the run, so that its whole ledger must be there.
    """
    present = {alias: id_ for id_, entry in ledger.items() for alias in (id_, *entry.aliases)} if not same else {}
    there = {present.get(id_, id_): (level, verdict) for id_, level, verdict in outcomes_of(run)}
    wanted = demanded_entries(run, ledger, set_, same=same)
    found = []
    if missing := [id_ for id_ in wanted if id_ not in there]:
        found.append(f"{len(missing)} of {len(wanted)} requirements are not listed: {first_names(missing)}")
    if same and (unknown := [id_ for id_ in there if id_ not in ledger]):
        found.append(f"the suite has no requirement {first_names(unknown)}")
    for id_, entry in wanted.items():
        level, verdict = there.get(id_, (entry.level, "pass"))
        if level != entry.level:
            found.append(f"{id_} is listed as {level}, but is a {entry.level}")
        ended = [name for name in entry.classes if run.classes.get(name) == "pass"]
        counts = entry.decides and set_ in entry.sets and id_ not in run.accepted
        if ended and entry.level == "MUST" and (verdict == "fail" or (counts and verdict not in _KEPT)):
            found.append(f"class {ended[0]} passed, although the MUST {id_} ended with {verdict!r}")
    if same and (unbound := sorted(run.classes.keys() - {name for one in ledger.values() for name in one.classes})):
        found.append(f"the suite has no class {first_names(unbound)}")
    return found


def musts_of(run: Run, ledger: Mapping[str, Entry], classes: Iterable[str]) -> dict[str, str]:
    """Return the verdict of each listed MUST of some classes, by id: by the ledger, or by the id's own class."""
    wanted = frozenset(classes)
    return {
        id_: verdict
        for id_, level, verdict in outcomes_of(run)
        if level == "MUST" and wanted.intersection(ledger[id_].classes if id_ in ledger else (id_.partition("/")[0],))
    }

"""Group findings by cause: several requirements that met the same cause share one finding.

A closed connection, a hang, a server error and a response that cannot be parsed are causes that many checks meet. Two
findings have the same cause if its kind and the method, server and path of the request are the same, and also the
status of a server error and the operation of a SOAP message. The finding stays with one requirement, chosen by

1. level: MUST first;
2. ``forbids`` in the ledger, which lists the kinds of causes that a requirement is about;
3. the request: a request that was sent comes before one that was not sent because the server hung before, and a check
   of few requirements before a check of many;
4. time: the requirement that met the cause first.

All other requirements that met the cause are not tested.

A raw request tests a rule of its own, so it shares a cause only if an ordinary request met that cause as well.
"""

from collections import Counter, defaultdict
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from conformance.contract.classes import CauseKind, Level, Topic
from conformance.contract.ledger import Requirement
from conformance.verdict.evidence import Evidence
from conformance.verdict.finding import Finding

_LEVELS = tuple(Level)
_KINDS = tuple(CauseKind)
_TOPICS = tuple(Topic)
# A check of more requirements than this looks at many things, and explains each of them less well.
_FEW = 5


@dataclass(frozen=True)
class Cause:
    """A finding, and the requirements that could not be tested because of it.

    Attributes:
        finding: the finding that is reported.
        blocks: ids of the requirements that could not be tested.
    """

    finding: Finding
    blocks: tuple[str, ...]


def by_cause(
    evidence: Mapping[str, Evidence],
    ledger: Mapping[str, Requirement],
    claims: Container[str],
    scored: Container[str] | None = None,
    beside: Container[str] = (),
) -> tuple[dict[str, Evidence], list[Cause]]:
    """Keep one finding for each cause, and number the findings in the order in which a vendor should look at them.

    They are numbered by topic, as pages and terminal list them. Within a topic MUST comes before SHOULD; then closed
    connection, hang, server error, unparsable response, broken rule; then the cause that blocks more requirements.

    Args:
        evidence: by requirement.
        ledger: the requirements.
        claims: the classes that are judged; others have no findings.
        scored: ids of the requirements that count; None means all.
        beside: judged classes that decide no verdict; their findings have the last numbers.

    Returns:
        The evidence with the remaining findings, and the causes in order.
    """
    judged = {id_: one for id_, one in ledger.items() if one.binds(claims)}
    places = {id_: place for place, id_ in enumerate(judged)}

    def weight(finding: Finding) -> tuple[bool, bool, int]:
        requirement = judged[finding.requirement]
        uncounted = scored is not None and requirement.id not in scored
        level = max(_LEVELS.index(requirement.level), _LEVELS.index(Level.SHOULD) if finding.doubt else 0)
        return requirement.class_ in beside, uncounted, level

    def first(finding: Finding) -> tuple[tuple[bool, bool, int], bool, bool, bool, int]:
        forbids = finding.cause in judged[finding.requirement].forbids
        return weight(finding), not forbids, finding.unsent, finding.among > _FEW, finding.met

    findings = [finding for id_ in judged for finding in evidence[id_].findings.values()]
    # For each of its causes, the finding that reports the cause, by finding.
    told_by: defaultdict[int, list[Finding]] = defaultdict(list)
    for group in _groups(findings):
        told = min(group, key=first)
        for finding in group:
            told_by[id(finding)].append(told)
    kept = {id_: _findings_kept(evidence[id_], told_by) for id_ in judged}
    waiting = {
        id_: [told for finding in evidence[id_].findings.values() for told in told_by[id(finding)]]
        + ([because] if (because := evidence[id_].because) else [])
        for id_, requirement in judged.items()
        if not (kept[id_] or evidence[id_].errors or requirement.untestable)
    }
    blocked = Counter(number for reasons in waiting.values() for number in {id(one) for one in reasons})
    remaining = [finding for id_ in judged for finding in kept[id_].values()]

    def place(finding: Finding) -> tuple[Any, ...]:
        topic = _TOPICS.index(judged[finding.requirement].topic or Topic.HURT)
        kind = _KINDS.index(finding.cause)
        aside, *weighs = weight(finding)
        return aside, topic, weighs, kind, -blocked[id(finding)], places[finding.requirement], finding.met

    remaining.sort(key=place)
    for number, finding in enumerate(remaining, 1):
        finding.number = number
    seen = dict(evidence)
    blocks: defaultdict[int, list[str]] = defaultdict(list)
    for id_ in judged:
        because = min(waiting.get(id_, ()), key=lambda one: one.number, default=None)
        if because is not None:
            blocks[because.number].append(id_)
        seen[id_] = replace(evidence[id_], findings=kept[id_], because=because)
    return seen, [Cause(finding, tuple(blocks[finding.number])) for finding in remaining]


def _groups(findings: Iterable[Finding]) -> list[list[Finding]]:
    """Return the findings that share a cause, group by group, for causes that an ordinary request met."""
    groups: defaultdict[str, list[Finding]] = defaultdict(list)
    for finding in findings:
        for cause in finding.causes if not finding.alone else ():
            groups[cause].append(finding)
    return [
        group
        for group in groups.values()
        if any(finding.exchange and finding.exchange.request.raw is None for finding in group)
    ]


def _findings_kept(evidence: Evidence, told_by: Mapping[int, list[Finding]]) -> dict[str, Finding]:
    """Return the findings that stay with a requirement, because no other finding has their cause."""
    return {
        key: finding
        for key, finding in evidence.findings.items()
        if not (tellers := told_by.get(id(finding))) or any(told is finding for told in tellers)
    }

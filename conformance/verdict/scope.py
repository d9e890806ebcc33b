"""The verdict's first line: to what a robot conforms, how that was seen, and on how many of the cases."""

from collections.abc import Collection, Iterable

from conformance.contract.pack import Contract
from conformance.verdict.run import Run
from conformance.verdict.verdicts import Overall, Verdict, View, views

_WORDS = {
    Overall.CONFORMANT: "conformant to",
    Overall.NOT_CONFORMANT: "not conformant to",
    Overall.INCONCLUSIVE: "inconclusive for",
}
# A device without requirements of a contract's own keeps its description, and conforms to no contract.
_OF_DESCRIPTION = {
    Overall.CONFORMANT: "keeps its own description",
    Overall.NOT_CONFORMANT: "does not keep its own description",
    Overall.INCONCLUSIVE: "inconclusive",
}


def claimed(contract: Contract, claims: Collection[str]) -> str:
    """Return the claimed classes in words: a profile's name, or the classes' names and "only"."""
    profile = next((name for name, classes in contract.profiles.items() if set(classes) == set(claims)), "")
    return profile or f"{', '.join(claims) or 'nothing'} only"


def view_of(verdicts: Iterable[Verdict]) -> View:
    """Return how the robot was seen: on ROS if a probe observed every class that it could observe."""
    found = set(views(verdicts).values())
    return View.ON_ROS if found == {View.ON_ROS} else View.BLACK_BOX


def verdict_line(run: Run, value: Overall, verdicts: Iterable[Verdict]) -> str:
    """Return the verdict in a line, such as "conformant to full (contract 1.2), seen on ROS"."""
    if run.stop_undelivered and value is Overall.INCONCLUSIVE:
        return f"inconclusive: {run.stop_undelivered}"
    if run.refused and value is Overall.INCONCLUSIVE:
        return "inconclusive, because the device refused the credentials"
    if run.unshown and value is Overall.INCONCLUSIVE:
        return f"inconclusive, because {run.unshown}"
    if not run.contract.has_own_requirements:
        said = _OF_DESCRIPTION[value]
        said = f"{said}, as far as --minutes {run.limit.minutes:g} allowed" if run.limit.is_struck else said
        return f"{said}, {run.less}" if run.less else said
    contract = f" (contract {run.contract.label})" if run.contract.label else ""
    said = f"{_WORDS[value]} {claimed(run.contract, run.claims)}{contract}, {view_of(verdicts)}"
    return f"{said}, {run.less}" if run.less else said

"""``roaas explain``: a requirement's rule, reason, sources and checks, and how to meet it."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import click
from click.shell_completion import CompletionItem

from conformance.cli.contract import contract_option, load_pack
from conformance.contract.classes import QUESTIONS, Prerequisite
from conformance.contract.generic import generic_classes, generic_ledger
from conformance.contract.ledger import Requirement, ids_by_alias
from conformance.contract.locating import ContractError
from conformance.contract.pack import Contract
from conformance.engine.collected_checks import Check, checks_of
from conformance.explaining.advice import FRAMEWORKS, Source, Topic, sources_of, topic_of

#: At which effort checks run, and with how many cases.
EFFORTS = (
    "At each effort, unless a check says otherwise. Quick tries about a tenth of the cases that standard generates, "
    "and every other value of those that a check lists. Deep generates as many cases as --minutes allows."
)
#: What a run needs to judge a requirement, in words, for each key of `needs`.
NEEDS = {
    Prerequisite.MOTION: "permission to move the device (--allow-motion)",
    Prerequisite.OBSERVER: "a view of what requests cause: a ROS probe (--ros-domain-id), or the device's own list",
    Prerequisite.LIMITS: "limits in the statement",
    Prerequisite.HOLD: "a hold time in the statement (hold_s, of [limits] or of the motion map)",
    Prerequisite.RESOLVED: "declared tolerances that are small beside the limits",
    Prerequisite.SEEN: "a device that does this without being made to; a device that never does it is not judged",
    Prerequisite.PROBE: "a ROS probe (--ros-domain-id)",
}


@dataclass(frozen=True)
class Explanation:
    """A requirement with its reasons, sources, checks, mutants and advice.

    Attributes:
        requirement: the requirement.
        sources: where it comes from.
        topic: why it matters and how to meet it, or None.
        checks: the checks that judge it.
        mutants: the hand-written mutants that it must kill, each with a name and what it `says`.
    """

    requirement: Requirement
    sources: tuple[Source, ...]
    topic: Topic | None
    checks: tuple[Check, ...]
    mutants: tuple[Any, ...]

    @property
    def why(self) -> str:
        """Return what breaks in practice: the ledger's text on this requirement, then the text on its subject."""
        return " ".join(filter(None, (self.requirement.breaks, self.topic.why if self.topic else None)))


def explanation_of(contract: Contract, requirement: Requirement, mutants: Iterable[Any] = ()) -> Explanation:
    """Return the explanation of a requirement, with those of a pack's mutants that it must kill.

    Raises:
        ContractError: a module with checks cannot be imported.
    """
    return Explanation(
        requirement,
        sources_of(requirement.source),
        topic_of(requirement.id),
        checks_of(contract).get(requirement.id, ()),
        tuple(mutant for mutant in mutants if requirement.id in mutant.catches),
    )


_NEAR, _CUTOFF = 5, 0.5


class UnknownRequirementError(ValueError):
    """Raised for an id that no ledger has; the message names it and ids that look alike."""


def ledger_of(contract: Contract) -> dict[str, Requirement]:
    """Return the requirements of a pack and those that bind any web API, by id."""
    return {**generic_ledger(), **contract.ledger}


def page_of(id_: str) -> str:
    """Return the page of a requirement on the documentation site, without a suffix."""
    return f"requirements/{id_}"


def find(contract: Contract, id_: str) -> Requirement:
    """Return the requirement with an id, or with an id that it had before.

    Raises:
        UnknownRequirementError: no ledger has it.
    """
    ledger = ledger_of(contract)
    aliases = ids_by_alias(ledger)
    requirement = ledger.get(aliases.get(id_, id_))
    if requirement is None:
        names = [*ledger, *aliases]
        near = get_close_matches(id_, names, _NEAR, _CUTOFF) or [name for name in names if id_.lower() in name.lower()]
        hint = f"did you mean {', '.join(near[:_NEAR])}? " if near else ""
        raise UnknownRequirementError(
            f"contract {contract.name} has no requirement {id_!r}; {hint}`roaas explain` lists all; "
            "--contract names another contract"
        )
    return requirement


_WIDEST = 100
_SHOWN_MUTANTS = 8


def _ids(_context: click.Context, _parameter: click.Parameter, begun: str) -> list[CompletionItem]:
    return [
        CompletionItem(id_, help=item.text) for id_, item in ledger_of(Contract.load()).items() if id_.startswith(begun)
    ]


@click.command()
@click.argument("requirement", required=False, shell_complete=_ids)
@contract_option
@click.option(
    "--framework",
    "frameworks",
    type=click.Choice(list(FRAMEWORKS)),
    multiple=True,
    help="Only the code for this framework; repeatable.  [default: all]",
)
@click.pass_obj
def explain(door: Any, /, requirement: str | None, pack: str, frameworks: tuple[str, ...]) -> None:
    """Explain a requirement: the rule, why it matters, its source, how it is judged, and how to meet it.

    REQUIREMENT is an id such as http/head. Without it, the command lists all requirements.
    """
    contract = load_pack(pack)
    if requirement is None:
        _list(contract)
        return
    try:
        item = find(contract, requirement)
        explanation = explanation_of(contract, item, door.mutants_of(contract))
    except (UnknownRequirementError, ContractError) as error:
        raise click.UsageError(str(error)) from error
    if requirement != item.id:
        click.echo(f"{requirement} is now part of {item.id}.\n")
    for line in _lines(explanation, contract, frameworks or tuple(FRAMEWORKS)):
        click.echo(line)


def _list(contract: Contract) -> None:
    ledger = ledger_of(contract)
    topics = {id_: item.topic or generic_classes()[item.class_].topic for id_, item in ledger.items()}
    width = max(map(len, ledger)) + 2
    for topic, question in QUESTIONS.items():
        click.echo(f"{question}")
        for id_, item in ledger.items():
            if topics[id_] is topic:
                click.echo(f"  {id_:<{width}}{textwrap.shorten(item.text, max(40, _width() - width - 2))}")
    click.echo(f"{len(ledger)} requirements; roaas explain ID explains one", err=True)


def _lines(explanation: Explanation, contract: Contract, frameworks: Iterable[str]) -> Iterator[str]:
    item = explanation.requirement
    yield from (f"{item.id} ({item.level}, class {item.class_})", *_wrap(item.text))
    if explanation.why:
        yield from ("", "Why it matters", *_wrap(explanation.why))
    yield from ("", "Source", *_sources(explanation, contract))
    yield from ("", "How it is judged", *_judging(explanation))
    if explanation.topic:
        yield from ("", f"How to fix it ({explanation.topic.title})", *_wrap(explanation.topic.fix))
        for name in frameworks:
            if name in explanation.topic.code:
                yield from ("", f"  {FRAMEWORKS[name][0]}:")
                yield textwrap.indent(explanation.topic.code[name].rstrip(), "    ")
    yield from ("", f"In the documentation (make docs): {page_of(item.id)}.html")


def _sources(explanation: Explanation, contract: Contract) -> Iterator[str]:
    for source in explanation.sources:
        section = contract.cited_sections.get(source.name.partition("#")[2])
        title = f"the contract, section “{section.title}”" if section else source.title
        yield from _wrap(f"{source.name}: {title}" if title else source.name)
        for clause, meaning in source.meanings.items():
            yield from _wrap(f"{clause}: {meaning}", "    ")


def _judging(explanation: Explanation) -> Iterator[str]:
    item = explanation.requirement
    if item.untestable:
        yield from _wrap(f"Not from outside: {item.untestable}")
    for check in explanation.checks:
        does = " ".join(filter(None, (check.does, *(f"On the trace of: {text}" for text in check.scenarios))))
        yield from _wrap(f"{check.name}: {does}")
    if item.needs:
        yield from _wrap(f"The run needs {'; '.join(NEEDS[need] for need in item.needs)}.")
    yield from _wrap(EFFORTS)
    mutants = [f"{mutant.name} ({mutant.says})" for mutant in explanation.mutants[:_SHOWN_MUTANTS]]
    if mutants:
        yield from _wrap(f"Faulty devices that it must fail for, among others: {'; '.join(mutants)}")


def _wrap(text: str, indent: str = "  ") -> list[str]:
    return textwrap.wrap(text, _width(), initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False)


def _width() -> int:
    return min(_WIDEST, shutil.get_terminal_size().columns)

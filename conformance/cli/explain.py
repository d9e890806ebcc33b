"""``roaas explain``: a requirement's rule, reason, sources and checks, and how to meet it."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from conformance.cli.contract import contract_option, load_pack
from conformance.cli.explanation import UnknownRequirementError, find, ledger_of, page_of
from conformance.contract.classes import QUESTIONS
from conformance.contract.generic import generic_classes
from conformance.contract.locating import ContractError
from conformance.contract.pack import Contract
from conformance.explaining.advice import FRAMEWORKS

if TYPE_CHECKING:
    from conformance.cli.explanation import Explanation

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
        # Imported here: it imports every check.
        from conformance.cli.explanation import explanation_of  # noqa: PLC0415

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
    from conformance.cli.explanation import EFFORTS, NEEDS  # noqa: PLC0415 - as above

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

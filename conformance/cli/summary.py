"""The summary at the end of ``roaas certify``: classes, findings by cause with a replay command each, the verdict."""

from __future__ import annotations

import json
import re
import shlex
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import click

from conformance.api.rest.things import collection_of
from conformance.commandline.exit_codes import ExitCode
from conformance.commandline.help_pages import columns, inert, say, wrap
from conformance.contract.classes import QUESTIONS
from conformance.verdict.baseline import ENTRY
from conformance.verdict.finding import count_of, few_of

if TYPE_CHECKING:
    from pathlib import Path

    from conformance.engine.certification import Certification

# The end of a sentence before the next one.
_SENTENCE = re.compile(r"(?<=[.])\s+(?=[A-Z`])")
_COLOURS = {"pass": "green", "fail": "red", "inconclusive": "yellow"}
_MARKS = {"pass": "pass", "fail": "FAIL", "inconclusive": "inconclusive", "not-claimed": "not claimed"}
# A device that is judged by its own description conforms to no contract.
_SHOWN_CURL = 2000
_SHOWN_BLOCKED = 5
# The word of the pages for the verdict "skip".
_UNTESTED = "not tested"
_IN_FULL = 5  # findings of one requirement that are printed in full; each further one gets a line of _LINE characters
_LINE = 160
_REASON = 46  # column in which the reason of a class begins
_NARROW = 4  # the same on a narrow terminal
_WIDE = 100  # columns of a wide terminal
# Keys of a statement's endpoints that name credentials.
_CREDENTIALS = frozenset({"token_file", "basic_file", "api_key_file"})


def print_summary(outcome: Certification) -> None:
    """Print the summary to stdout; if the robot was not reached, print that to stderr."""
    document = outcome.document
    click.secho(warning(document), fg="red", nl=False)
    if outcome.exit_code == ExitCode.UNREACHABLE:
        reasons = (item["reason"] for item in document["requirements"] if item["verdict"] == "error")
        click.echo(f"error: {inert(next(reasons, 'the robot could not be reached'))}", err=True)
        return
    click.echo(f"{inert(document['refused'])}\n" if "refused" in document else "")
    _print_answers(document.get("motion", ()))
    for name, value in document["classes"].items():
        reason = document["class_reasons"].get(name, "")
        reason = "the device refused the credentials" if reason == document.get("refused") else reason
        view = " (black box)" if document["class_views"].get(name) == "black box" else ""
        mark, blanks = click.style(_MARKS[value], fg=_COLOURS.get(value)), " " * (13 - len(_MARKS[value]))
        # On a narrow terminal the reason gets lines of its own.
        below = (columns() or _WIDE) < _WIDE and reason
        told = wrap(" " * (_NARROW if below else _REASON) + inert(reason[:300]))
        click.echo(
            f"  {name + view:<30} {mark}{blanks}{chr(10) if below else ''}{told if below else told.lstrip()}".rstrip()
        )
    by_id = {requirement["id"]: requirement for requirement in document["requirements"]}
    for topic, question in QUESTIONS.items():
        found = [(cause, by_id[cause["requirement"]]) for cause in document["causes"]]
        found = [(cause, item) for cause, item in found if item["topic"] == topic]
        found = [(cause, item) for cause, item in found if item["verdict"] in {"fail", "warn"}]
        if found:
            click.echo(f"\n{question}")
        printed = Counter[str]()
        for cause, requirement in found:
            printed[requirement["id"]] += 1
            if printed[requirement["id"]] <= _IN_FULL:
                _print_cause(cause, requirement, outcome.path.parent)
            else:
                _print_line(cause, requirement)
    _print_unjudged(document)
    if "web_server" in document:
        say(f"\nThe web server\n  {inert(document['web_server']['text'])}")
    if document["causes"]:
        id_ = document["causes"][0]["requirement"]
        say(f"\nwhy a requirement matters and how to meet it: roaas explain ID, as in roaas explain {id_}")
    _print_counts(document)


def _print_counts(document: Mapping[str, Any]) -> None:
    """Print in what state the device was left, and last the verdict with the numbers of requirements."""
    not_claimed = "not judged" if "api" in document else "not-claimed"
    counts = Counter(requirement["verdict"] for requirement in document["requirements"])
    counts[not_claimed], counts["inconclusive"] = counts["not-claimed"], counts["error"]
    # In the order of the pages, and with the words of the classes.
    counts[_UNTESTED] = counts["skip"]
    order = ("fail", "inconclusive", "warn", _UNTESTED, "pass", not_claimed)
    told = ", ".join(f"{counts[value]} {value}" for value in order if counts[value])
    if "api" in document:
        _print_unshown(document["api"]["operations"], document["statement"]["endpoints"])
        _print_left(document["api"].get("left_behind", {}).get("lines", ()))
        called, described = document["api"]["coverage"]["operations"]
        told = f"{called} of {described} operations called; {told}"
    accepted = f", accepted by the baseline until {document['accepted_until']}" if "accepted_until" in document else ""
    if stale := document.get("stale"):
        accepted += f", but the baseline expects {few_of(stale, _SHOWN_BLOCKED)} to fail, so the exit code is 1"
    say(
        f"\n{document['verdict_line']}{accepted}: {told}; "
        f"{count_of(document['requests'], 'request')} in {document['duration_s']:.1f} s, seed {document['seed']}"
    )
    if counts[_UNTESTED] and "api" in document:
        say("not tested: this run could not try it, and the report says why; not judged: nothing called shows it")


def _print_answers(found: Sequence[Mapping[str, str]]) -> None:
    """Print the answers to the questions that a user of a moving device asks first."""
    for item in found:
        mark = click.style(
            f"{item['answer']:<9}", fg=_COLOURS[{"yes": "pass", "no": "fail"}.get(item["answer"], "inconclusive")]
        )
        click.echo(f"  {item['question']:<42} {mark} {inert(item['figure'])}".rstrip())
    if found:
        click.echo()


def warning(document: Mapping[str, Any], which: str = "") -> str:
    """Return the warning that the robot may still move, which is printed first, or an empty text."""
    said = document.get("stop_undelivered", "")
    return f"WARNING: {which}{inert(said)}\n" if said else ""


def _print_unjudged(document: Mapping[str, Any]) -> None:
    """Print what the baseline does not accept, and what was not judged because of a suite error or ``--minutes``."""
    for item in document["requirements"]:
        if item["reason"].startswith(ENTRY):
            say(f"\n{item['id']}: {inert(item['reason'].partition(': ')[0])}.")
    for id_ in document.get("stale", ()):
        say(f"\nThe baseline expects {id_} to fail, and it passes: delete the entry.")
    faults: Sequence[Mapping[str, Any]] = document.get("suite_errors", ())
    if faults:
        count = len({id_ for fault in faults for id_ in fault["requirements"]})
        say(f"\n{count_of(count, 'requirement')} could not be judged because of an error in the suite:")
    for fault in faults:
        say(f"  {inert(fault['text'])}")
    if "left_out" in document:
        say(f"\nNot everything was tried\n  {inert(document['left_out']['text'])}")


def _print_unshown(rows: list[dict[str, Any]], given: Collection[str]) -> None:
    """Print the operations that never responded 2xx to a request, and what they would need."""
    unshown = [row for row in rows if row["requests"] and not any(code.startswith("2") for code in row["statuses"])]
    if not unshown:
        return
    pronoun = "it" if len(unshown) == 1 else "them"
    say(f"\n{count_of(len(unshown), 'operation')} never answered 2xx, so little of {pronoun} was judged:")
    for row in unshown:
        statuses = (
            ", ".join(f"{count_of(count, 'time')} {code}" for code, count in row["statuses"].items()) or "no response"
        )
        need = f"; needs {row['needs']}" if "needs" in row else ""
        say(f"  {inert(row['operation'])}: {statuses}{need}")
    if any("401" in row["statuses"] for row in unshown) and not _CREDENTIALS.intersection(given):
        say("  credentials are given by --token-file, --basic-file or --api-key-file")
    names = sorted({name for row in unshown for name in row.get("values", ())})
    if names:
        click.echo("  values that the device knows, in a statement, may help:\n    [values]")
        for name in names:
            click.echo(f'    {inert(json.dumps(name, ensure_ascii=False))} = ["…"]')
    uncalled = {row["operation"] for row in rows if not row["called"]}
    creators = {f"POST {collection_of(row['operation'].partition(' ')[2])}" for row in unshown if row.get("values")}
    if found := sorted(creators & uncalled):
        say(f"  or let the run create them: {' '.join(f'--call {shlex.quote(inert(label))}' for label in found)}")


def _print_left(lines: Sequence[str]) -> None:
    """Print in which state the device was left."""
    if lines:
        say("\n  ".join(("\nLeft behind on the device:", *map(inert, lines))))


def _print_line(cause: dict[str, Any], requirement: dict[str, Any]) -> None:
    """Print a further finding of a requirement on one line."""
    failure = next(item for item in requirement["failures"] if item["number"] == cause["number"])
    said = f"{failure['subject']}: {failure['observed']}"
    said = said if len(said) <= _LINE else f"{said[:_LINE]}…"
    others = len(failure.get("operations", ())) - 1
    more = f" … and {count_of(others, 'more operation')}" if others > 0 else ""
    say(f"{cause['number']}. {_word(requirement, failure)} {requirement['id']}: {inert(said)}{more}")


def _word(requirement: Mapping[str, Any], failure: Mapping[str, Any]) -> str:
    """Return the word for a finding's effect: a doubtful one warns, even if another finding fails the requirement."""
    return "WARN" if "doubt" in failure else requirement["verdict"].upper()


def _print_cause(cause: dict[str, Any], requirement: dict[str, Any], folder: Path) -> None:
    """Print a finding, and the requirements that could not be tested because of it."""
    failure = next(item for item in requirement["failures"] if item["number"] == cause["number"])
    head = f"{_word(requirement, failure)} {requirement['id']} ({requirement['level']}, {requirement['source']})"
    say(f"\n{cause['number']}. {head}")
    if accepted := requirement.get("expected_failure"):
        say(f"  accepted by the baseline until {accepted['expires']}: {inert(accepted['reason'])}")
    # The others are in the report and in roaas explain.
    click.echo(wrap(f"  {_SENTENCE.split(requirement['text'], maxsplit=1)[0]}"))
    say(f"  {inert(cause['text'])}")
    if "breaks" in requirement:
        say(f"  what breaks in practice: {requirement['breaks']}")
    blocks = cause["blocks"]
    if blocks:
        say(f"  not tested because of it: {few_of(blocks, _SHOWN_BLOCKED)}")
    if failure["request"]:
        click.echo(f"  replay: {inert(_command(failure['request']['curl'], cause['number'], folder))}")


def _command(curl: str, number: int, folder: Path) -> str:
    """Return the command that sends a finding's request; a command that is too long stays in the result."""
    shown = len(curl) <= _SHOWN_CURL and curl.startswith("curl ")
    return curl if shown else f"roaas replay {shlex.quote(str(folder))} {number}"

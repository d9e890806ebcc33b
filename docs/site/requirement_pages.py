"""The ledger as pages: an index, a page for each class, each requirement and each subject of advice."""

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator

from conformance.cli.explain import EFFORTS, NEEDS, Explanation, explanation_of, ledger_of, page_of
from conformance.contract.classes import QUESTIONS, ConformanceClass, Origin
from conformance.contract.generic import generic_classes
from conformance.contract.ledger import Requirement
from conformance.contract.pack import Contract
from conformance.explaining.advice import FRAMEWORKS, Source, Topic, topics
from proof.mutation.self_test import self_test_of
from reports.formats.catalogue import page_of as clause_page

_INDEX = """# Requirements

Each rule that RoAAS judges has an id, such as [`http/head`](requirements/http/head.md). Its page gives the rule, why
it matters, its source, how it is judged, and how to meet it. On the command line, `roaas explain http/head` shows the
same.
The first part of an id is the conformance class.

A violated **MUST** fails, a violated **SHOULD** warns, a **MAY** informs ([verdicts](verdicts.md)).
[How to fix it](fixes.md) lists the requirements by subject, with code for {frameworks}.

| class | requirements | about |
|---|--:|---|
{classes}

## By question

{questions}

```{{toctree}}
:hidden:
:titlesonly:

{tree}
```
"""
_FIXES = """# How to fix it

Advice by subject. Each page has the requirements that it is about, and code for {frameworks} where that differs.

{subjects}
"""

_ORIGINS = {
    Origin.NORM: "It comes from a norm, so it binds every device of that kind.",
    Origin.DESCRIPTION: "It comes from a description (OpenAPI, WSDL), so it binds the device that is described.",
    Origin.WEAKNESS: "It comes from a catalogue of known weaknesses.",
    Origin.CONTRACT: "It comes from the contract, so it binds only robots that claim the contract.",
}


def pages() -> dict[str, str]:
    """Return the text of each page by its name in the source folder."""
    contract = Contract.load()
    ledger, mutants = ledger_of(contract), self_test_of(contract).mutants
    classes = {**generic_classes(), **contract.classes}
    found = {id_: explanation_of(contract, item, mutants) for id_, item in ledger.items()}
    by_class: dict[str, list[Requirement]] = defaultdict(list)
    for item in ledger.values():
        by_class[item.class_].append(item)
    names = [name for name in dict.fromkeys([*contract.classes, *classes]) if name in by_class]
    result = {"requirements.md": _index(found.values(), {name: by_class[name] for name in names}, classes)}
    result |= {f"requirements/{name}.md": _class(classes[name], by_class[name]) for name in names}
    result |= {f"{page_of(id_)}.md": _requirement(explanation, contract) for id_, explanation in found.items()}
    by_topic = {topic.title: [id_ for id_, one in found.items() if one.topic == topic] for topic in topics()}
    used = [topic for topic in topics() if by_topic[topic.title]]
    result["fixes.md"] = _FIXES.format(
        frameworks=_frameworks(),
        subjects="\n".join(
            f"- [{topic.title}](fixes/{_file(topic)}.md): {_ids(by_topic[topic.title], '')}" for topic in used
        ),
    )
    return result | {f"fixes/{_file(topic)}.md": _fix(topic, by_topic[topic.title]) for topic in used}


def _index(
    found: Iterable[Explanation], by_class: dict[str, list[Requirement]], classes: dict[str, ConformanceClass]
) -> str:
    rows = (
        f"| [`{name}`](requirements/{name}.md) | {len(items)} | {classes[name].title} |"
        for name, items in by_class.items()
    )
    by_topic: dict[str, list[str]] = defaultdict(list)
    for one in found:
        by_topic[one.requirement.topic or classes[one.requirement.class_].topic].append(one.requirement.id)
    questions = (f"**{question}** {_ids(by_topic[topic], '')}" for topic, question in QUESTIONS.items())
    return _INDEX.format(
        frameworks=_frameworks(),
        classes="\n".join(rows),
        questions="\n\n".join(questions),
        tree="\n".join(f"requirements/{name}" for name in by_class),
    )


def _class(class_: ConformanceClass, items: list[Requirement]) -> str:
    rows = (f"| [`{item.id}`]({item.id}.md) | {item.level} | {_cell(item.text)} |" for item in items)
    return "\n".join([
        f"# Class {class_.name}", "", f"{class_.title}.", "",
        "| requirement | level | rule |", "|---|---|---|", *rows, "",
    ])  # fmt: skip


def _requirement(explanation: Explanation, contract: Contract) -> str:
    """Return the page of one requirement, which lies two folders deep."""
    item, topic = explanation.requirement, explanation.topic
    aliases = f" Earlier ids: {', '.join(f'`{name}`' for name in item.aliases)}." if item.aliases else ""
    lines = [
        "---", "orphan: true", "---", "",
        f"# {item.id}", "",
        f"[Requirements](../../requirements.md) / [{item.class_}](../{item.class_}.md)", "",
        f"> {item.text}", "",
        f"Level **{item.level}**. {_ORIGINS[item.origin]}{aliases}", "",
    ]  # fmt: skip
    if explanation.why:
        lines += ["## Why it matters", "", explanation.why, ""]
    lines += ["## Source", "", *(line for source in explanation.sources for line in _source(source, contract)), ""]
    lines += ["## How it is judged", "", *_judged(explanation), ""]
    if explanation.mutants:
        lines += ["## Faulty devices that it must fail for", "", "`roaas selftest` runs each of these mutants.", ""]
        lines += [f"- `{mutant.name}`: {_prose(mutant.says)}" for mutant in explanation.mutants] + [""]
    if topic:
        code = f" Code for {_frameworks(topic)}: [{topic.title}](../../fixes/{_file(topic)}.md)." if topic.code else ""
        more = code or f" More: [{topic.title}](../../fixes/{_file(topic)}.md)."
        lines += ["## How to fix it", "", f"{topic.fix}{more}", ""]
    return "\n".join(lines)


def _source(source: Source, contract: Contract) -> Iterator[str]:
    section = contract.cited_sections.get(source.name.partition("#")[2])
    page = clause_page(source.name)
    if section:
        yield f"- the contract, [{section.title}](../../contract.md#{source.name.partition('#')[2]})"
        return
    name = f"[{source.name}]({page})" if page else source.name
    yield f"- {name}" + (f": {_prose(source.title)}" if source.title else "")
    for clause, meaning in source.meanings.items():
        yield f"  - {clause}: {meaning}"


def _judged(explanation: Explanation) -> Iterator[str]:
    item = explanation.requirement
    if item.untestable:
        yield f"Not from outside: {item.untestable}"
    for check in explanation.checks:
        yield f"- `{check.name}`: {_prose(check.does or 'Judges a recorded trace.')}"
        yield from (f"  - on the trace of: {_prose(text)}" for text in check.scenarios)
    yield ""
    if item.needs:
        yield f"The run needs {'; '.join(_prose(NEEDS[need]) for need in item.needs)}.\n"
    yield _prose(EFFORTS)


def _fix(topic: Topic, ids: list[str]) -> str:
    lines = ["---", "orphan: true", "---", "", f"# {topic.title}", "", "[How to fix it](../fixes.md)", ""]
    lines += [f"Requirements: {_ids(ids, '../')}.", "", topic.why, "", topic.fix, ""]
    for name, code in topic.code.items():
        title, language = FRAMEWORKS[name]
        lines += [f"```{{rubric}} {title}", "```", "", f"```{_lexer(code, language)}", code.rstrip(), "```", ""]
    return "\n".join(lines)


def _lexer(code: str, language: str) -> str:
    """Return the language of a piece of code: a framework's also has settings and command lines."""
    first = code.lstrip().splitlines()[0]
    if re.match(r"uvicorn |gunicorn ", code.lstrip().splitlines()[-1]):
        return "sh"
    return "properties" if re.match(r"# application|[a-z.-]+=\S+$|# springdoc", first) else language


def _frameworks(topic: Topic | None = None) -> str:
    return ", ".join(title for name, (title, _) in FRAMEWORKS.items() if topic is None or name in topic.code)


def _ids(ids: Iterable[str], up: str) -> str:
    return ", ".join(f"[`{id_}`]({up}{page_of(id_)}.md)" for id_ in ids)


def _file(topic: Topic) -> str:
    return re.sub(r"\W+", "-", topic.title.lower()).strip("-")


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _prose(text: str) -> str:
    """Return a text of the code with options as code, and without Markdown by accident."""
    parts = re.split(r"(`[^`]*`)", text)
    return "".join(
        part if part.startswith("`") else re.sub(r"([*_<>\[\]])", r"\\\1", re.sub(r"(--[\w-]+)", r"`\1`", part))
        for part in parts
    )

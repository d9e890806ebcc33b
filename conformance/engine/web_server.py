"""The result's part on the web server in front of a device's application, which is judged beside the verdict."""

from collections.abc import Collection, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import msgspec

from conformance.contract.ledger import Requirement
from conformance.contract.toml_file import Text, TomlFileError, read_toml
from conformance.verdict.finding import count_of
from conformance.verdict.verdicts import Value, Verdict

_KNOWN = Path(__file__).with_name("web_servers.toml")
_SERVER_SHOWN = 80


class _Remedy(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One way to meet rules that a server does not meet by itself.

    Attributes:
        words: such as "behind nginx"; a text follows that says what is met.
        meets: ids of the rules that are met then.
        servers: how the Server field begins, in lower case; empty: any server.
    """

    words: Text
    meets: tuple[Text, ...]
    servers: tuple[Text, ...] = ()


class _File(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    smuggling: tuple[Text, ...]
    remedy: tuple[_Remedy, ...]


@cache
def _known_servers() -> _File:
    return read_toml(_KNOWN, _File, TomlFileError)


def web_server(verdicts: Sequence[Verdict], server: str) -> dict[str, Any]:
    """Return server, text and smuggling for result.json; empty if no rule was judged.

    Args:
        verdicts: on the rules of the class.
        server: the value of the Server field; empty: the server sends none.
    """
    judged = [verdict for verdict in verdicts if verdict.evidence.cases]
    if not judged:
        return {}
    failed = {
        verdict.requirement.id: verdict.requirement for verdict in judged if verdict.value in {Value.FAIL, Value.WARN}
    }
    tricked = [id_ for id_ in failed if id_ in _known_servers().smuggling]
    text = " ".join(_sentences(failed.values(), len(judged), tricked, server))
    return {"server": server or None, "text": text, "smuggling": tricked}


def _sentences(failed: Collection[Requirement], judged: int, tricked: list[str], server: str) -> Iterator[str]:
    name = f"{server[:_SERVER_SHOWN]} by its Server field" if server else "which sends no Server field"
    if not failed:
        yield f"Its web server, {name}, meets each of the {count_of(judged, 'rule')} judged."
        return
    count = f"{len(failed)} of {count_of(judged, 'rule')}"
    named = ", ".join(f"{requirement.id} ({requirement.level}, {requirement.source})" for requirement in failed)
    yield f"Its web server, {name}, does not meet {count}: {named}."
    if tricked:
        yield (
            f"This weighs most behind a proxy or a firewall: {', '.join(tricked)}. Where two servers read such a "
            "request differently, a client can hide a second request in it (request smuggling)."
        )
    yield from _remedies([requirement.id for requirement in failed], server)
    yield "Most often the server does this, not the API, and the verdict stays; --class web-server judges by it."


def _remedies(failed: Sequence[str], server: str) -> Iterator[str]:
    """Yield this server's known remedies, each with the rules that it repairs."""
    for remedy in _known_servers().remedy:
        mended = [id_ for id_ in failed if id_ in remedy.meets]
        if mended and (not remedy.servers or server.lower().startswith(remedy.servers)):
            met = "every rule is met" if len(mended) == len(failed) else f"these are met: {', '.join(mended)}"
            yield f"{remedy.words[0].upper()}{remedy.words[1:]}, {met}."

"""Compare what credentials an operation needs in two descriptions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from conformance.documents.json_schema import Schema

# What a client has to know of a scheme of each type.
_KNOWN: Final = {"apiKey": ("in", "name"), "http": ("scheme",), "openIdConnect": ("openIdConnectUrl",)}
# A credential as a client knows it, with its scopes; several are needed together.
_Alternative = dict[tuple[str, ...], frozenset[str]]


def security_changes(old: tuple[Schema, Schema], new: tuple[Schema, Schema]) -> Iterator[tuple[bool, str]]:
    """Yield what changed in the credentials that an operation needs, and whether it breaks a client.

    Args:
        old: the document and the operation.
        new: likewise.
    """
    before, after = _alternatives(*old), _alternatives(*new)
    if all(one in after for one in before) and all(one in before for one in after):
        yield from _flows(old[0], new[0], before)
        return
    # A client with credentials that sufficed before must be let in.
    breaking = any(not any(_suffices(had, needed) for needed in after) for had in before)
    yield breaking, f"needs {_text(*new)}, before {_text(*old)}"


def _suffices(had: _Alternative, needed: _Alternative) -> bool:
    return all(scheme in had and scopes <= had[scheme] for scheme, scopes in needed.items())


def _demanded(document: Schema, operation: Schema) -> list[Schema]:
    """Return the alternatives of an operation: without one, no credentials are needed."""
    return operation.get("security", document.get("security")) or [{}]


def _schemes(document: Schema) -> Schema:
    found: Schema = document.get("components", {}).get("securitySchemes", {})
    return found


def _alternatives(document: Schema, operation: Schema) -> list[_Alternative]:
    schemes = _schemes(document)
    return [
        {_known(name, schemes.get(name)): frozenset(scopes) for name, scopes in one.items()}
        for one in _demanded(document, operation)
    ]


def _known(name: str, scheme: Any) -> tuple[str, ...]:
    """Return a scheme as a client knows it, whatever its name is; the name where it is not described."""
    kind = scheme.get("type") if isinstance(scheme, dict) else None
    if kind not in {*_KNOWN, "oauth2", "mutualTLS"}:
        return (name,)
    known = tuple(str(scheme.get(key, "")) for key in _KNOWN.get(kind, ()))
    # Header fields and the names of schemes are the same in any case (RFC 9110, 5.1 and 11.1).
    blind = kind == "http" or known[:1] == ("header",)
    return (kind, *(one.lower() if blind else one for one in known))


def _flows(old: Schema, new: Schema, demanded: list[_Alternative]) -> Iterator[tuple[bool, str]]:
    """Yield the ways to an OAuth token that are gone or lead elsewhere."""
    if not any(("oauth2",) in one for one in demanded):
        return
    before, after = (
        {
            (kind, key, str(flow[key]))
            for scheme in _schemes(document).values()
            if isinstance(scheme, dict) and scheme.get("type") == "oauth2"
            for kind, flow in scheme.get("flows", {}).items()
            for key in ("tokenUrl", "authorizationUrl")
            if key in flow
        }
        for document in (old, new)
    )
    for kind, key, url in sorted(before - after):
        yield True, f"the {key} {url} of the OAuth flow {kind} is gone"
    for kind, key, url in sorted(after - before):
        yield False, f"the {key} {url} of the OAuth flow {kind} is new"


def _text(document: Schema, operation: Schema) -> str:
    return " or ".join(
        " with ".join(f"{name} ({', '.join(scopes)})" if scopes else name for name, scopes in one.items())
        or "no credentials"
        for one in _demanded(document, operation)
    )

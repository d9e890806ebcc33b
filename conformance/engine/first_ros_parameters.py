"""Which operation is which parameter of a node: by the name in its path, and by the value that a read returns."""

from __future__ import annotations

import base64
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, Final
from urllib.parse import quote, unquote

from conformance.documents.openapi import Operation
from conformance.engine.commanded import body_schema

# Its type, and its value, by node and parameter.
Nodes = dict[str, dict[str, tuple[str, Any]]]
# Parameters that every node has.
_COMMON: Final = re.compile(r"(use_sim_time|start_type_description_service)$|qos_overrides\.")
# Words of paths whose parameters may be the names of a node and its parameter.
_NAMED: Final = re.compile("param|config|setting", re.IGNORECASE)
_DEPTH: Final = 5


def parameters_of(
    operations: Sequence[Operation], nodes: Nodes, get: Callable[[Operation], Any]
) -> Iterator[tuple[Operation, dict[str, Any]]]:
    """Yield the operations that read and set parameters, and the keys of the map for each.

    Args:
        operations: the description's.
        nodes: nodes of the live graph.
        get: reads an operation once, and returns the document.
    """
    for operation in operations:
        found: dict[str, list[tuple[Operation, dict[str, Any]]]] = {}
        for read, node, name in _candidates(operation, nodes) if operation.method == "GET" else ():
            kind, value = nodes[node][name]
            at = next((at for at, leaf in _leaves(get(read)) if _is_value(leaf, value)), None)
            if at is not None:
                keys = {"parameter": name, "node": node, "type": kind} | ({"at": at} if at else {})
                found.setdefault(read.template, []).append((read, keys))
        for (read, keys), *others in found.values():
            if not others:  # else it is open whose it is
                yield read, keys
                sets = (one for one in operations if one.template == operation.template and body_schema(one))
                yield from ((replace(one, template=read.template), keys) for one in sets if one.method != "GET")


def _candidates(operation: Operation, nodes: Nodes) -> Iterator[tuple[Operation, str, str]]:
    """Yield the reads that an operation may be, and the node and parameter of each."""
    before, _, last = operation.template.rpartition("/")
    for node, parameters in nodes.items():
        for name in (name for name, (kind, _) in parameters.items() if kind != "not_set" and not _COMMON.match(name)):
            if unquote(last) == name and "{" not in before:
                yield operation, node, name
            elif re.fullmatch(r"\{[^{}]*\}", last) and before.count("{") < 2 and _NAMED.search(before):  # noqa: PLR2004 - a node's
                for own in dict.fromkeys((node.strip("/"), node.rpartition("/")[2], node)):
                    filled = re.sub(r"\{[^{}]*\}", lambda _, own=own: quote(own, safe=""), before)  # type: ignore[misc]
                    yield replace(operation, template=f"{filled}/{quote(name, safe='')}"), node, name


def _leaves(document: Any, at: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values in a document by position, the document itself first."""
    yield at, document
    if isinstance(document, dict) and at.count("/") < _DEPTH:
        for name, value in document.items():
            yield from _leaves(value, f"{at}/{name.replace('~', '~0').replace('/', '~1')}")


def _is_value(found: Any, value: Any) -> bool:
    if isinstance(value, dict):
        octets = base64.b64decode(value["b64"])
        return found in (value["b64"], list(octets))
    return found == value and isinstance(found, bool) is isinstance(value, bool)

"""The resources of a contract: which operation a path and a method are for."""

import re
from dataclasses import dataclass
from functools import cached_property, lru_cache
from urllib.parse import unquote

from conformance.contract.pack import Contract
from conformance.documents.openapi import Operation, operations_of
from conformance.transport.exchange import sendable

# A parameter in a path.
PARAMETER = re.compile(r"\{([^{}]*)\}")


@dataclass(frozen=True)
class Resource:
    """All operations of one path, by method."""

    template: str
    operations: dict[str, Operation]

    @cached_property
    def pattern(self) -> re.Pattern[str]:
        """A regular expression that matches the paths of the template."""
        parts = PARAMETER.split(self.template)
        parts[::2] = map(sendable, parts[::2])
        return re.compile("".join(re.escape(part) if i % 2 == 0 else "[^/]*" for i, part in enumerate(parts)))

    @cached_property
    def methods(self) -> frozenset[str]:
        """The methods that the description declares, and HEAD if it declares GET."""
        given = frozenset(self.operations)
        return given | {"HEAD"} if "GET" in given else given

    @property
    def optional(self) -> bool:
        """Whether a robot need not implement it."""
        return all(operation.optional for operation in self.operations.values())


@lru_cache(maxsize=8)
def resources_of(contract: Contract) -> tuple[Resource, ...]:
    """Return the resources of a contract, in the description's order.

    Raises:
        ContractError: as operations_of().
    """
    by_path: dict[str, dict[str, Operation]] = {}
    for operation in operations_of(contract):
        by_path.setdefault(operation.template, {})[operation.method] = operation
    return tuple(Resource(template, operations) for template, operations in by_path.items())


@lru_cache(maxsize=8)
def _by_place(contract: Contract) -> dict[tuple[int, str], list[Resource]]:
    """Return the resources by how many slashes they have and by their first segment; empty: that is a template."""
    found: dict[tuple[int, str], list[Resource]] = {}
    for item in resources_of(contract):
        found.setdefault(_place(sendable(item.template)), []).append(item)
    return found


def _place(path: str) -> tuple[int, str]:
    first = path.split("/", 2)[1] if "/" in path else path
    return path.count("/"), "" if "{" in first else first


@lru_cache(maxsize=512)
def resource_at(contract: Contract, path: str) -> Resource | None:
    """Return the resource of a path, or None; literal paths precede templates (OpenAPI 3.1, 4.8.8.2)."""
    path, index = sendable(path), _by_place(contract)
    slashes, first = _place(path)
    near = [*index.get((slashes, first), ()), *(index.get((slashes, ""), ()) if first else ())]
    found = [item for item in near if item.pattern.fullmatch(path)]
    return min(found, key=lambda item: item.template.count("{"), default=None)


def matching(contract: Contract, method: str, path: str) -> Operation | None:
    """Return the operation of a request, or None; HEAD counts as GET. ``path`` is below the base URL, without query."""
    resource = resource_at(contract, path)
    return resource.operations.get("GET" if method == "HEAD" else method) if resource else None


def known_path(contract: Contract, path: str) -> bool:
    """Return whether the contract has a resource with this path."""
    return resource_at(contract, path) is not None


@lru_cache(maxsize=512)
def is_normal(path: str) -> bool:
    """Return whether a path has no segment that servers may remove: empty, ``.`` or ``..``."""
    segments = [unquote(segment) for segment in path.split("/")]
    return "" not in segments[1:-1] and not {".", ".."} & set(segments)


def inside_prefix(contract: Contract, path: str) -> bool:
    """Return whether a path begins like one of the contract's paths; another server may serve other paths."""
    return path.lstrip("/").split("/", 1)[0] in {
        item.template.lstrip("/").split("/", 1)[0] for item in resources_of(contract)
    }

"""Contract packs: folders with a contract's text, descriptions, ledger and checks.

A pack is found by its name (a folder of ``conformance/packs``, or an entry point in the group ``roaas.packs``) or by
its folder. A folder with only an OpenAPI or WSDL description is a pack too: its device is judged by the requirements
that apply to any web API.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import msgspec

from conformance.commandline.guard import is_of_memory
from conformance.contract.classes import FULL, ConformanceClass, Interface, Topic
from conformance.contract.described import DOCUMENT_NAME, ORIGINAL_NAME, UNRESOLVED_NAME
from conformance.contract.document_text import parsed
from conformance.contract.generic import LEDGER, ClassEntry, generic_classes, generic_ledger
from conformance.contract.ledger import LedgerError, Requirement, ids_by_alias, load_ledger
from conformance.contract.locating import GENERIC_RULES, MANIFEST, ContractError, folder_of, module_of
from conformance.contract.toml_file import Text, read_toml

#: Pack that is used if the command names none.
DEFAULT_PACK = "table1"
_OPENAPI_NAMES = ("openapi.yaml", "openapi.yml", "openapi.json")


class _Manifest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The content of ``pack.toml``."""

    name: Text
    version: Text
    title: Text
    class_: tuple[ClassEntry, ...] = msgspec.field(name="class")
    plugin: Text | None = None
    without: tuple[str, ...] = ()
    closed_answers: bool = False
    described: bool = False
    profiles: dict[str, tuple[str, ...]] = {}


@dataclass(frozen=True)
class Contract:
    """One contract pack.

    Attributes:
        directory: the pack's folder.
        openapi_path: the OpenAPI description, or None.
        wadl_path: the WADL, or None.
        publishers_path: the WSDL of the service that acts, or None.
        subscribers_path: the WSDL of the service that only reads, or None.
        only: ids of the requirements to judge; empty means all.
        manifest: content of ``pack.toml``, or None without that file.
    """

    directory: Path
    openapi_path: Path | None
    wadl_path: Path | None
    publishers_path: Path | None
    subscribers_path: Path | None
    only: tuple[str, ...] = ()
    manifest: _Manifest | None = field(default=None, repr=False, compare=False)

    def __hash__(self) -> int:
        """Return a cheap hash, because caches are looked up by contract several times for each request."""
        return hash(self.directory)

    @classmethod
    @cache  # reading openapi.yaml takes a third of a second
    def load(cls, pack: Path | str = DEFAULT_PACK, *, only: tuple[str, ...] = ()) -> Contract:
        """Return the pack with a name or in a folder.

        ``openapi.yaml`` (or .yml, .json), one ``*.wadl`` and at most two ``*.wsdl`` describe the device. The WSDL with
        "subscriber" in its name describes the service that only reads, the other one the service that acts.

        A pack with ``described = true`` was written by a run, from an API's own description. It is its JSON files: a
        result is data, and whatever else is in that folder is neither read nor executed.

        Raises:
            ContractError: there is no such pack, or it describes no interface, or one interface twice.
        """
        directory = folder_of(pack)
        path = directory / MANIFEST
        manifest = read_toml(path, _Manifest, ContractError) if path.is_file() else None
        if manifest is not None and manifest.described:
            if not (directory / DOCUMENT_NAME).is_file():
                raise ContractError(f"{directory} describes nothing: it has no {DOCUMENT_NAME}")
            return cls(directory, directory / DOCUMENT_NAME, None, None, None, only, manifest)
        openapi = next((directory / name for name in _OPENAPI_NAMES if (directory / name).is_file()), None)
        wsdls = sorted(directory.glob("*.wsdl"))
        reading = [path for path in wsdls if "subscriber" in path.name.lower()]
        acting = [path for path in wsdls if path not in reading]
        if openapi is None and not wsdls:
            raise ContractError(f"{directory} describes nothing: it has neither {_OPENAPI_NAMES[0]} nor a *.wsdl")
        for kind, found in (("services that act", acting), ("services that only read", reading)):
            if len(found) > 1:
                names = ", ".join(path.name for path in found)
                raise ContractError(f"{directory} has more than one WSDL of {kind}: {names}")
        return cls(
            directory,
            openapi,
            next(iter(sorted(directory.glob("*.wadl"))), None),
            acting[0] if acting else None,
            reading[0] if reading else None,
            only,
            manifest,
        )

    @property
    def name(self) -> str:
        """The pack's name; the folder's name without a manifest."""
        return self.manifest.name if self.manifest else self.directory.resolve().name

    @property
    def version(self) -> str:
        """The contract's version; empty without a manifest."""
        return self.manifest.version if self.manifest else ""

    @property
    def title(self) -> str:
        """The name of the contract in "conforms to …"."""
        return self.manifest.title if self.manifest else self.name

    @property
    def label(self) -> str:
        """The contract's name in results: the version for the default pack, otherwise name and version."""
        if self.name == DEFAULT_PACK:
            return self.version
        return f"{self.name} {self.version}" if self.manifest else f"own ({self.name})"

    @property
    def closed_answers(self) -> bool:
        """Whether ``additionalProperties: false`` of the description binds responses too."""
        return self.manifest is None or self.manifest.closed_answers

    @cached_property
    def classes(self) -> dict[str, ConformanceClass]:
        """The conformance classes by name, in the manifest's order; without a manifest, all generic ones.

        Raises:
            ContractError: a class neither declares its interfaces nor is a generic one.
        """
        generic = generic_classes()
        if self.manifest is None:
            return generic
        found: dict[str, ConformanceClass] = {}
        for entry in self.manifest.class_:
            known = generic.get(entry.name)
            if known is None and (entry.interfaces is None or entry.title is None):
                raise ContractError(
                    f"{self.directory / MANIFEST}: class {entry.name!r} needs title and interfaces; "
                    f"those that need none are {', '.join(generic)}"
                )
            interfaces = entry.interfaces or (known.interfaces if known else ())
            enough = known.one_is_enough if known else entry.one_is_enough
            topic = entry.topic or (known.topic if known else Topic.SERVICE)
            beside = known is not None and known.beside and not self.is_claimed
            found[entry.name] = ConformanceClass(
                entry.name,
                entry.title or known.title,  # type: ignore[union-attr] # checked above
                interfaces,
                enough,
                topic,
                beside=beside,
            )
        return found

    @property
    def acting(self) -> frozenset[str]:
        """The classes whose requests have effects that only ROS, or a class about ROS, shows."""
        return frozenset(entry.name for entry in self.manifest.class_ if entry.acts) if self.manifest else frozenset()

    @cached_property
    def profiles(self) -> dict[str, tuple[str, ...]]:
        """The classes that each profile claims; "full" claims all that decide a verdict.

        Raises:
            ContractError: a profile names an unknown class.
        """
        named = self.manifest.profiles if self.manifest else {}
        for profile, classes in named.items():
            for name in set(classes) - set(self.classes):
                raise ContractError(
                    f"{self.directory / MANIFEST}: profile {profile!r} names {name!r}, which is no class"
                )
        return {**named, FULL: tuple(name for name, item in self.classes.items() if not item.beside)}

    @property
    def interfaces(self) -> tuple[Interface, ...]:
        """The interfaces that the contract describes."""
        described = {
            Interface.REST: self.openapi_path,
            Interface.PUBLISHERS: self.publishers_path,
            Interface.SUBSCRIBERS: self.subscribers_path,
        }
        return tuple(name for name, path in described.items() if path)

    @cached_property
    def openapi(self) -> dict[str, Any]:
        """The OpenAPI document, or an empty one.

        Raises:
            ContractError: the file is neither YAML nor JSON, or not an object.
        """
        if self.openapi_path is None:
            return {}
        try:
            document = parsed(self.openapi_path.read_bytes(), self.openapi_path.name)
        except (ValueError, OSError) as error:
            raise ContractError(f"{self.openapi_path} cannot be read: {error}") from error
        if not isinstance(document, dict) or "paths" not in document:
            raise ContractError(f"{self.openapi_path} is no OpenAPI description: it has no 'paths'")
        return document

    @property
    def is_claimed(self) -> bool:
        """Whether devices claim the pack, whose author permits requests: an author wrote its ``pack.toml``, no run."""
        return self.manifest is not None and not self._is_data

    @cached_property
    def original(self) -> dict[str, Any]:
        """The OpenAPI document as its author wrote it; that of `openapi` if the pack has no other."""
        path = self.directory / ORIGINAL_NAME
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else self.openapi
        return found

    @cached_property
    def dead_references(self) -> tuple[str, ...]:
        """The references of the description to other files that lead nowhere."""
        path = self.directory / UNRESOLVED_NAME
        return tuple(json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else ()

    @cached_property
    def ledger(self) -> dict[str, Requirement]:
        """The requirements by id, class by class: the generic ones first, then the pack's own.

        Raises:
            ContractError: a ledger cannot be read, an id occurs twice, or one of ``only`` is unknown.
        """
        return {id_: item for id_, item in self._whole_ledger.items() if not self.only or id_ in self._only_ids}

    def demands(self, id_: str) -> bool:
        """Return whether the contract has a requirement, even if ``only`` leaves it out."""
        return id_ in self._whole_ledger

    @cached_property
    def ids_by_alias(self) -> dict[str, str]:
        """The present id of a requirement by each of its aliases."""
        return ids_by_alias(self._whole_ledger)

    def requirement(self, id_: str) -> Requirement | None:
        """Return the requirement with an id or an alias, or None."""
        return self.ledger.get(self.ids_by_alias.get(id_, id_))

    @property
    def _only_ids(self) -> frozenset[str]:
        chosen = frozenset(self.ids_by_alias.get(id_, id_) for id_ in self.only)
        if unknown := chosen - set(self._whole_ledger):
            raise ContractError(f"{self.name} has no requirement {min(unknown)!r}")
        return chosen

    @cached_property
    def _whole_ledger(self) -> dict[str, Requirement]:
        dropped = frozenset(self.manifest.without if self.manifest else ())
        generic = {
            id_: item
            for id_, item in generic_ledger().items()
            if self._classes_of(item) and dropped.isdisjoint({id_, *item.aliases})
        }
        # Of two equal requirements, keep the one that covers more.
        generic = {id_: item for id_, item in generic.items() if generic.keys().isdisjoint(item.same_as)}
        own: dict[str, Requirement] = {}
        path = self.directory / LEDGER
        if path.is_file() and not self._is_data:
            try:
                own = load_ledger(path, self.classes)
            except LedgerError as error:
                raise ContractError(str(error)) from error
        if twice := sorted(set(own) & set(generic)):
            raise ContractError(f"{path}: {twice[0]} is a requirement of the generic suite already")
        both = [self._place(item) for item in {**generic, **own}.values()]
        names = [name for item in both for name in (item.id, *item.aliases)]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ContractError(f"{path}: {twice[0]} names two requirements")
        return {item.id: item for item in sorted(both, key=lambda item: list(self.classes).index(item.class_))}

    def _classes_of(self, item: Requirement) -> tuple[str, ...]:
        """Return the pack's classes that have a requirement: its own, or the one that its alias names."""
        generic, before = generic_classes(), {alias.partition("/")[0] for alias in item.aliases}
        homes = [
            name
            if name in self.classes or name not in generic or generic[name].within not in before
            else generic[name].within
            for name in item.classes
        ]
        return tuple(dict.fromkeys(name for name in homes if name in self.classes))

    def _place(self, item: Requirement) -> Requirement:
        """Return a requirement in those classes of the pack that have it, with its topic."""
        own, *also = self._classes_of(item)
        return replace(item, class_=own, also=tuple(also), topic=item.topic or self.classes[own].topic)

    @cached_property
    def cited_sections(self) -> dict[str, Section]:
        """The sections of the contract's text that its requirements cite, by anchor.

        Raises:
            ContractError: the text cannot be read.
        """
        path = self.directory / TEXT_NAME
        if self._is_data or not path.is_file():
            return {}
        try:
            sections = sections_of(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError) as error:
            raise ContractError(f"{path} cannot be read: {error}") from error
        cited = cited_in(requirement.source for requirement in self.ledger.values())
        return {anchor: section for anchor, section in sections.items() if anchor in cited}

    @cached_property
    def plugin(self) -> ModuleType | None:
        """The pack's Python module, which defines its device model, or None.

        Raises:
            ContractError: the module cannot be imported.
        """
        if self._is_data or self.manifest is None or self.manifest.plugin is None:
            return None
        named = self.manifest.plugin
        try:
            return module_of(self.directory / named) if named.endswith(".py") else import_module(named)
        except (ImportError, OSError, SyntaxError) as error:
            if is_of_memory(error):
                raise MemoryError from error
            raise ContractError(
                f"{self.directory / MANIFEST}: the plugin {named} cannot be imported: {error}"
            ) from error

    @property
    def files(self) -> tuple[Path, ...]:
        """The files of the contract: everything in the pack's folder except Python modules."""
        return tuple(sorted(path for path in self.directory.iterdir() if path.is_file() and path.suffix != ".py"))

    @property
    def rules(self) -> tuple[Path, ...]:
        """The folders with the checks: the generic ones, then the pack's own."""
        own = self.directory / "rules"
        return (GENERIC_RULES, own) if own.is_dir() and not self._is_data else (GENERIC_RULES,)

    @property
    def _is_data(self) -> bool:
        """Whether a run wrote the pack into its result, from which nothing is executed."""
        return self.manifest is not None and self.manifest.described


TEXT_NAME = "contract.md"
_HEADING = re.compile(r"^#{1,6} +(?P<title>.+?) *$", re.MULTILINE)
_CITED = re.compile(rf"(?:^|; ){re.escape(TEXT_NAME)}#(?P<anchor>[\w-]+)")


class Section(NamedTuple):
    """A heading, and the Markdown text up to the next heading."""

    title: str
    text: str


def anchor_of(title: str) -> str:
    """Return the anchor that GitHub gives a heading: lower case, no punctuation, hyphens for spaces."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def sections_of(text: str) -> dict[str, Section]:
    """Return all sections of a Markdown text by anchor."""
    headings = list(_HEADING.finditer(text))
    ends = [heading.start() for heading in headings[1:]] + [len(text)]
    return {
        anchor_of(heading["title"]): Section(heading["title"], text[heading.end() : end].strip())
        for heading, end in zip(headings, ends, strict=True)
    }


def cited_in(sources: Iterable[str]) -> set[str]:
    """Return the anchors of the contract's text in requirements' sources."""
    return {anchor for source in sources for anchor in _CITED.findall(source)}

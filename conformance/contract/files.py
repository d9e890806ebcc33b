"""Where the files of a contract are, and the ledger that belongs to them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import yaml

from conformance.contract.ledger import LedgerError, Requirement, load_ledger
from conformance.contract.sections import TEXT_NAME, Section, cited_in, sections_of

CONTRACT_DIR = Path(__file__).parent
CONTRACT_VERSION = "1.1"
# Everything that makes up the contract, and so goes into `roaas contract export` and the suite's digest.
CONTRACT_FILES = (
    TEXT_NAME,
    "openapi.yaml",
    "publishers.wsdl",
    "publishers.xsd",
    "subscribers.wsdl",
    "subscribers.xsd",
    "robot.wadl",
    "requirements.toml",
)
# The classes that take their targets from the contract's files, whatever the domain is.
GENERIC_CLASSES = ("rest-formats", "http", "soap-basic-profile", "strict-input", "xml-security", "describe")
# libyaml, where PyYAML was built with it, is ten times as fast: a third of a second of each run.
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_OPENAPI_NAMES = ("openapi.yaml", "openapi.yml", "openapi.json")


class ContractError(Exception):
    """A contract folder that cannot be used; the message names the file and what is wrong with it."""


@dataclass(frozen=True)
class Contract:
    """The files of one contract.

    Attributes:
        directory: the folder that holds them.
        openapi_path: the OpenAPI description, or None where the contract has no REST side.
        wadl_path: the WADL, or None.
        publishers_path: the WSDL of the service that acts, or None.
        subscribers_path: the WSDL of the service that only reads, or None.
        only: ids of the requirements to judge by, so that other checks do not run; empty: all.
    """

    directory: Path
    openapi_path: Path | None
    wadl_path: Path | None
    publishers_path: Path | None
    subscribers_path: Path | None
    only: tuple[str, ...] = ()

    @classmethod
    @cache  # reading openapi.yaml takes a third of a second
    def load(cls, directory: Path = CONTRACT_DIR, *, only: tuple[str, ...] = ()) -> Contract:
        """Find the files in a folder.

        ``openapi.yaml`` (or .yml, .json), one ``*.wadl``, and at most two ``*.wsdl``: one whose name holds
        "subscriber" describes the service that only reads, the other one the service that acts.

        Raises:
            ContractError: there is no such folder, or nothing in it describes an interface, or too much does.
        """
        if not directory.is_dir():
            raise ContractError(f"{directory} is no folder: --contract takes one with openapi.yaml and/or *.wsdl in it")
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
        )

    @cached_property
    def own(self) -> bool:
        """Whether this is RoAAS's own contract, with resources that its own modules know."""
        return "/robot/pose/" in self.openapi.get("paths", {})

    @property
    def published(self) -> bool:
        """Whether this is RoAAS's own contract as it was published, and the whole of it."""
        return self.directory.resolve() == CONTRACT_DIR.resolve() and not self.only

    @cached_property
    def openapi(self) -> dict[str, Any]:
        """The OpenAPI document; empty where there is none.

        Raises:
            ContractError: the file is neither YAML nor JSON, or no object.
        """
        if self.openapi_path is None:
            return {}
        try:
            document = yaml.load(self.openapi_path.read_text(encoding="utf-8"), _LOADER)  # noqa: S506 - a safe one
        except (yaml.YAMLError, UnicodeDecodeError, OSError) as error:
            raise ContractError(f"{self.openapi_path} cannot be read: {error}") from error
        if not isinstance(document, dict) or "paths" not in document:
            raise ContractError(f"{self.openapi_path} is no OpenAPI description: it has no 'paths'")
        # Through JSON, so that YAML's dates and sharing are gone and what is left is what a robot can be asked for.
        plain: dict[str, Any] = json.loads(json.dumps(document, default=str))
        return plain

    @cached_property
    def ledger(self) -> dict[str, Requirement]:
        """The requirements that apply, by id.

        Raises:
            ContractError: its ledger cannot be read, or lacks one of ``only``.
        """
        ledger = self._whole_ledger()
        if unknown := set(self.only) - set(ledger):
            raise ContractError(f"{self.directory} has no requirement {min(unknown)!r}")
        return {id_: item for id_, item in ledger.items() if not self.only or id_ in self.only}

    def _whole_ledger(self) -> dict[str, Requirement]:
        """Of another domain: its own ``requirements.toml``, or what is generic in ours."""
        path = self.directory / "requirements.toml"
        try:
            if path.is_file():
                return load_ledger(path)
            ours = load_ledger(CONTRACT_DIR / "requirements.toml")
        except LedgerError as error:
            raise ContractError(str(error)) from error
        return {key: item for key, item in ours.items() if item.class_ in GENERIC_CLASSES and not item.own}

    @cached_property
    def cited_sections(self) -> dict[str, Section]:
        """The sections of the contract's text that its requirements cite, by anchor.

        Raises:
            ContractError: the text cannot be read.
        """
        path = self.directory / TEXT_NAME
        if not path.is_file():
            path = CONTRACT_DIR / TEXT_NAME
        try:
            sections = sections_of(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError) as error:
            raise ContractError(f"{path} cannot be read: {error}") from error
        cited = cited_in(requirement.source for requirement in self.ledger.values())
        return {anchor: section for anchor, section in sections.items() if anchor in cited}

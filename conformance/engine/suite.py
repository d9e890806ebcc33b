"""The identity of the suite: version, digests, and the contract packs it knows."""

import hashlib
from collections.abc import Mapping
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from conformance.contract.ledger import Requirement
from conformance.contract.pack import DEFAULT_PACK, Contract
from conformance.contract.requirement_sets import RequirementSet, current, load_set, names
from conformance.verdict.verdicts import holds_back

_PACKAGE = Path(__file__).parents[1]
_PROBE = _PACKAGE.parent / "ros_probe"
# Rooms whose code decides what is sent and judged.
JUDGING = (
    "contract",
    "statement",
    "papers_robot",
    "transport",
    "documents",
    "verdict",
    "observe",
    "target",
    "api",
    "measures",
    "scenarios",
    "checkers",
    "rules",
    "engine",
)
# Folders of a pack that only its self-test uses, and the module that names them.
_SELFTEST = {"mutants", "faulty_bodies", "independent_robots", "selftest.py"}


def version_of(name: str) -> str:
    """Return the version of a distribution, or a text that it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def suite_version() -> str:
    """Return the version of the installed suite."""
    return version_of("roaas")


def suite_digest(contract: Contract, package: Path = _PACKAGE) -> str:
    """Return a digest of everything that judges: the suite's modules and ledger, the pack's modules and files."""
    modules = {
        path.relative_to(package).as_posix(): path
        for room in JUDGING
        for pattern in ("*.py", "*.toml")
        for path in (package / room).rglob(pattern)
    }
    modules |= {f"ros_probe/{path.name}": path for path in _PROBE.glob("*.py")}
    pack = {f"the contract: {path.relative_to(contract.directory).as_posix()}": path for path in _judging(contract)}
    digest = hashlib.sha256()
    for name, path in sorted({**modules, **pack}.items()):
        digest.update(name.encode() + b"\0" + path.read_bytes() + b"\0")
    return f"sha256:{digest.hexdigest()}"


def contract_digests(contract: Contract) -> dict[str, str]:
    """Return the digest of each file of a contract, as `sha256:…`."""
    return {path.name: file_digest(path) for path in contract.files}


def file_digest(path: Path) -> str:
    """Return the digest of a file, as `sha256:…`.

    Raises:
        OSError: the file cannot be read.
    """
    return f"sha256:{hashlib.sha256(path.read_bytes()).hexdigest()}"


def suite_facts(pack: str | None = None) -> dict[str, Any]:
    """Return the facts with which a verifier checks this suite's certificates: digests, sets, ledger, profiles."""
    contract = Contract.load(pack or DEFAULT_PACK)
    sets = {
        set_.name: set_
        for set_ in (current(contract, contract.ledger), *map(partial(load_set, contract), names(contract)))
    }
    return {
        "suite": suite_digest(contract),
        "requirement_sets": {name: one.digest for name, one in sets.items()},
        "ledger": {id_: _facts_of(item, contract, sets) for id_, item in contract.ledger.items()},
        "contract": contract_digests(contract),
        "profiles": {name: list(classes) for name, classes in contract.profiles.items()},
    }


def _facts_of(item: Requirement, contract: Contract, sets: Mapping[str, RequirementSet]) -> dict[str, Any]:
    """Return the facts on a requirement for a certificate: the fields of `reports.attestation.outcomes.Entry`."""
    ids = {item.id, *item.aliases}
    return {
        "level": item.level,
        "text": item.text,
        "classes": list(item.classes),
        "aliases": list(item.aliases),
        "sets": [name for name, one in sets.items() if not ids.isdisjoint(one.requirements)],
        # For a device without a contract, a run leaves out requirements that no permitted request can test.
        "decides": holds_back(item) and contract.is_claimed,
        "beside": contract.classes[item.class_].beside,
    }


def _judging(contract: Contract) -> list[Path]:
    """Return the files of a pack that influence verdicts: everything but the modules of the self-test."""
    modules = (path for path in contract.directory.rglob("*.py") if not _SELFTEST.intersection(path.parts))
    return [*contract.files, *modules]

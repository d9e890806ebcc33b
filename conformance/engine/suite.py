"""The identity of the suite: version, digests, and the contract packs it knows."""

import hashlib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from conformance.contract.pack import DEFAULT_PACK, Contract
from conformance.contract.requirement_sets import current, load_set, names

_PACKAGE = Path(__file__).parents[1]
# The rooms that decide what is asked and what is said of it.
JUDGING = (
    "contract",
    "statement",
    "transport",
    "documents",
    "verdict",
    "observe",
    "api",
    "scenarios",
    "rules",
    "engine",
)
# What of a pack only its self-test uses: folders, and the module that names them.
_SELFTEST = {"mutants", "faulty_bodies", "independent_robots", "selftest.py"}


def installed(name: str) -> str:
    """Return the version of a distribution, or a text that it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def suite_version() -> str:
    """Return the version of the installed suite."""
    return installed("roaas")


def suite_digest(contract: Contract, package: Path = _PACKAGE) -> str:
    """Return a digest of everything that judges: the suite's modules and ledger, the pack's modules and files."""
    modules = {
        path.relative_to(package).as_posix(): path
        for room in JUDGING
        for pattern in ("*.py", "*.toml")
        for path in (package / room).rglob(pattern)
    }
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


def known(pack: str | None = None) -> dict[str, Any]:
    """Return what a verifier needs to recognise this suite's certificates: digest, requirement sets, profiles."""
    contract = Contract.load(pack or DEFAULT_PACK)
    sets = [load_set(contract, name) for name in names(contract)] or [current(contract, contract.ledger)]
    return {
        "suite": suite_digest(contract),
        "requirement_sets": {one.name: one.digest for one in sets},
        "profiles": {name: list(classes) for name, classes in contract.profiles.items()},
    }


def _judging(contract: Contract) -> list[Path]:
    """Return the files of a pack that influence verdicts: everything but the modules of the self-test."""
    modules = (path for path in contract.directory.rglob("*.py") if not _SELFTEST.intersection(path.parts))
    return [*contract.files, *modules]

"""Which suite this is: its version and digest, and what it knows."""

from __future__ import annotations

import hashlib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from conformance.contract.classes import PROFILES
from conformance.contract.files import Contract
from conformance.contract.requirement_sets import load_set, names

_PACKAGE = Path(__file__).parents[1]
# The rooms that decide what is asked and what is said of it.
JUDGING = ("contract", "transport", "documents", "verdict", "rest", "soap", "robot", "checks", "engine")


def installed(name: str) -> str:
    """Version of a distribution, or that it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def suite_version() -> str:
    """Version of the installed distribution."""
    return installed("roaas")


def suite_digest(contract: Contract, package: Path = _PACKAGE) -> str:
    """Digest over the package's modules that judge and the contract's files: two runs of one digest asked the same."""
    modules = {
        path.relative_to(package).as_posix(): path for room in JUDGING for path in (package / room).rglob("*.py")
    }
    texts = {f"the contract: {path.name}": path for path in _contract_files(contract)}
    digest = hashlib.sha256()
    for name, path in sorted({**modules, **texts}.items()):
        digest.update(name.encode() + b"\0" + path.read_bytes() + b"\0")
    return f"sha256:{digest.hexdigest()}"


def contract_digests(contract: Contract) -> dict[str, str]:
    """Each file of a contract with its digest, as `sha256:…`."""
    return {path.name: file_digest(path) for path in sorted(_contract_files(contract))}


def file_digest(path: Path) -> str:
    """Digest of a file, as `sha256:…`.

    Raises:
        OSError: it cannot be read.
    """
    return f"sha256:{hashlib.sha256(path.read_bytes()).hexdigest()}"


def known() -> dict[str, Any]:
    """What tells whether a certificate is of this suite: its digest, its requirement sets, its profiles' classes."""
    return {
        "suite": suite_digest(Contract.load()),
        "requirement_sets": {name: load_set(name).digest for name in names()},
        "profiles": {str(name): [str(class_) for class_ in classes] for name, classes in PROFILES.items()},
    }


def _contract_files(contract: Contract) -> list[Path]:
    return [path for path in contract.directory.iterdir() if path.is_file() and path.suffix != ".py"]

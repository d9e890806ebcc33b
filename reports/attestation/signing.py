"""Signing of a result and of the pages written from it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from reports.attestation.keys import signer_of
from reports.attestation.signature import seal
from reports.attestation.statement import statement_of
from reports.errors import ResultInvalidError


class Notary:
    """A key that signs results.

    Attributes:
        key: the key's fingerprint.
    """

    def __init__(self, path: Path) -> None:
        """Read the private key; errors as for `keys.signer_of`."""
        self._signer = signer_of(path)
        self.key = self._signer.public_key.keyid

    def envelope(self, path: Path, result: Mapping[str, Any], pages: Mapping[str, str]) -> str:
        """Return the envelope for a result file and its pages.

        Raises:
            ResultInvalidError: the result contradicts itself, for example because it was edited.
        """
        _agree(path, result)
        return seal(statement_of(result, path.read_bytes(), pages), self._signer)


def _agree(path: Path, result: Mapping[str, Any]) -> None:
    """Raise an error for a verdict that contradicts the classes, or a class that contradicts its requirements."""
    passed = {name for name, verdict in result["classes"].items() if verdict == "pass"}
    claimed = {name for name, verdict in result["classes"].items() if verdict != "not-claimed"}
    for item in result["requirements"]:
        if item["verdict"] == "fail" and item["class"] in passed:
            raise ResultInvalidError(f"{path}: it says that class {item['class']} passed, although {item['id']} failed")
    if result["verdict"] == "conformant" and (not passed or passed != claimed):
        raise ResultInvalidError(f"{path}: it says conformant, although not all claimed classes passed")

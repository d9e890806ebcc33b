"""Signing: a result and the pages that were written from it in, an envelope out."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from reports.attestation.keys import signer_of
from reports.attestation.signature import seal
from reports.attestation.statement import statement_of
from reports.errors import ResultInvalidError


class Notary:
    """Signs results with one key.

    Attributes:
        key: the key's fingerprint.
    """

    def __init__(self, path: Path) -> None:
        """Read the private key; errors as in `keys.signer_of`."""
        self._signer = signer_of(path)
        self.key = self._signer.public_key.keyid

    def envelope(self, path: Path, result: Mapping[str, Any], pages: Mapping[str, str]) -> str:
        """The envelope for a result file and its pages.

        Raises:
            ResultInvalidError: the result contradicts itself, as one that was edited may.
        """
        _agree(path, result)
        return seal(statement_of(result, path.read_bytes(), pages), self._signer)


def _agree(path: Path, result: Mapping[str, Any]) -> None:
    """Refuse a verdict that does not follow from the classes, or a class that does not from its requirements."""
    passed = {name for name, verdict in result["classes"].items() if verdict == "pass"}
    claimed = {name for name, verdict in result["classes"].items() if verdict != "not-claimed"}
    for item in result["requirements"]:
        if item["verdict"] == "fail" and item["class"] in passed:
            raise ResultInvalidError(f"{path}: class {item['class']} is told to have passed, and {item['id']} did not")
    if result["verdict"] == "conformant" and (not passed or passed != claimed):
        raise ResultInvalidError(f"{path}: it is told to be conformant, and not each of its classes passed")

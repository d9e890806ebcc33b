"""Sign a conformance result together with the pages written from it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from reports.attestation.keys import signer_of
from reports.attestation.signature import seal
from reports.attestation.statement import statement_of
from reports.errors import ResultInvalidError


class Notary:
    """A signer of conformance results that uses one private key.

    Attributes:
        key: the key's fingerprint (SHA-256 in hexadecimal).
    """

    def __init__(self, path: Path) -> None:
        """Read the private key from a PEM file; raise `KeyUnusableError` if that fails, like `keys.signer_of`."""
        self._signer = signer_of(path)
        self.key = self._signer.public_key.keyid

    def envelope(self, path: Path, result: Mapping[str, Any], pages: Mapping[str, str]) -> str:
        """Return the signed envelope (JSON text) for a result file and the pages written from it.

        Args:
            path: the file result.json, whose SHA-256 is signed.
            result: the parsed content of that file.
            pages: content of each page, by file name; the digests of the pages are signed as well.

        Raises:
            ResultInvalidError: the result contradicts itself, for example because somebody edited it.
        """
        _agree(path, result)
        return seal(statement_of(result, path.read_bytes(), pages), self._signer)


def _agree(path: Path, result: Mapping[str, Any]) -> None:
    """Raise `ResultInvalidError` if a result's verdicts contradict each other.

    A class must not pass if one of its requirements failed, and the run must not be conformant unless all claimed
    classes passed.
    """
    passed = {name for name, verdict in result["classes"].items() if verdict == "pass"}
    claimed = {name for name, verdict in result["classes"].items() if verdict != "not-claimed"}
    for item in result["requirements"]:
        if item["verdict"] == "fail" and item["class"] in passed:
            raise ResultInvalidError(f"{path}: it says that class {item['class']} passed, although {item['id']} failed")
    if result["verdict"] == "conformant" and (not passed or passed != claimed):
        raise ResultInvalidError(f"{path}: it says conformant, although not all claimed classes passed")

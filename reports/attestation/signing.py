"""Sign a conformance result together with the files that belong to it."""

import datetime as dt
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import msgspec
from securesystemslib.dsse import Envelope
from securesystemslib.signer import Signer

from reports.attestation.envelope import strict_json
from reports.attestation.files import DESCRIPTION, RECORDED, digests_in
from reports.attestation.keys import signer_of
from reports.attestation.outcomes import Entry, contradictions, departures, first_names
from reports.attestation.policy import Known
from reports.attestation.statement import PAYLOAD_TYPE, Statement, run_of, sha256, statement_of
from reports.errors import ResultUnsignableError


class Notary:
    """A signer of conformance results that uses one private key.

    Attributes:
        key: the key's fingerprint (SHA-256 in hexadecimal).
    """

    def __init__(self, path: Path, known: Callable[[], Mapping[str, object]] = dict) -> None:
        """Read the private key from a PEM file.

        Args:
            path: the file.
            known: returns the installed suite's `policy.Known`; the ledger of another suite or contract is not checked.

        Raises:
            KeyUnusableError: the file cannot be read, has a passphrase, or holds no Ed25519 private key.
        """
        self._signer = signer_of(path)
        self._known = known
        self.key = self._signer.public_key.keyid

    def check(self, path: Path, octets: bytes, result: Mapping[str, Any]) -> None:
        """Check that a result may be signed: it is complete, and agrees with itself, its folder and the ledger.

        Args:
            path: the file result.json.
            octets: the content of the file.
            result: the same, parsed and valid by its schema.

        Raises:
            ResultUnsignableError: it is not, for example because somebody edited it.
        """
        problems = [*_edit_notes(octets, result), *_disagreeing(result), *_replaced_files(path.parent, result)]
        known = msgspec.convert(self._known(), Known)
        run = run_of(result)
        problems += contradictions(run)
        if run.interrupted:
            problems.append("the run was interrupted")
        if "stop_undelivered" in result:
            problems.append(result["stop_undelivered"])
        if run.suite.digest == known.suite and run.requirement_set is not None:
            problems += departures(run, known.ledger, run.requirement_set.name, same=True)
            problems += _unlike(result, known.ledger)
        if problems:
            raise ResultUnsignableError(
                f"{path}: not signed. Only the complete and unchanged result of one run is. Found: "
                f"{'; '.join(problems[:5])}. Certify again, with `roaas certify --sign KEY`"
            )

    def envelope(self, path: Path, octets: bytes, result: Mapping[str, Any], pages: Mapping[str, str]) -> str:
        """Return the signed envelope (JSON text) for a checked result file and the pages written from it.

        Args:
            path: the file result.json.
            octets: its content, whose SHA-256 is signed.
            result: the same, parsed.
            pages: content of each page, by file name. The digests of the pages are signed, and those of the traces and
                of the description in the folder.

        Raises:
            ResultUnsignableError: a file of the folder cannot be signed, because it is a link.
        """
        files = {name: sha256(text.encode()) for name, text in pages.items()}
        return seal(
            statement_of(result, octets, files | digests_in(path.parent, described="api" in result)), self._signer
        )


def _edit_notes(octets: bytes, result: Mapping[str, Any]) -> list[str]:
    try:
        return [] if strict_json(octets) == result else ["the file changed while it was read"]
    except ValueError as error:
        return [f"{error}"]


def _replaced_files(directory: Path, result: Mapping[str, Any]) -> list[str]:
    """Return the files of the description in a result's folder that are not those that the device was judged by."""
    judged = {
        f"{DESCRIPTION}/{name}": digest.removeprefix("sha256:")
        for name, digest in ((result.get("digests") or {}).get("contract") or {}).items()
    }
    there = digests_in(directory, described="api" in result)
    other = [name for name, digest in there.items() if name not in RECORDED and judged.get(name) != digest]
    return [f"the device was not judged by these files: {first_names(other)}"] if other else []


def _unlike(result: Mapping[str, Any], ledger: Mapping[str, Entry]) -> list[str]:
    """Return what a result says of requirements that the ledger does not say, or that no run writes, in words."""
    found, claims = [], frozenset(result["statement"]["claims"])
    for item in result["requirements"]:
        id_, entry = item["id"], ledger.get(item["id"])
        if entry is None:
            continue
        if item["class"] != entry.classes[0]:
            found.append(f"{id_} is in class {item['class']}, not {entry.classes[0]}")
        if item["text"] != entry.text:
            found.append(f"{id_} has another text than in the ledger")
        unclaimed = item["verdict"] == "not-claimed"
        if claims.isdisjoint(entry.classes) and not unclaimed:
            found.append(f"{id_} ended with {item['verdict']!r}, although its class is not claimed")
        if unclaimed and item["cases"] and not claims.isdisjoint(entry.classes):
            found.append(f"{id_} is not claimed, although its class is, and {item['cases']} cases were tried")
    return found


def _disagreeing(result: Mapping[str, Any]) -> list[str]:
    """Return where the requirements of a result are not as a run writes them, in words."""
    found = []
    for item in result["requirements"]:
        id_, verdict, findings = item["id"], item["verdict"], len(item["failures"])
        if verdict == "pass" and not item["cases"]:
            found.append(f"{id_} passed without a case")
        if findings and (verdict in {"skip", "not-claimed"} or (verdict == "pass" and item["level"] != "MAY")):
            found.append(f"{id_} has {findings} findings, but ended with {verdict!r}")
    try:
        began, ended = (dt.datetime.fromisoformat(result[one] or result["started"]) for one in ("started", "finished"))
    except ValueError:
        return [*found, "the calendar has no such time as that of the run"]
    return [*found, "the run ended before it started; set the clock"] if ended < began else found


def seal(statement: Statement, signer: Signer) -> str:
    """Sign a statement and return the signed DSSE envelope as indented JSON text."""
    envelope = Envelope(msgspec.json.encode(statement), PAYLOAD_TYPE, {})
    envelope.sign(signer)
    return msgspec.json.format(msgspec.json.encode(envelope.to_dict()), indent=1).decode() + "\n"

"""A vendor with the result of a run in which every requirement of the installed suite passed, and with a key."""

import copy
import datetime as dt
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
from click.testing import CliRunner, Result
from securesystemslib.dsse import Envelope

from conformance.engine.suite import suite_facts, suite_version
from reports.attestation.keys import PRIVATE_NAME, PUBLIC_NAME, signer_of
from reports.attestation.statement import PAYLOAD_TYPE, sha256, statement_of
from roaas import main

_EXAMPLE = Path(__file__).parents[1] / "reports" / "data" / "result-example.json"
COUNT = len(suite_facts()["ledger"])
"""Number of requirements of the installed suite's default contract."""
Changing = Callable[[dict[str, Any]], object]


@cache
def _conformant() -> dict[str, Any]:
    result: dict[str, Any] = json.loads(_EXAMPLE.read_text(encoding="utf-8"))
    suite, pattern = suite_facts(), result["requirements"][0]
    del result["causes"]
    classes = suite["profiles"]["full"]
    result |= {
        "verdict": "conformant",
        "interrupted": False,
        "suite": {"version": suite_version(), "contract": "1.2", "digest": suite["suite"]},
        "requirement_set": {"name": "1.2", "digest": suite["requirement_sets"]["1.2"]},
        "digests": {"statement": "sha256:" + "1" * 64, "contract": suite["contract"]},
        "classes": dict.fromkeys(classes, "pass"),
        "class_reasons": {},
        "effort": "standard",
        "requirements": [
            {
                **pattern, "id": id_, "class": item["classes"][0], "level": str(item["level"]), "text": item["text"],
                "verdict": "pass", "reason": "", "cases": 3, "failures": [],
            }
            for id_, item in suite["ledger"].items()
        ],
    }  # fmt: skip
    result["statement"] |= {"claims": list(classes), "motion_allowed": True}
    return result


def failures() -> list[dict[str, Any]]:
    """Return the findings of a requirement that failed."""
    requirements = json.loads(_EXAMPLE.read_text(encoding="utf-8"))["requirements"]
    return next(one["failures"] for one in requirements if one["failures"])


def conformant() -> dict[str, Any]:
    """Return a new copy of the result, which ended an hour ago."""
    result = copy.deepcopy(_conformant())
    ended = dt.datetime.now(dt.UTC) - dt.timedelta(hours=1)
    result["started"] = result["finished"] = ended.strftime("%Y-%m-%dT%H:%M:%SZ")
    return result


def roaas(*words: object) -> Result:
    """Run the command in this process, as a user does."""
    return CliRunner().invoke(main, [str(word) for word in words])


@dataclass(frozen=True)
class Vendor:
    """A vendor who may lie.

    Attributes:
        folder: holds the result and what belongs to it.
        keys: the vendor's key pair.
    """

    folder: Path
    keys: Path

    @property
    def envelope(self) -> Path:
        return self.folder / "certificate.intoto.json"

    def write(self, result: dict[str, Any]) -> Path:
        """Write the result, and return its path."""
        self.folder.mkdir(exist_ok=True)
        path = self.folder / "result.json"
        path.write_text(json.dumps(result), encoding="utf-8")
        return path

    def sign(self, result: dict[str, Any]) -> Result:
        """Sign a result by the command."""
        self.write(result)
        return roaas("sign", self.folder, "--key", self.keys / PRIVATE_NAME)

    def forge(self, result: dict[str, Any], lie: Changing) -> None:
        """Sign what no suite would: the envelope of a result after a change of its statement."""
        path = self.write(result)
        pages = {"certificate.html": sha256(b"")}
        document = msgspec.to_builtins(statement_of(result, path.read_bytes(), pages))
        lie(document)
        self.seal(json.dumps(document).encode())

    def seal(self, payload: bytes, kind: str = PAYLOAD_TYPE) -> None:
        """Sign any content."""
        envelope = Envelope(payload, kind, {})
        envelope.sign(signer_of(self.keys / PRIVATE_NAME))
        self.folder.mkdir(exist_ok=True)
        self.envelope.write_text(json.dumps(envelope.to_dict()))

    def verify(self, *more: object) -> Result:
        """Verify the certificate by the vendor's public key and the default policy."""
        return roaas("verify", self.envelope, "--key", self.keys / PUBLIC_NAME, *more)


def run(**members: Any) -> Changing:
    """A statement with other facts about the run."""
    return lambda document: document["predicate"]["roaas"].update(members)


def outcomes(edit: Changing) -> Changing:
    """A statement with other outcomes."""
    return lambda document: edit(document["predicate"]["roaas"]["outcomes"])


def dropped(outcomes: dict[str, Any]) -> None:
    """Leave one of the requirements that passed."""
    del outcomes["MUST"]["pass"][1:]

"""A certificate that the default policy accepts, and everything that a forger has at hand."""

import base64
import datetime as dt
import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec
import pytest
from securesystemslib.dsse import Envelope
from vendors import Door, change, make_conformant

from reports.attestation.keys import PRIVATE_NAME, PUBLIC_NAME, generate, public_key, signer_of
from reports.attestation.policy import Known, Policy
from reports.attestation.signing import Notary
from reports.attestation.verifying import Verification, verify
from reports.rendering import render

NOW = dt.datetime(2026, 11, 21, 12, tzinfo=dt.UTC)


@dataclass(frozen=True)
class Desk:
    """Where a relying party sits: the files that it was sent, its own key and policy.

    Attributes:
        folder: holds what a vendor sent.
        keys: the vendor's keys, of which the party has the public one.
        result: what the vendor certifies.
        policy: what the party asks.
    """

    folder: Path
    keys: Path
    result: dict[str, Any]
    policy: Policy = field(default_factory=Policy)

    @property
    def envelope(self) -> Path:
        return self.folder / "certificate.intoto.json"

    @property
    def notary(self) -> Notary:
        return Notary(self.keys / PRIVATE_NAME)

    def sign(self, **changes: Any) -> None:
        """Have the vendor sign the result, with changes at paths such as `statement.robot.version`."""
        change(self.result, changes)
        self.folder.mkdir(exist_ok=True)
        (self.folder / "result.json").write_text(json.dumps(self.result), encoding="utf-8")
        render(self.folder, self.notary)

    def edit(self, **changes: Any) -> None:
        """Change keys of the envelope as it lies there."""
        document = {**json.loads(self.envelope.read_text()), **changes}
        self.envelope.write_text(json.dumps(document))

    @property
    def signatures(self) -> list[dict[str, str]]:
        return json.loads(self.envelope.read_text())["signatures"]

    @property
    def payload(self) -> str:
        """The payload as JSON text."""
        return base64.b64decode(json.loads(self.envelope.read_text())["payload"]).decode()

    def edit_payload(self, old: str, new: str) -> None:
        """Change what was signed, and leave the signature."""
        assert old in self.payload
        self.edit(payload=base64.b64encode(self.payload.replace(old, new).encode()).decode())

    def forge(self, **changes: Any) -> None:
        """Have the vendor sign facts that no run wrote, with changes at paths such as `extent__cases`."""
        document = json.loads(self.payload)
        change(document["predicate"]["roaas"], changes)
        self.seal(json.dumps(document).encode())

    def seal(self, payload: bytes) -> None:
        """Have the vendor sign any payload."""
        envelope = Envelope(payload, "application/vnd.in-toto+json", {})
        envelope.sign(signer_of(self.keys / PRIVATE_NAME))
        self.envelope.write_text(json.dumps(envelope.to_dict()))

    def asking(self, **points: Any) -> "Desk":
        return replace(self, policy=replace_points(self.policy, points))

    def check(self) -> Verification:
        known = msgspec.convert(Door.known(), Known)
        known = replace(known, profiles={**known.profiles, "paper": ("http",)})
        octets, key = self.envelope.read_bytes(), public_key(self.keys / PUBLIC_NAME)
        return verify(octets, key, self.policy, known, now=NOW, directory=self.folder)


def replace_points(policy: Policy, points: dict[str, Any]) -> Policy:
    return type(policy)(**{name: getattr(policy, name) for name in policy.__struct_fields__} | points)


@pytest.fixture
def desk(tmp_path: Path, result: dict[str, Any]) -> Desk:
    """A desk with a good certificate on it."""
    generate(tmp_path / "keys")
    make_conformant(result)
    desk = Desk(tmp_path / "sent", tmp_path / "keys", result)
    desk.sign()
    return desk

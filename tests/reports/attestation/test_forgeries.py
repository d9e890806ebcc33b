"""Each forgery is refused, and by its own reason: the envelope's are raised, the policy's are told point by point."""

import base64
import json

import pytest

from reports.attestation.envelope import ENVELOPE_NAME
from reports.attestation.keys import PRIVATE_NAME, generate
from reports.attestation.signing import Notary
from reports.attestation.statement import seed_of
from reports.errors import EnvelopeRefusedError
from reports.rendering import render


def test_the_good_one_is_accepted(desk):
    found = desk.check()
    assert [point for point in found.points if not point.met] == []
    assert found.statement.predicate.properties == ["ROAAS_CLASS_HTTP", "ROAAS_CLASS_SAFETY"]


def own_key(desk):
    generate(desk.keys / "forger")
    render(desk.folder, Notary(desk.keys / "forger" / PRIVATE_NAME))


def own_key_under_my_name(desk):
    mine = desk.signatures[0]["keyid"]
    own_key(desk)
    desk.edit(signatures=[{**desk.signatures[0], "keyid": mine}])


def resigned_as(**texts):
    """Another statement of the vendor's own, which is no certificate."""

    def forge(desk):
        desk.seal(json.dumps({**json.loads(desk.payload), **texts}).encode())

    return forge


def loose_base64(desk):
    """The same octets by another text: of the last letter before the padding, some bits say nothing."""
    signature = desk.signatures[0]
    letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"
    last = letters[letters.index(signature["sig"][-3]) + 1]
    loose = f"{signature['sig'][:-3]}{last}=="
    assert base64.b64decode(loose) == base64.b64decode(signature["sig"])
    desk.edit(signatures=[{**signature, "sig": loose}])


def cut(octets):
    return lambda desk: desk.envelope.write_bytes(desk.envelope.read_bytes()[:octets])


def stripped_key_id(desk):
    desk.edit(signatures=[{**desk.signatures[0], "keyid": ""}])


def key_beside_the_signature(desk):
    desk.edit(signatures=[{**desk.signatures[0], "publicKey": "…"}])


ENVELOPES = [
    ("swapped subject", lambda desk: desk.edit_payload("result.json", "other.json"), "not made by your key"),
    ("edited class", lambda desk: desk.edit_payload('"safety":"pass"', '"safety":"fail"'), "not made by your key"),
    ("hidden baseline", lambda desk: desk.edit_payload('"accepted":[]', '"accepted" :[]'), "not made by your key"),
    ("own key", own_key, "foreign key"),
    ("own key under my name", own_key_under_my_name, "not made by your key"),
    ("key inside the envelope", lambda desk: desk.edit(publicKey="…"), "unknown field `publicKey`"),
    ("key beside the signature", key_beside_the_signature, "unknown field `publicKey`"),
    ("other payload type", lambda desk: desk.edit(payloadType="application/json"), "payload type"),
    ("stripped signature", lambda desk: desk.edit(signatures=[]), "length >= 1"),
    ("doubled signature", lambda desk: desk.edit(signatures=desk.signatures * 2), "length <= 1"),
    ("no key id", stripped_key_id, "names no key"),
    ("other statement type", resigned_as(_type="https://in-toto.io/Statement/v0.1"), "Statement/v0.1"),
    ("other predicate type", resigned_as(predicateType="https://in-toto.io/attestation/vulns/v0.1"), "vulns/v0.1"),
    ("other predicate", resigned_as(predicate={"verifier": {}}), "not a certificate of a run"),
    ("loose base64", loose_base64, "not canonical base64"),
    ("no base64", lambda desk: desk.edit(payload="{}"), "not base64"),
    ("truncated file", cut(500), "not an envelope"),
    ("empty file", cut(0), "not an envelope"),
    ("nested file", lambda desk: desk.envelope.write_text("[" * 100_000), "not an envelope"),
    ("huge file", lambda desk: desk.envelope.write_text(" " * (5 << 20)), "bytes"),
]


@pytest.mark.parametrize(("forge", "reason"), [pytest.param(*rest, id=name) for name, *rest in ENVELOPES])
def test_a_forged_envelope_proves_nothing(desk, forge, reason):
    forge(desk)
    with pytest.raises(EnvelopeRefusedError, match=reason):
        desk.check()


def edited(name):
    return lambda desk: (desk.folder / name).write_text((desk.folder / name).read_text().replace("Courier", "Carrier"))


def other_envelope(desk):
    """A good certificate beside the result of another robot."""
    good = desk.envelope.read_bytes()
    desk.sign(statement__robot__name="Courier 8")
    (desk.folder / ENVELOPE_NAME).write_bytes(good)


def accepted_failure(desk):
    first, *others = desk.result["requirements"]
    desk.sign(requirements=[{**first, "verdict": "warn", "expected_failure": {"reason": "ticket 7"}}, *others])


def signed_with(**changes):
    return lambda desk: desk.sign(**changes)


def ended_at(time):
    return lambda desk: desk.sign(started=time, finished=time)


def forged_with(**changes):
    return lambda desk: desk.forge(**changes)


def nothing(_):
    pass


PAGES = {"certificate.html", "certificate-print.html"}
ANOTHER_SEED = {"nonce", "requirements", "agreement"}
OTHER = PAGES | {"certificate.md", "junit.xml", "agreement"}


INCONCLUSIVE = {"verdict": "inconclusive", "classes": {"http": "pass", "safety": "inconclusive"}}
OLDER = {"name": "1.0", "digest": "sha256:" + "0" * 64}
# Signed by the vendor's key, each is genuine, and not what was asked for.
RESULTS = [
    ("edited page", edited("certificate.html"), {}, {"certificate.html"}),
    ("edited sheet", edited("certificate-print.html"), {}, {"certificate-print.html"}),
    ("edited result", edited("result.json"), {}, {"result.json", "agreement"}),
    ("beside another result", other_envelope, {}, {"result.json"} | OTHER),
    ("another robot", nothing, {"robot": "Courier 8"}, {"robot"}),
    ("another vendor", nothing, {"vendor": "Somebody"}, {"vendor"}),
    ("old firmware", signed_with(statement__robot__version="1.0"), {"firmware": "2.4.1"}, {"firmware"}),
    ("dropped class", signed_with(classes={"http": "pass"}), {}, {"classes"}),
    ("fewer classes than asked", nothing, {"classes": ("http", "describe")}, {"classes"}),
    ("inconclusive class", signed_with(**INCONCLUSIVE), {}, {"verdicts", "classes"}),
    ("patched suite", signed_with(suite__digest="sha256:" + "6" * 64), {}, {"suites"}),
    ("requirements of one's own", signed_with(requirement_set=None), {}, {"requirement_sets"}),
    ("old requirements", signed_with(requirement_set=OLDER), {}, {"requirement_sets"}),
    ("patched requirements", signed_with(requirement_set__digest="sha256:" + "0" * 64), {}, {"requirement_sets"}),
    ("quick effort", signed_with(effort="quick"), {}, {"efforts"}),
    ("no motion", signed_with(statement__motion_allowed=False), {}, {"motion"}),
    ("ROS not seen", signed_with(class_views={"http": "black box"}), {"ros": True}, {"ros"}),
    ("baseline", signed_with(baseline={"digest": "sha256:" + "3" * 64}), {}, {"baseline"}),
    ("accepted failure", accepted_failure, {}, {"baseline", "classes"}),
    ("part of a run", forged_with(interrupted=True), {}, {"interrupted", "agreement"}),
    ("expired", signed_with(started="2025-11-20T11:00:00Z", finished="2025-11-20T12:00:00Z"), {}, {"max_age_days"}),
    ("a clock six minutes ahead", ended_at("2026-11-21T12:06:00Z"), {}, {"max_age_days"}),
    ("from the future", signed_with(finished="2026-11-22T12:00:00Z"), {}, {"max_age_days"}),
    ("replayed nonce", signed_with(nonce="monday", seed=seed_of("monday")), {"nonce": "tuesday"}, {"nonce"}),
    ("nonce and another seed", forged_with(nonce="monday", seed=0), {"nonce": "monday"}, ANOTHER_SEED),
    ("no nonce", nothing, {"nonce": "monday"}, {"nonce"}),
]


@pytest.mark.parametrize(("forge", "asked", "refused"), [pytest.param(*rest, id=name) for name, *rest in RESULTS])
def test_a_genuine_certificate_of_something_else_is_refused_by_its_point(desk, forge, asked, refused):
    forge(desk)
    found = desk.asking(**asked).check()
    assert {point.name for point in found.points if not point.met} == refused
    assert not found.accepted


WAIVERS = [
    (signed_with(effort="quick"), {"efforts": ("quick",)}),
    (signed_with(statement__motion_allowed=False), {"motion": False}),
    (signed_with(suite__digest="sha256:6"), {"suites": ("installed", "sha256:6")}),
    (signed_with(classes={"http": "pass"}), {"profile": "paper"}),
    (signed_with(baseline={"digest": "sha256:" + "3" * 64}), {"baseline": True}),
    (signed_with(started="2025-11-20T11:00:00Z", finished="2025-11-20T12:00:00Z"), {"max_age_days": 400}),
    (signed_with(class_views={"http": "seen on ROS"}), {"ros": True}),
    (signed_with(nonce="monday", seed=seed_of("monday")), {"nonce": "monday"}),
    (ended_at("2026-11-21T12:04:00Z"), {}),
    (nothing, {"robot": "Courier 7", "vendor": "Example Robotics", "firmware": "2.4.1"}),
]


@pytest.mark.parametrize(("make", "asked"), WAIVERS)
def test_what_a_policy_allows_is_accepted(desk, make, asked):
    make(desk)
    assert desk.asking(**asked).check().accepted

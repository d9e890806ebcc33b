"""A vendor who lies, and whoever changes what a vendor signed: `roaas sign` or `roaas verify` refuses, and says why."""

import base64
import json
import os
import shutil
import tomllib
import unicodedata
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from signed_results import COUNT, conformant, dropped, failures, outcomes, roaas, run

from reports.attestation.keys import PRIVATE_NAME, PUBLIC_NAME, generate, public_key
from reports.attestation.verifying import unseal
from reports.errors import EnvelopeRefusedError, KeyUnusableError

_SETS = Path(__file__).parents[2] / "conformance" / "packs" / "table1" / "sets"
_IN_SET = len(tomllib.loads((_SETS / "1.2.toml").read_text())["requirements"])


def test_a_complete_result_is_signed_and_accepted(honest):
    done = honest.verify("--result", honest.folder)
    assert (done.exit_code, "ACCEPTED" in done.output) == (0, True), done.output
    assert f"all {COUNT} requirements of the suite" in done.output


def requirement(place, **members):
    """A result in which one requirement has other members."""
    return lambda result: result["requirements"][place].update(members)


def of_result(**members):
    return lambda result: result.update(members)


def of_statement(**members):
    return lambda result: result["statement"].update(members)


def first_of(level, result):
    return next(one for one in result["requirements"] if one["level"] == level)


def only_one(result):
    del result["requirements"][1:]


def twice(result):
    result["requirements"].append(result["requirements"][0])


def invented(result):
    result["requirements"].append(result["requirements"][0] | {"id": "http/invented", "class": "http"})


# What is changed in a result, and what `roaas sign` says of it.
EDITED = [
    ("one requirement of all", only_one, f"{COUNT - 1} of {COUNT} requirements are not listed"),
    ("a requirement twice", twice, "is listed more than once"),
    ("an invented requirement", invented, "the suite has no requirement http/invented"),
    ("a MUST as SHOULD", lambda result: first_of("MUST", result).update(level="SHOULD"), "but is a MUST"),
    ("another class", requirement(0, **{"class": "describe"}), "is in class describe"),
    ("another text", requirement(0, text="It MAY answer."), "has another text"),
    ("another id", requirement(0, id="rest-resources/Reachable"), "has no requirement rest-resources/Reachable"),
    ("passed without a case", requirement(0, cases=0), "passed without a case"),
    ("skipped MUST", requirement(0, verdict="skip"), "passed, although the MUST"),
    ("a MUST with an error", requirement(0, verdict="error"), "passed, although the MUST"),
    ("hidden after cases", requirement(0, verdict="not-claimed"), "is not claimed, although its class is"),
    ("failed MUST", requirement(0, verdict="fail", failures=failures()), "although rest-resources/reachable failed"),
    ("passed with findings", requirement(0, failures=failures()), "findings, but ended with 'pass'"),
    ("fewer claims", of_statement(claims=["http"]), "has a verdict, but was not claimed"),
    ("a class failed", lambda result: result["classes"].update(http="fail"), "not all claimed classes passed"),
    ("an invented class", lambda result: result["classes"].update(magic="not-claimed"), "has no class magic"),
    ("a seed of one's choice", of_result(nonce="monday", seed=1), "seed was not derived from the nonce"),
    ("interrupted", of_result(interrupted=True), "the run was interrupted"),
    ("a robot that may still move", of_result(stop_undelivered="the robot may still move"), "the robot may still move"),
    ("no day of the calendar", of_result(finished="2026-02-30T00:00:00Z"), "the calendar has no such time"),
    ("ended before it began", of_result(started="2027-01-01T00:00:00Z"), "ended before it started"),
]


@pytest.mark.parametrize(("edit", "said"), [pytest.param(*rest, id=name) for name, *rest in EDITED])
def test_what_no_run_writes_is_not_signed(vendor, edit, said):
    result = conformant()
    edit(result)
    done = vendor.sign(result)
    assert (done.exit_code, said in done.output) == (2, True), done.output
    assert "Certify again" in done.output
    assert not vendor.envelope.exists()
    assert "not signed" in (vendor.folder / "certificate.html").read_text(), "the pages are written all the same"


def test_a_result_in_which_a_name_occurs_twice_is_not_signed(vendor):
    """Of two verdicts, another reader may take the other."""
    path = vendor.write(conformant())
    path.write_text(path.read_text().replace('{"format"', '{"verdict": "not-conformant", "format"', 1))
    done = roaas("sign", vendor.folder, "--key", vendor.keys / PRIVATE_NAME)
    assert (done.exit_code, "'verdict' occurs twice" in done.output) == (2, True), done.output


@pytest.mark.parametrize("name", ["/", "../sent", ".", "nowhere"])
def test_a_name_in_a_result_leads_to_no_folder(vendor, name):
    done = vendor.sign(conformant() | {"pack": {"name": name, "version": "1", "title": "robot"}})
    assert (done.exit_code, "give its folder with --contract" in done.output) == (2, True), done.output


def extent(**members):
    return lambda document: document["predicate"]["roaas"]["extent"].update(members)


def other_words(outcomes):
    outcomes["MUST"]["Pass"] = outcomes["MUST"].pop("pass")


def doubled(outcomes):
    outcomes["MUST"]["pass"].append(outcomes["MUST"]["pass"][0])


def former(document):
    """A certificate as the former version signed it."""
    for name in ("outcomes", "extent"):
        del document["predicate"]["roaas"][name]


def subject(name, digest="0" * 64):
    return lambda document: document["subject"].append({"name": name, "digest": {"sha256": digest}})


def other_file(document):
    document["subject"][-1]["digest"]["sha256"] = "0" * 64


# What a vendor who holds the key signs, the point that refuses it, and what is said.
FORGED = [
    ("one requirement", outcomes(dropped), "requirements", "requirements are not listed"),
    ("a requirement twice", outcomes(doubled), "requirements", "more than once"),
    ("words of another case", outcomes(other_words), "requirements", "'Pass' is no verdict"),
    ("a class in capitals", run(classes={"http": "PASS"}), "requirements", "'PASS' is no verdict of a class"),
    ("a verdict with a space", run(verdict="conformant "), "verdicts", "demanded: conformant"),
    ("effort in capitals", run(effort="Standard"), "efforts", "standard or deep"),
    ("claims shrunk", extent(claims=["http"]), "requirements", "was not claimed"),
    ("a class not claimed", run(classes={"http": "pass"}), "classes", "not claimed, so not tested: rest-resources"),
    ("no requests", extent(requests=0), "requirements", "although no request was sent"),
    ("few cases", extent(cases=0.01), "cases", "at least 4%"),
    ("few operations", extent(operations=[1, 40]), "operations", "1 of 40 operations called"),
    ("cut short", extent(left_out=3.0), "left_out", "--minutes 3"),
    ("errors of the suite", extent(suite_errors=["http/head"]), "suite_errors", "could not judge http/head"),
    ("properties", lambda one: one["predicate"].update(properties=[]), "requirements", "properties"),
    ("another verifier", lambda one: one["predicate"]["verifier"].update(id="urn:x"), "requirements", "verifier"),
    ("a later time", lambda one: one["predicate"].update(timeCreated="2098-01-01T00:00:00Z"), "requirements", "time"),
    ("other policies", lambda one: one["predicate"]["verifier"].update(policies=[]), "requirements", "policies"),
    ("a seed of one's choice", run(nonce="monday", seed=1), "requirements", "seed was not derived"),
    ("two digests of a file", subject("result.json"), "requirements", "two digests"),
    ("another contract file", other_file, "contract", "not the files of the installed contract"),
    ("a contract file more", subject("contract/more.toml"), "contract", "more.toml"),
    ("former version", former, "requirements", "a former version of RoAAS signed it"),
    ("former version, extent", former, "extent", "roaas sign DIR --key KEY"),
    ("another seed than the nonce's", run(nonce="monday", seed=1), "nonce", "was not derived from it"),
    ("no time zone", run(finished="2026-11-01T00:00:00"), "max_age_days", "in UTC"),
]  # fmt: skip


@pytest.mark.parametrize(("lie", "point", "said"), [pytest.param(*rest, id=name) for name, *rest in FORGED])
def test_what_a_vendor_signs_by_hand_is_refused_by_its_point(vendor, lie, point, said):
    vendor.forge(conformant(), lie)
    done = vendor.verify("--nonce", "monday") if point == "nonce" else vendor.verify()
    assert done.exit_code == 1, done.output
    refused = {line.split()[1] for line in done.output.splitlines() if line.startswith("  REFUSED")}
    assert point in refused
    assert said in done.output
    assert done.output.count("demanded: ") == done.output.count("what to do: ") == len(refused)


@pytest.mark.parametrize(
    ("verdict", "outcome", "said", "to_do"),
    [
        ("not-claimed", "not-claimed", "not claimed, so not tested: safety", "--class safety"),
        ("inconclusive", "skip", "claimed, but not tested in full: safety, such as safety/", "certify safety again"),
        ("fail", "fail", "tested, and failed: safety (safety/", "the robot has to meet safety first"),
    ],
)
def test_claimed_tested_and_passed_are_three_words(vendor, verdict, outcome, said, to_do):
    result = conformant()
    result["classes"]["safety"] = verdict
    result["verdict"] = "inconclusive"
    for item in result["requirements"]:
        if item["class"] == "safety":
            item["verdict"] = outcome
    vendor.forge(result, lambda document: document)
    done = vendor.verify()
    assert (done.exit_code, said in done.output, to_do in done.output) == (1, True, True), done.output


def edited(**members):
    """An envelope with other members."""

    def forge(vendor):
        document = {**json.loads(vendor.envelope.read_text()), **members}
        vendor.envelope.write_text(json.dumps(document))

    return forge


def replaced(old, new):
    return lambda vendor: vendor.envelope.write_text(vendor.envelope.read_text().replace(old, new, 1))


def signatures(edit):
    def forge(vendor):
        document = json.loads(vendor.envelope.read_text())
        document["signatures"] = edit(document["signatures"])
        vendor.envelope.write_text(json.dumps(document))

    return forge


def payload(edit):
    """Sign another text of the payload, by the vendor's key."""

    def forge(vendor):
        text = base64.b64decode(json.loads(vendor.envelope.read_text())["payload"]).decode()
        vendor.seal(edit(text).encode())

    return forge


def other_kind(vendor):
    """A signature over the same content by another payload type, put into an envelope with ours."""
    envelope = json.loads(vendor.envelope.read_text())
    vendor.seal(base64.b64decode(envelope["payload"]), "application/vnd.in-toto")
    edited(payloadType="application/vnd.in-toto+json")(vendor)


# What is done to a genuine envelope besides what reports/attestation/test_forgeries.py does, and why it is refused.
CHANGED = [
    ("payload twice", replaced('"payload"', '"payload": "e30=", "payload"'), "'payload' occurs twice"),
    (
        "name twice in the payload",
        payload(lambda text: text.replace('"verdict"', '"verdict":"x","verdict"', 1)),
        "twice",
    ),
    ("empty signature", signatures(lambda one: [one[0] | {"sig": ""}]), "not made by your key"),
    ("zero signature", signatures(lambda one: [one[0] | {"sig": base64.b64encode(bytes(64)).decode()}]), "not made by"),
    ("key id in capitals", signatures(lambda one: [one[0] | {"keyid": one[0]["keyid"].upper()}]), "foreign key"),
    ("payload as an object", edited(payload={}), "Expected `str`"),
    ("another payload type", edited(payloadType="application/vnd.in-toto+JSON"), "payload type"),
    ("signed as another type", other_kind, "not made by your key"),
    ("URL-safe base64", edited(payload="e30_"), "not base64"),
    ("a line feed in base64", edited(payload="e30=\n"), "not base64"),
    ("data after the end", lambda vendor: vendor.envelope.write_text(vendor.envelope.read_text() + "{}"), "trailing"),
    ("UTF-16", lambda one: one.envelope.write_text(one.envelope.read_text(), encoding="utf-16"), "malformed"),
    ("NaN", payload(lambda text: text.replace('"cases":', '"cases":NaN,"x":', 1)), "malformed"),
]


@pytest.mark.parametrize(("forge", "said"), [pytest.param(*rest, id=name) for name, *rest in CHANGED])
def test_a_changed_envelope_proves_nothing(honest, vendor, forge, said):
    shutil.copytree(honest.keys, vendor.keys, dirs_exist_ok=True)
    shutil.copytree(honest.folder, vendor.folder)
    forge(vendor)
    done = vendor.verify()
    assert (done.exit_code, said in done.output) == (1, True), done.output
    assert "Nothing is proved" in done.output
    assert any(words in done.output for words in ("Ask the vendor", "ask the vendor", "compare its fingerprint"))


def test_a_name_in_another_normal_form_is_another_name(vendor):
    result = conformant()
    result["statement"]["robot"]["name"] = unicodedata.normalize("NFD", "Möbius")
    assert vendor.sign(result).exit_code == 0
    policy = vendor.folder / "policy.toml"
    policy.write_text(f'robot = "{unicodedata.normalize("NFC", "Möbius")}"')
    done = vendor.verify("--policy", policy)
    assert (done.exit_code, "REFUSED by your policy: robot" in done.output) == (1, True), done.output


@settings(max_examples=60)
@given(data=st.data())
def test_any_change_of_the_envelope_is_refused(honest, data):
    """Unless it is the same JSON: between its members, an envelope may have other white space."""
    octets = bytearray(honest.envelope.read_bytes())
    place = data.draw(st.integers(0, len(octets) - 1))
    kind = data.draw(st.sampled_from(["change", "cut", "remove", "insert"]))
    octet = data.draw(st.integers(0, 255))
    if kind == "change":
        octets[place] = octet
    elif kind == "cut":
        del octets[place:]
    elif kind == "remove":
        del octets[place]
    else:
        octets.insert(place, octet)
    key = public_key(honest.keys / PUBLIC_NAME)
    try:
        unseal(bytes(octets), key)
    except EnvelopeRefusedError:
        return
    assert json.loads(octets) == json.loads(honest.envelope.read_bytes())


KEYS = [
    ("the neutral point", "01" + "00" * 31),
    ("order 2", "ec" + "ff" * 30 + "7f"),
    ("order 4", "00" * 32),
    ("order 4, the other", "00" * 31 + "80"),
    ("order 8", "26e8958fc2b227b045c3f489f2ef98f0d5dfac05d3c63339b13802886d53fc05"),
    ("order 8, the second", "26e8958fc2b227b045c3f489f2ef98f0d5dfac05d3c63339b13802886d53fc85"),
    ("order 8, the third", "c7176a703d4dd84fba3c0b760d10670f2a2053fa2c39ccc64ec7fd7792ac037a"),
    ("order 8, the fourth", "c7176a703d4dd84fba3c0b760d10670f2a2053fa2c39ccc64ec7fd7792ac03fa"),
]


@pytest.mark.parametrize("point", [pytest.param(point, id=name) for name, point in KEYS])
def test_a_key_for_which_anybody_can_sign_is_refused(tmp_path, point):
    der = bytes.fromhex("302a300506032b6570032100") + bytes.fromhex(point)
    path = tmp_path / "key.pem"
    path.write_bytes(b"-----BEGIN PUBLIC KEY-----\n" + base64.b64encode(der) + b"\n-----END PUBLIC KEY-----\n")
    with pytest.raises(KeyUnusableError, match="weak key"):
        public_key(path)


def test_a_file_with_two_keys_is_refused(tmp_path):
    """One of them would be ignored, and its signatures refused without a reason."""
    for name in ("one", "two"):
        generate(tmp_path / name)
    both = tmp_path / "both.pem"
    both.write_bytes(b"".join((tmp_path / name / PUBLIC_NAME).read_bytes() for name in ("one", "two")))
    with pytest.raises(KeyUnusableError, match="more than one key"):
        public_key(both)


def test_a_leading_name_reads_no_file(vendor):
    vendor.forge(conformant(), subject("../../../../etc/passwd"))
    done = vendor.verify("--result", vendor.folder)
    assert (done.exit_code, "leads out of the folder" in done.output) == (1, True), done.output


@pytest.mark.parametrize("kind", ["pipe", "endless", "folder"])
@pytest.mark.parametrize("name", ["result.json", "traces.json.gz", "certificate.html"])
def test_what_is_no_file_keeps_nobody_waiting(honest, tmp_path, name, kind):
    shutil.copytree(honest.folder, tmp_path / "sent")
    path = tmp_path / "sent" / name
    path.unlink(missing_ok=True)
    {"pipe": lambda: os.mkfifo(path), "endless": lambda: path.symlink_to("/dev/zero"), "folder": path.mkdir}[kind]()
    done = honest.verify("--result", tmp_path / "sent")
    assert "Traceback" not in done.output
    if name == "result.json":
        assert (done.exit_code in {1, 2}, "ACCEPTED" in done.output) == (True, False), done.output
    else:
        signed = name != "traces.json.gz" and kind != "folder"
        assert (done.exit_code, f"REFUSED  {name}" in done.output) == (int(signed), signed), done.output


def test_a_file_without_a_digest_is_not_as_it_was_signed(vendor):
    vendor.forge(conformant(), lambda document: document["subject"].append({"name": "x", "digest": {"md5": "0"}}))
    (vendor.folder / "x").symlink_to("/dev/null")
    done = vendor.verify("--result", vendor.folder)
    assert (done.exit_code, "REFUSED  x " in done.output) == (1, True), done.output


def test_an_envelope_that_contradicts_its_result_is_refused(vendor):
    result = conformant()
    vendor.forge(result, run(robot={"name": "Another"}))
    done = vendor.verify("--result", vendor.folder)
    assert "the certificate says otherwise than result.json: robot" in done.output, done.output


def test_the_statement_beside_the_result_is_compared(vendor):
    result = conformant()
    result["places"] = {"statement": {"file": "robot.toml", "line": 1, "classes": {}}}
    assert vendor.sign(result).exit_code == 0
    (vendor.folder / "robot.toml").write_text("[robot]\n")
    done = vendor.verify("--result", vendor.folder)
    assert (done.exit_code, "REFUSED  robot.toml" in done.output) == (1, True), done.output


def test_another_suite_cannot_know_the_whole_ledger_and_says_so(vendor, tmp_path):
    result = conformant()
    result["suite"]["digest"] = "sha256:" + "6" * 64
    result["requirements"].append(result["requirements"][0] | {"id": "http/newer", "class": "http"})
    done = vendor.sign(result)
    assert (done.exit_code, "were not compared with a ledger" in done.stderr) == (0, True), done.output
    policy = tmp_path / "policy.toml"
    policy.write_text(f'suites = ["{result["suite"]["digest"]}"]\n')
    done = vendor.verify("--policy", policy)
    assert done.exit_code == 0, done.output
    more = COUNT - _IN_SET + 1
    assert f"all {_IN_SET} requirements of the set 1.2, and {more} beyond it" in done.output
    assert "unknown here: another suite or contract than yours judged the robot" in done.output
    del result["requirements"][0]
    assert vendor.sign(result).exit_code == 0
    done = vendor.verify("--policy", policy)
    assert (done.exit_code, f"1 of {_IN_SET} requirements are not listed" in done.output) == (1, True), done.output


def test_a_certificate_with_too_many_classes_is_none(vendor):
    """A registry has a column for each class."""
    vendor.forge(conformant(), run(classes={f"class-{number}": "pass" for number in range(201)}))
    done = vendor.verify()
    assert (done.exit_code, "length <= 200" in done.output) == (1, True), done.output

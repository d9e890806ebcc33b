"""Keys, signatures and the commands: what is written, what openssl makes of it, what is said."""

import base64
import hashlib
import json
import re
import resource
import shutil
import subprocess
import sys

import pytest
from click.testing import CliRunner
from processes import ended
from vendors import Door, requirement

from reports.attestation.keys import PRIVATE_NAME, PUBLIC_NAME, generate, public_key, signer_of
from reports.attestation.policy import Known, Policy, read_policy
from reports.certificate.page import Seal
from reports.cli.attestation import keygen, verify
from reports.cli.signing import sign
from reports.errors import KeyUnusableError, PolicyUnusableError, ResultInvalidError
from reports.rendering import render


def run(command, *arguments):
    return CliRunner().invoke(command, [str(argument) for argument in arguments], obj=Door())


def test_openssl_verifies_the_signature(desk, tmp_path):
    document = json.loads(desk.envelope.read_text())
    payload = base64.b64decode(document["payload"])
    kind = document["payloadType"].encode()
    # DSSE v1, pre-authentication encoding, written out once more.
    encoded = b"DSSEv1 %d %s %d %s" % (len(kind), kind, len(payload), payload)
    (tmp_path / "signed").write_bytes(encoded)
    (tmp_path / "signature").write_bytes(base64.b64decode(document["signatures"][0]["sig"]))
    command = ["openssl", "pkeyutl", "-verify", "-pubin", "-inkey", desk.keys / PUBLIC_NAME, "-rawin"]
    command += ["-in", tmp_path / "signed", "-sigfile", tmp_path / "signature"]
    done = ended(*command)
    assert done.returncode == 0, done.stderr
    (tmp_path / "signed").write_bytes(encoded + b" ")
    assert subprocess.run(command, capture_output=True, check=False).returncode != 0


def test_openssl_knows_a_key_by_the_same_fingerprint(tmp_path):
    fingerprint = generate(tmp_path)
    der = ["openssl", "pkey", "-pubin", "-in", tmp_path / PUBLIC_NAME, "-outform", "DER"]
    octets = subprocess.run(der, capture_output=True, check=True).stdout
    digest = subprocess.run(["sha256sum"], input=octets, capture_output=True, check=True).stdout
    assert digest.split()[0].decode() == fingerprint
    assert public_key(tmp_path / PUBLIC_NAME).keyid == fingerprint


def test_a_private_key_is_for_its_owner_and_never_overwritten(tmp_path):
    assert run(keygen, tmp_path / "keys").exit_code == 0
    private = tmp_path / "keys" / PRIVATE_NAME
    before = private.read_bytes()
    assert private.stat().st_mode & 0o777 == 0o600
    again = run(keygen, tmp_path / "keys")
    assert (again.exit_code, str(private) in again.stderr) == (2, True), again.stderr
    assert private.read_bytes() == before


@pytest.mark.parametrize("kind", ["RSA", "X25519", "garbage", "missing"])
def test_only_ed25519_keys_are_taken(tmp_path, kind):
    private, public = tmp_path / "private.pem", tmp_path / "public.pem"
    if kind == "garbage":
        private.write_text("no key")
        public.write_text("no key")
    elif kind != "missing":
        subprocess.run(["openssl", "genpkey", "-quiet", "-algorithm", kind, "-out", private], check=True)
        subprocess.run(["openssl", "pkey", "-in", private, "-pubout", "-out", public], check=True)
    with pytest.raises(KeyUnusableError):
        signer_of(private)
    with pytest.raises(KeyUnusableError):
        public_key(public)


def test_keys_are_not_taken_for_one_another(tmp_path):
    generate(tmp_path)
    with pytest.raises(KeyUnusableError, match="not a private key"):
        signer_of(tmp_path / PUBLIC_NAME)
    with pytest.raises(KeyUnusableError, match="not a public key"):
        public_key(tmp_path / PRIVATE_NAME)


def test_subjects_are_the_files_that_the_run_was_made_with(desk):
    subjects = {item["name"]: item["digest"]["sha256"] for item in json.loads(desk.payload)["subject"]}
    files = ["result.json", "certificate.html", "certificate.md", "junit.xml", "certificate-print.html"]
    assert list(subjects) == [*files, "statement", "contract/openapi.yaml"]
    assert subjects["statement"] == "1" * 64
    done = ended("sha256sum", desk.folder / "result.json", check=True)
    assert done.stdout.split()[0] == subjects["result.json"]


def test_neither_addresses_nor_commands_are_signed(desk):
    for secret in (desk.result["target"]["rest"], desk.result["command"], "192.0.2.17"):
        assert secret not in desk.payload


@pytest.mark.parametrize(
    "lie",
    [
        {"verdict": "conformant", "classes": {"http": "pass", "safety": "fail"}},
        {"verdict": "conformant", "classes": {"http": "not-claimed"}},
    ],
)
def test_a_result_that_contradicts_itself_is_not_signed(desk, lie):
    with pytest.raises(ResultInvalidError):
        desk.sign(**lie)


def test_a_class_whose_requirement_failed_is_not_signed_as_passed(desk):
    with pytest.raises(ResultInvalidError, match="http/x"):
        desk.sign(requirements=[requirement("fail")])


def test_the_page_says_whose_signature_it_bears_and_rendering_keeps_it(desk):
    page = (desk.folder / "certificate.html").read_text()
    assert f"sha256:{desk.notary.key}" in page
    render(desk.folder)
    assert (desk.folder / "certificate.html").read_text() == page
    (desk.folder / "result.json").write_text(json.dumps(desk.result | {"seed": 1}))
    render(desk.folder)
    assert desk.notary.key not in (desk.folder / "certificate.html").read_text(), "signed was another result"


def test_the_sheet_for_print_shows_both_fingerprints(desk):
    sheet = (desk.folder / "certificate-print.html").read_text()
    assert f"sha256:{desk.notary.key}" in sheet
    digest = hashlib.sha256((desk.folder / "result.json").read_bytes()).hexdigest()
    assert f"sha256:{digest}" in sheet
    assert Seal(digest, desk.notary.key).code in sheet
    assert not re.search(r"(src|href)=.(https?:)?//", sheet)


def test_the_sheet_is_one_page(desk, tmp_path):
    """Also with all classes and long names."""
    names = {f"class-{number}": "pass" for number in range(12)}
    desk.sign(
        classes=names,
        requirements=[],
        statement__claims=list(names),
        statement__robot__name="A long name of a robot " * 9,
    )
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    assert browser, "the pages' tests need a Chromium"
    command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
    command += ["--no-first-run", f"--user-data-dir={tmp_path / 'profile'}", "--no-pdf-header-footer"]
    command += [f"--print-to-pdf={tmp_path / 'sheet.pdf'}", (desk.folder / "certificate-print.html").as_uri()]
    subprocess.run(command, capture_output=True, check=True, timeout=240)
    assert len(re.findall(rb"/Type\s*/Page\b", (tmp_path / "sheet.pdf").read_bytes())) == 1


def test_commands_from_key_to_verdict(desk, tmp_path):
    desk.envelope.unlink()
    assert run(sign, desk.folder, "--key", desk.keys / PRIVATE_NAME).exit_code == 0
    arguments = [desk.envelope, "--key", desk.keys / PUBLIC_NAME]
    lenient = tmp_path / "policy.toml"
    lenient.write_text("max_age_days = 100000\n")
    accepted = run(verify, *arguments, "--policy", lenient, "--result", desk.folder)
    assert (accepted.exit_code, "ACCEPTED" in accepted.stdout) == (0, True), accepted.stdout
    assert "the holder of this key vouches that this run took place" in " ".join(accepted.stdout.split())
    assert "Not proved: that the robot is genuine" in " ".join(accepted.stdout.split())
    refused = run(verify, *arguments, "--policy", lenient, "--nonce", "monday")
    assert (refused.exit_code, "REFUSED by your policy: nonce" in refused.stdout) == (1, True), refused.stdout
    desk.edit(signatures=[])
    forged = run(verify, *arguments)
    assert (forged.exit_code, "Nothing is proved" in forged.stdout) == (1, True), forged.stdout


def test_what_cannot_be_read_is_no_verdict(desk, tmp_path):
    key = desk.keys / PUBLIC_NAME
    missing = tmp_path / "missing"
    for arguments in ([missing, "--key", key], [desk.envelope, "--key", missing]):
        assert run(verify, *arguments).exit_code == 2
    assert run(verify, desk.envelope, "--key", key, "--policy", missing).exit_code == 2
    assert run(verify, desk.envelope, "--key", key, "--result", missing).exit_code == 2
    assert run(sign, missing, "--key", desk.keys / PRIVATE_NAME).exit_code == 2
    assert run(sign, desk.folder, "--key", missing).exit_code == 2


@pytest.mark.parametrize(
    ("line", "named"),
    [
        ("effort = 1", "unknown key 'effort'; did you mean 'efforts'[?]"),
        ("zzz = 1", "unknown key 'zzz'; known are robot, vendor"),
        ("efforts = 1", "efforts = 1 must be a list of quick, standard and deep"),
        ("verdicts = ['conform']", "must be a list of conformant, not-conformant and inconclusive"),
        ("tested = 40", "tested = 40 must be a number from 0 to 1"),
        ("motion = 'yes'", "motion = 'yes' must be true or false"),
        ("robot = 1", "robot = 1 must be a string"),
        ("suites = [1]", r"suites = \[1\] must be a list of strings"),
        ("max_age_days = 0", "max_age_days = 0 must be a positive number"),
        ("profile = 'all'", "all"),
        ("x", "policy.toml is no TOML"),
    ],
)
def test_a_policy_is_read_strictly(tmp_path, line, named):
    path = tmp_path / "policy.toml"
    path.write_text(line)
    with pytest.raises(PolicyUnusableError, match=named):
        read_policy(path, Known(profiles={"full": ()}))


def test_the_page_of_certificates_shows_the_default_policy(tmp_path, pytestconfig):
    text = (pytestconfig.rootpath / "docs" / "certificates.md").read_text(encoding="utf-8")
    shown = text.partition("```toml\n")[2].partition("```")[0]
    path = tmp_path / "policy.toml"
    path.write_text(shown)
    assert read_policy(path, Known(profiles={"full": ()})) == Policy()
    lines = {line.removeprefix("# ").partition(" =")[0] for line in shown.splitlines() if " = " in line}
    assert lines == set(Policy.__struct_fields__), "each point is a line"


def test_verifying_is_cold_under_a_second(desk):
    command = [sys.executable, "-m", "roaas", "verify", desk.envelope, "--key", desk.keys / PUBLIC_NAME]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = ended(*command)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert done.returncode == 1, done.stderr
    assert "which the policy does not trust" in done.stdout, "the suite of the test is not the one that is installed"
    # The processor's time, which does not depend on what else the machine does.
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 1.0


def test_verifying_imports_nothing_heavy():
    code = "import sys, reports.cli.attestation; print(*sys.modules)"
    done = ended(sys.executable, "-c", code, check=True)
    assert not {"jinja2", "jsonschema", "lxml", "numpy", "matplotlib", "rclpy"} & set(done.stdout.split())

"""The certificate of a device that was judged by its own description: each of its files is signed."""

import shutil
from pathlib import Path

import pytest
from signed_results import Vendor, roaas
from small_device import certified, constant, described, reading, small_device

from reports.attestation.keys import PRIVATE_NAME, PUBLIC_NAME, generate

_POLICY = """
classes = ["description", "robustness", "http"]
requirement_sets = ["unfrozen"]
efforts = ["quick"]
motion = false
"""


@pytest.fixture(scope="module")
def device(tmp_path_factory):
    """The certificate of a device that was judged by its own description, and a policy for it."""
    folder = tmp_path_factory.mktemp("device")
    generate(folder / "keys")
    (folder / "policy.toml").write_text(_POLICY)
    schema = {"type": "object", "required": ["value"], "properties": {"value": {"type": "integer"}}}
    routes = {"/state": constant({"value": 1})}
    with small_device(described({"/state": reading(schema)}), routes) as url:
        done = certified(url, folder / "sent", "--sign", folder / "keys" / PRIVATE_NAME)
    assert done.exit_code == 0, done.text
    return Vendor(folder / "sent", folder / "keys")


def accepted(vendor: Vendor, sent: Path):
    """Verify what was sent by the policy."""
    policy, contract = vendor.keys.parent / "policy.toml", vendor.folder / "description"
    return vendor.verify("--policy", policy, "--contract", contract, "--result", sent)


FILES = [
    "result.json", "certificate.html", "certificate.md", "certificate-print.html", "junit.xml", "traces.json.gz",
    "description/openapi.json", "description/original.json", "description/pack.toml", "description/unresolved.json",
]  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_each_file_of_the_folder_is_signed(device, tmp_path, name):
    shutil.copytree(device.folder, tmp_path / "sent")
    with (tmp_path / "sent" / name).open("ab") as file:
        file.write(b" ")
    done = accepted(device, tmp_path / "sent")
    assert (done.exit_code, f"REFUSED  {name}" in done.output) == (1, True), done.output


def test_the_certificate_of_a_described_device_is_accepted_with_its_files(device, tmp_path):
    done = accepted(device, device.folder)
    assert done.exit_code == 0, done.output
    assert "not signed" not in done.output
    shutil.copytree(device.folder, tmp_path / "sent")
    (tmp_path / "sent" / "readme.txt").write_text("added")
    (tmp_path / "sent" / "junit.xml").unlink()
    done = accepted(device, tmp_path / "sent")
    assert done.exit_code == 0, done.output
    assert "but not signed: readme.txt. Nothing is proved" in " ".join(done.output.split())
    assert ": junit.xml. They were not compared" in " ".join(done.output.split())


def test_the_default_policy_of_a_described_device_reads_the_description_beside_the_certificate(device, tmp_path):
    done = device.verify()
    assert "REFUSED by your policy: efforts\n" in done.output, "the run was quick"
    alone = tmp_path / device.envelope.name
    shutil.copy(device.envelope, alone)
    done = roaas("verify", alone, "--key", device.keys / PUBLIC_NAME)
    assert (done.exit_code, "give the folder of the description too" in done.output) == (1, True), done.output


def test_a_file_added_to_the_description_is_refused(device, tmp_path):
    shutil.copytree(device.folder, tmp_path / "sent")
    (tmp_path / "sent" / "description" / "overlay.yaml").write_text("added")
    done = accepted(device, tmp_path / "sent")
    assert (done.exit_code, "REFUSED  description/overlay.yaml" in done.output) == (1, True), done.output


def test_neither_sign_nor_verify_runs_code_of_a_description(device, tmp_path):
    sent = tmp_path / "sent"
    shutil.copytree(device.folder, sent)
    evil = f"from pathlib import Path\nPath({str(tmp_path / 'ran')!r}).write_text('')\n"
    for name in ("evil.py", "conftest.py", "rules/http/test_evil.py"):
        (sent / "description" / name).parent.mkdir(parents=True, exist_ok=True)
        (sent / "description" / name).write_text(evil)
    manifest = sent / "description" / "pack.toml"
    manifest.write_text('plugin = "evil.py"\n' + manifest.read_text())
    policy = ("--policy", device.keys.parent / "policy.toml", "--contract", sent / "description")
    assert device.verify("--result", sent, *policy).exit_code == 1
    assert roaas("sign", sent, "--key", device.keys / PRIVATE_NAME).exit_code == 2
    assert not (tmp_path / "ran").exists()


def replaced_description(folder):
    path = folder / "description" / "openapi.json"
    path.write_text(path.read_text().replace("integer", "number"))


def linked_description(folder):
    path = folder / "description" / "openapi.json"
    path.rename(folder / "elsewhere.json")
    path.symlink_to(folder / "elsewhere.json")


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (replaced_description, "not judged by these files: description/openapi.json"),
        (linked_description, "regular file"),
    ],
)
def test_a_result_beside_another_description_is_not_signed(device, tmp_path, edit, said):
    shutil.copytree(device.folder, tmp_path / "sent")
    edit(tmp_path / "sent")
    done = roaas("sign", tmp_path / "sent", "--key", device.keys / PRIVATE_NAME)
    assert (done.exit_code, said in done.output) == (2, True), done.output

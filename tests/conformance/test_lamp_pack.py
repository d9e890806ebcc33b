"""The small pack in examples: every command works with it unchanged."""

import json
import re
import shutil
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import CliRunner

from conformance.contract.freeze import freeze
from reports.attestation.keys import PRIVATE_NAME, PUBLIC_NAME
from roaas import main

LAMP = Path(__file__).parents[2] / "examples" / "lamp"
_BROKEN = ("LAMP.fade(float(brightness))", "LAMP.fade(float(brightness) / 2)")


@contextmanager
def lamp(folder: Path, fault: tuple[str, str] | None = None):
    """Start a lamp, good or with a line that is wrong; give its address."""
    source = (LAMP / "lamp.py").read_text(encoding="utf-8")
    program = folder / "lamp.py"
    program.write_text(source.replace(*fault) if fault else source, encoding="utf-8")
    (folder / "openapi.yaml").write_bytes((LAMP / "openapi.yaml").read_bytes())
    process = subprocess.Popen([sys.executable, str(program), "0"], stdout=subprocess.PIPE, text=True)
    try:
        yield re.search(r"rest=(\S+)", process.stdout.readline())[1]
    finally:
        process.terminate()
        process.wait()
        process.stdout.close()


def roaas(*words: str | Path):
    done = CliRunner().invoke(main, [str(word) for word in words])
    assert done.exception is None or isinstance(done.exception, SystemExit), done.output
    return done


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """The results of a good lamp and of one that fades to the wrong brightness."""
    folder = tmp_path_factory.mktemp("lamps")
    keys = folder / "keys"
    roaas("keygen", keys)
    pack = shutil.copytree(LAMP, folder / "pack")
    freeze("1.0", pack)
    done = {}
    for name, fault in (("good", None), ("broken", _BROKEN)):
        out = folder / name
        out.mkdir()
        with lamp(out, fault) as url:
            options = ["--contract", pack, "--rest", url, "--allow-motion", "--effort", "quick", "--out", out]
            done[name] = roaas("certify", *options, "--sign", keys / PRIVATE_NAME)
            if fault:
                done["replay"] = roaas("replay", out, "lamp/target", "--allow-motion", "--contract", pack)
    return folder, done


def _document(folder: Path):
    return json.loads((folder / "result.json").read_text(encoding="utf-8"))


def test_a_good_lamp_conforms_and_the_result_names_the_pack(results):
    folder, done = results
    assert done["good"].exit_code == 0, done["good"].output
    document = _document(folder / "good")
    assert document["verdict"] == "conformant"
    assert document["pack"] == {"name": "lamp", "version": "1.0", "title": "Lamp contract"}
    assert document["classes"] == {"lamp": "pass", "http": "pass"}


def test_a_broken_lamp_fails_where_it_is_wrong_and_the_finding_can_be_replayed(results):
    folder, done = results
    assert done["broken"].exit_code == 1
    failed = {item["id"] for item in _document(folder / "broken")["requirements"] if item["verdict"] == "fail"}
    assert {"lamp/target", "lamp/fades"} <= failed <= {"lamp/target", "lamp/fades", "lamp/out-of-range"}
    assert done["replay"].exit_code == 1, done["replay"].output
    assert "still there" in done["replay"].output


def test_pages_and_ci_formats_are_written(results):
    folder, _ = results
    there = {path.name for path in (folder / "broken").iterdir()}
    assert {"certificate.html", "certificate.md", "junit.xml"} <= there
    assert "Lamp contract" in (folder / "good" / "certificate.html").read_text(encoding="utf-8")


def test_a_signed_certificate_is_verified_and_registered(results):
    folder, _ = results
    key = folder / "keys" / PUBLIC_NAME
    policy = folder / "policy.toml"
    policy.write_text('efforts = ["quick"]\nrequirement_sets = ["1.0"]\n', encoding="utf-8")
    options = ["--policy", policy, "--contract", folder / "pack"]
    envelope = folder / "good" / "certificate.intoto.json"
    done = roaas("verify", envelope, "--key", key, "--result", folder / "good", *options)
    assert done.exit_code == 0, done.output
    keys = folder / "trusted"
    keys.mkdir()
    (keys / PUBLIC_NAME).write_bytes(key.read_bytes())
    site = roaas("registry", "build", envelope, "--keys", keys, "--out", folder / "site", *options)
    assert (site.exit_code, (folder / "site" / "index.html").exists()) == (0, True), site.output


def test_recorded_traces_are_judged_again_without_the_device(results):
    folder, _ = results
    for name, code in (("good", 0), ("broken", 1)):
        done = roaas("judge", folder / name, "lamp/fades", "--contract", LAMP)
        assert (done.exit_code, "lamp/fades" in done.output) == (code, True), done.output


def test_two_results_are_compared(results):
    folder, _ = results
    done = roaas("diff", folder / "good", folder / "broken")
    assert (done.exit_code, "lamp/target" in done.output) == (1, True), done.output


def test_the_plan_sends_nothing(closed_port):
    done = roaas("certify", "--contract", LAMP, "--rest", closed_port, "--plan")
    assert done.exit_code == 0
    assert (
        "scenario fading: Set the lamp from 0 to the target and read its state every 20 ms while it fades."
        in done.output
    )


def test_a_fleet_is_judged_by_the_pack(tmp_path):
    fleet = tmp_path / "fleet.toml"
    with lamp(tmp_path) as url:
        fleet.write_text(f'[[robot]]\nname = "desk"\nendpoints = {{ rest = "{url}" }}\n', encoding="utf-8")
        out = tmp_path / "out"
        done = roaas(
            "certify", "--fleet", fleet, "--contract", LAMP, "--allow-motion", "--effort", "quick", "--out", out
        )
    assert done.exit_code == 0, done.output
    assert json.loads((out / "fleet.json").read_text(encoding="utf-8"))["class_titles"]["lamp"].startswith("The lamp")


def test_each_of_its_own_mutants_is_killed(tmp_path):
    command = ["selftest", "--contract", LAMP, "--faults", "lamp-*", "--seeds", "1", "--no-variants", "--no-compare"]
    done = roaas(*command, "--parallel", "1", "--out", tmp_path / "selftest")
    assert (done.exit_code, "mutants killed (100.0 %)" in done.output) == (0, True), done.output

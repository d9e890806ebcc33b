"""The wheel: the same sources, the same bits; no import name but `roaas…`; it works beside modules of any name."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from processes import ended

from conformance.commandline.extras import EXTRAS
from conformance.contract.pack import Contract
from conformance.engine.suite import suite_digest
from proof.selftest.robots import running
from proof.table1.selftest import PLAIN

ROOT = Path(__file__).parents[2]
ROOMS = ("conformance", "reference_robot", "loadtests", "reports", "ros_probe", "proof")
SOURCES = ("pyproject.toml", "README.md", "LICENSE", "roaas.py", "roaas_pytest.py", "ci", *ROOMS)


def sources(folder, mode):
    """Copy what a wheel is built from, as another clone would have it: other times, other permissions."""
    for name in SOURCES:
        path = ROOT / name
        if path.is_dir():
            shutil.copytree(
                path, folder / name, ignore=shutil.ignore_patterns("__pycache__"), copy_function=shutil.copy
            )
        else:
            shutil.copy(path, folder)
    for path in folder.rglob("*"):
        if path.is_file():
            path.chmod(mode | (path.stat().st_mode & 0o100))


def built(folder, mode):
    (folder / "src").mkdir()
    sources(folder / "src", mode)
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", folder, folder / "src"]
    done = ended(*command)
    assert done.returncode == 0, done.stdout + done.stderr
    return {path.name: path for path in folder.iterdir() if path.is_file()}


@pytest.fixture(scope="module")
def twice(tmp_path_factory):
    return built(tmp_path_factory.mktemp("one"), 0o644), built(tmp_path_factory.mktemp("two"), 0o600)


@pytest.fixture(scope="module")
def installed(twice, tmp_path_factory):
    """The folder that the wheel is installed to; beside it, what it needs is that of this environment."""
    wheel = next(path for name, path in twice[0].items() if name.endswith(".whl"))
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target", folder, wheel]
    subprocess.run(command, check=True, timeout=240, capture_output=True)
    return folder


@pytest.fixture
def elsewhere(tmp_path):
    """A working directory whose modules have the rooms' names."""
    for room in ROOMS:
        (tmp_path / room).mkdir()
        (tmp_path / room / "__init__.py").write_text(f"raise SystemExit('the wrong {room}')\n", encoding="utf-8")
    return tmp_path


def run(installed, folder, *words):
    """Run Python with the installed suite before this environment, and somebody else's modules before that."""
    path = os.pathsep.join(map(str, [folder, installed]))
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST")}
    environment |= {"PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
    return ended(sys.executable, *map(str, words), cwd=folder, env=environment)


def test_the_same_sources_give_the_same_bits(twice):
    one, two = ({name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in each.items()} for each in twice)
    assert one == two
    assert {name.rpartition(".")[2] for name in one} == {"whl", "gz"}


def test_its_import_names_are_nobody_elses(twice):
    wheel = next(path for name, path in twice[0].items() if name.endswith(".whl"))
    names = {name.partition("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    assert {name for name in names if ".d" not in name} == {"roaas.py", "roaas_pytest.py", "roaas_rooms"}
    rooms = {name.split("/")[1] for name in zipfile.ZipFile(wheel).namelist() if name.startswith("roaas_rooms/")}
    assert rooms == set(ROOMS)


def test_it_certifies_among_modules_of_the_rooms_names(installed, elsewhere):
    # What only the extras bring: a REST interface is judged without it.
    for module in {module for modules in EXTRAS.values() for module in modules}:
        (elsewhere / f"{module}.py").write_text(f"raise SystemExit('{module} is imported')\n", encoding="utf-8")
    with running(Contract.load(), PLAIN) as robot:
        words = ["--rest", robot.rest, "--class", "rest-formats", "--effort", "quick", "--allow-motion", "--quiet"]
        done = run(installed, elsewhere, "-m", "roaas", "certify", *words, "--json", "--out", elsewhere / "out")
    assert (done.returncode, done.stderr) == (0, "")
    result = json.loads(done.stdout)
    assert result == json.loads((elsewhere / "out" / "result.json").read_text(encoding="utf-8"))
    assert result["command"].endswith("--json --out out")
    assert not [path for path in (elsewhere / "out").glob("*.*") if str(elsewhere).encode() in path.read_bytes()]
    assert result["verdict"] == "conformant"
    # A wheel and a checkout are one suite: who verifies needs not know which of them ran.
    assert result["suite"]["digest"] == suite_digest(Contract.load())
    assert (elsewhere / "out" / "certificate.html").exists()


def test_processes_that_it_starts_find_the_rooms_as_well(installed, elsewhere):
    script = (
        "import roaas, subprocess, sys; roaas.open_rooms(); import conformance, loadtests; print(conformance.__file__);"
        "sys.exit(subprocess.call([sys.executable, '-P', '-m', 'loadtests.node', '--worker']))"
    )
    done = run(installed, elsewhere, "-c", script)
    assert done.stdout.strip() == str(installed / "roaas_rooms" / "conformance" / "__init__.py")
    assert done.stderr.strip() == "--worker needs --master-host"


def test_a_pytest_run_has_the_checks_where_it_asks_for_them_and_nothing_else(installed, tmp_path):
    (tmp_path / "conformance.py").write_text("own = True\n", encoding="utf-8")
    (tmp_path / "test_own.py").write_text(
        "import conformance\ndef test_own(): assert conformance.own\n", encoding="utf-8"
    )
    pytest_ = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "--config-file=/dev/null", f"--rootdir={tmp_path}"]
    done = run(installed, tmp_path, *pytest_, "test_own.py")
    assert done.returncode == 0, done.stdout
    assert "--robot-rest" not in run(installed, tmp_path, *pytest_, "--help").stdout
    checks = ["--pyargs", "conformance.rules.describe", "--collect-only"]
    named = run(installed, tmp_path, *pytest_, "-p", "roaas_pytest", *checks)
    assert "tests collected" in named.stdout
    assert "name a robot: --robot-rest" in named.stderr

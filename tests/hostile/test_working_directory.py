"""A working directory that is full of modules with the names of ours, of our dependencies and of Python's own."""

import itertools
import sys
from pathlib import Path

import pytest
from processes import ended
from small_device import constant, described, reading, small_device

# A module of each of these names in the working directory runs code of somebody else when it is imported.
NAMES = (
    "attrs", "certifi", "click", "conformance", "conftest", "gevent", "h11", "hypothesis", "jinja2", "json",
    "loadtests", "locust", "lxml", "msgspec", "multiprocessing", "numpy", "pytest", "rclpy", "reference_robot",
    "reports", "ros_probe", "runpy", "select", "sitecustomize", "socket", "ssl", "subprocess", "test_all", "yaml",
)  # fmt: skip
ROAAS = Path(sys.executable).with_name("roaas")
# In this order: the later ones read what the earlier ones wrote.
COMMANDS = (
    "certify {url}/openapi.json --effort quick --out first", "certify --fleet fleet.toml --effort quick --out fleet",
    "load {url}/openapi.json --operation GET./a --rate 20 --warmup 0 --duration 1 --processes 1 --out load",
    "judge first", "report first", "diff first first", "compare load load", "keygen keys",
    "sign first --key keys/signing-key.pem", "verify first/certificate.intoto.json --key keys/public-key.pem",
    "registry build first --keys keys --out site",
)  # fmt: skip


@pytest.fixture(scope="module", name="place")
def _place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hostile")
    marker = folder.parent / "executed"
    for name in NAMES:
        code = f"open({str(marker)!r}, 'a').write({name!r} + chr(10))\nraise SystemExit(77)\n"
        (folder / f"{name}.py").write_text(code)
        package = folder / "rules" / name
        package.mkdir(parents=True)
        (package / "__init__.py").write_text(code)
    routes = {"/a": constant({"n": 1})}
    with small_device(described({"/a": reading({"type": "object"})}), routes) as url:
        (folder / "robot.toml").write_text(f'[robot]\nname = "a"\n[endpoints]\nrest = "{url}"\n')
        (folder / "fleet.toml").write_text('[[robot]]\nstatement = "robot.toml"\n')
        yield folder, url, marker


@pytest.mark.parametrize("command", COMMANDS)
def test_no_command_imports_a_module_of_the_working_directory(place, command):
    folder, url, marker = place
    arguments = [word.replace("GET.", "GET ") for word in command.format(url=url).split()]
    done = ended(ROAAS, *arguments, cwd=folder)
    assert not marker.exists(), marker.read_text()
    # A second of load is too short to compare.
    assert done.returncode in {0, 1, 4 if "compare" in command else 0}, done.stdout + done.stderr


def test_neither_does_the_command_as_a_module(place):
    folder, _, marker = place
    done = ended(sys.executable, "-m", "roaas", "explain", "http/date", cwd=folder, fresh=True)
    assert (done.returncode, marker.exists()) == (0, False), done.stderr


def test_no_conftest_above_the_checks_is_run(place, tmp_path):
    """pytest runs each conftest.py in the folders above; those above a pack are nobody's whom the user named."""
    _, url, marker = place
    pack = tmp_path / "above" / "pack"
    (pack / "rules").mkdir(parents=True)
    code = f"open({str(marker)!r}, 'a').close()\n"
    (tmp_path / "above" / "conftest.py").write_text(code)
    (pack / "openapi.json").write_text('{"openapi": "3.0.3", "info": {"title": "a", "version": "1"}, "paths": {}}')
    (pack / "rules" / "conftest.py").write_text("import pytest\n\n@pytest.fixture\ndef two():\n    return 2\n")
    (pack / "rules" / "test_two.py").write_text(
        'import pytest\n\n@pytest.mark.requirement("http/date")\ndef test_two(two, judge):\n    print("two is", two)\n'
    )
    done = ended(ROAAS, "certify", "--contract", pack, "--rest", url, "--effort", "quick", "--out", tmp_path / "out")
    assert not marker.exists()
    assert "two is 2" in done.stdout + done.stderr, done.stdout + done.stderr


def test_every_python_that_the_product_starts_ignores_the_working_directory():
    """`-m` searches the working directory first, unless `-P` or `-I` stands before it; a script does not."""
    root, started = Path(__file__).parents[2], 0
    for room in ("conformance", "loadtests", "reference_robot", "reports", "ros_probe", "proof"):
        for file in sorted((root / room).rglob("*.py")):
            words = file.read_text(encoding="utf-8").split("sys.executable,")
            for before, after in itertools.pairwise(words):
                started += 1
                isolated = after.lstrip().startswith(('"-P"', '"-I"', "str(Path"))
                assert isolated, f"{file}:{before.count(chr(10)) + 1}"
    assert started > 5

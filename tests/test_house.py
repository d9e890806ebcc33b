"""The house is as CONTRIBUTING draws it: floors, no circles, every folder says what it is, no overlong module.

The floors themselves stand in pyproject.toml for import-linter, which reads imports for type checking as well. Here
is what it does not see: circles between modules, modules that are named in strings, and the drawing.
"""

import ast
import collections
import itertools
import re
import sys
import tomllib
from pathlib import Path

import grimp
import pytest
from processes import ended

ROOT = Path(__file__).parents[1]
ROOMS = ("conformance", "reference_robot", "loadtests", "reports", "ros_probe", "proof")
MOST_LINES = 600
_MODULE_NAME = re.compile(rf"(?:{'|'.join(ROOMS)})(?:\.\w+)+")
_IMPORT = re.compile(rf"(?:^|[;\n]) *(?:from|import) ({_MODULE_NAME.pattern})")


def _modules() -> list[Path]:
    return [
        path
        for room in ROOMS
        for path in sorted((ROOT / room).rglob("*.py"))
        if "interfaces" not in path.relative_to(ROOT).parts
    ]


def _name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@pytest.fixture(scope="module")
def imports():
    return grimp.build_graph(*ROOMS, cache_dir=None)


def test_no_contract_has_an_exception():
    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    loose = {"ignore_imports", "allow_indirect_imports", "unmatched_ignore_imports_alerting"}
    assert [contract["name"] for contract in config["contracts"] if loose & contract.keys()] == []


def test_every_room_of_the_suite_is_told_to_know_no_pack():
    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    (contract,) = (one for one in config["contracts"] if one["name"].startswith("Nothing generic knows"))
    rooms = {f"conformance.{path.parent.name}" for path in (ROOT / "conformance").glob("*/__init__.py")}
    assert rooms == {*contract["source_modules"], *contract["forbidden_modules"]}


def test_the_floors_hold():
    lint = "from importlinter.cli import lint_imports_command; lint_imports_command()"
    command = [sys.executable, "-c", lint, "--no-cache"]
    done = ended(*command, cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr


def test_there_is_no_circle_of_modules(imports):
    assert _circles({name: imports.find_modules_directly_imported_by(name) for name in imports.modules}) == []


def _circles(graph):
    """Modules that cannot be put in an order: what is left when all that import nothing left are taken away."""
    left = dict(graph)
    while done := {name for name, imported in left.items() if not imported & left.keys()}:
        left = {name: imported for name, imported in left.items() if name not in done}
    while done := left.keys() - set().union(*left.values()):
        left = {name: imported for name, imported in left.items() if name not in done}
    return sorted(left)


def test_a_circle_would_be_seen():
    assert _circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": set(), "e": {"a"}}) == ["b", "c"]


def test_modules_that_are_named_in_strings_exist_and_may_be_imported_there():
    """A string is an import, unless it names the program of a process of its own (`-m`)."""
    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    names = {_name(path) for path in _modules()}
    for path in _modules():
        for named, starts in _named_in_strings(ast.parse(path.read_text(encoding="utf-8"))):
            assert named in names, f"{_name(path)} names {named!r}, which is not there"
            assert starts or not _forbidden(config["contracts"], _name(path), named), f"{_name(path)} names {named!r}"


@pytest.mark.parametrize(
    ("module", "text", "wrong"),
    [
        ("loadtests.cli", "import_module('conformance.cli.certify')", True),
        ("loadtests.cli", "[python, '-m', 'conformance.cli.certify']", False),
        ("loadtests.clients.wire", "import_module(name='loadtests.engine.run')", True),
        ("conformance.engine.replay", "__import__('conformance.packs.table1.plugin')", True),
        ("conformance.api.device", "exec('from conformance.engine.replay import replay')", True),
        ("conformance.api.device", "[python, '-c', 'import loadtests.cli; loadtests.cli.load()']", True),
        ("reports.reading", "import_module('conformance.verdict.verdicts')", True),
        ("conformance.cli.contract", "import_module('proof.selftest.coverage')", True),
        ("conformance.engine.replay", "import_module('conformance.api.device')", False),
    ],
)
def test_a_string_that_imports_upward_would_be_seen(module, text, wrong):
    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    ((named, starts), *_) = _named_in_strings(ast.parse(text))
    assert (not starts and _forbidden(config["contracts"], module, named)) == wrong


def _named_in_strings(tree):
    """Yield each module of the house that a string names or imports, and whether the string is a program's name."""
    programs = {
        id(after)
        for words in ast.walk(tree)
        if isinstance(words, ast.List | ast.Tuple)
        for before, after in itertools.pairwise(words.elts)
        if isinstance(before, ast.Constant) and before.value == "-m"
    }
    prose = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}  # docstrings
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in prose:
            imported = _IMPORT.findall(node.value)
            whole = [node.value] if _MODULE_NAME.fullmatch(node.value) else []
            yield from ((named, id(node) in programs) for named in whole + imported)


def _forbidden(contracts, module, named):
    """Return whether an import-linter contract forbids a module to import another one."""

    def within(name, packages):
        return any(f"{name}.".startswith(f"{package.removesuffix('.*')}.") for package in packages)

    floors, rooms = _floors(), (module.partition(".")[0], named.partition(".")[0])
    if rooms[0] == rooms[1] and _floor(floors, named) > _floor(floors, module):
        return True
    return any(
        within(module, contract.get("source_modules", ())) and within(named, contract["forbidden_modules"])
        if contract["type"] == "forbidden"
        else contract["type"] == "independence" and rooms[0] != rooms[1] and set(rooms) <= set(contract["modules"])
        for contract in contracts
    )


def _floors():
    """Each package of a layers contract with its height."""
    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    floors = {}
    for contract in config["contracts"]:
        for container in contract.get("containers", ()):
            for height, layer in enumerate(reversed(contract["layers"])):
                floors |= {f"{container}.{name.strip()}": height for name in re.split(r"[:|]", layer)}
    return floors


def _floor(floors, module):
    return max((height for name, height in floors.items() if f"{module}.".startswith(f"{name}.")), default=0)


def test_every_folder_says_what_it_is():
    silent = [
        str(folder.relative_to(ROOT))
        for folder in {path.parent for path in _modules()}
        if not (folder / "__init__.py").is_file()
        or not ast.get_docstring(ast.parse((folder / "__init__.py").read_text(encoding="utf-8")))
    ]
    assert silent == []


def test_no_two_helpers_of_tests_share_a_name():
    """All folders of tests are on one path, so that the second of a name is never found."""
    own = {"conftest.py", "__init__.py"}
    named = [path.name for path in (ROOT / "tests").rglob("*.py") if path.name not in own]
    assert sorted(name for name, times in collections.Counter(named).items() if times > 1) == []


def test_no_module_is_overlong_without_a_reason():
    for path in _modules():
        text = path.read_text(encoding="utf-8")
        if len(text.splitlines()) > MOST_LINES:
            assert f"Over {MOST_LINES} lines" in (ast.get_docstring(ast.parse(text)) or ""), path


def test_the_drawing_in_contributing_is_the_real_tree():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    drawing = re.search(r"```text\n(conformance/.*?)```", text, re.DOTALL)
    assert drawing, "CONTRIBUTING.md has no drawing of the tree"
    drawn, room = set(), ""
    for line in drawing[1].splitlines():
        found = re.match(r"( *)((?:\w+/ +)*\w+/)", line)
        if found is None:
            continue
        folders = found[2].split()
        if not found[1]:
            room = folders[0]
        if len(found[1]) <= len("  "):  # what is deeper is drawn for readers
            drawn |= set(folders) if not found[1] else {room + folder for folder in folders}
    real = {
        f"{folder.relative_to(ROOT)}/"
        for room in (*ROOMS, "tests")
        for folder in (ROOT / room, *(ROOT / room).iterdir())
        # A folder that has moved leaves its compiled modules behind.
        if any(path.is_file() and "__pycache__" not in path.parts for path in folder.rglob("*"))
    }
    assert {name for name in drawn if name.startswith((*ROOMS, "tests"))} == real


@pytest.mark.parametrize("command", ["certify", "load", "report", "compare", "contract", "selftest"])
def test_the_suite_and_the_load_tests_start_without_ros(command):
    blocked = "import sys; sys.modules['rclpy'] = None; import roaas; "
    call = f"roaas.main(['{command}', '--help'], standalone_mode=False)"
    done = ended(sys.executable, "-c", blocked + call)
    assert done.returncode == 0, done.stderr


def _weights():
    """Lines and modules of Python by room; of the suite's rooms, by the folder inside."""
    weights = {}
    for top in (*ROOMS, "benchmarks", "tests"):
        for path in (ROOT / top).rglob("*.py"):
            parts = path.relative_to(ROOT).parts
            room = "/".join(parts[:2]) if top == "conformance" and len(parts) > len(("conformance", "x.py")) else top
            lines, modules = weights.get(room, (0, 0))
            weights[room] = lines + len(path.read_text(encoding="utf-8").splitlines()), modules + 1
    return weights


def test_no_room_grows_past_its_figure():
    allowed = tomllib.loads((Path(__file__).parent / "house.toml").read_text(encoding="utf-8"))["rooms"]
    weights = _weights()
    assert weights.keys() == allowed.keys()
    grown = {
        room: {"is": weight, "may have": tuple(allowed[room])}
        for room, weight in weights.items()
        if any(there > most for there, most in zip(weight, allowed[room], strict=True))
    }
    assert grown == {}, "delete something, or raise the figure in tests/house.toml with its reason"


# Participles that say nothing of what a function does; those that are left are copies of an argument, as sorted().
BARE = re.compile(
    r"_*(?:[a-z]+ed|begun|chosen|done|drawn|driven|found|given|gone|heard|held|kept|known|left|lost|made|met|said|seen"
    r"|sent|shown|taken|told|written)"
)


def test_no_more_functions_are_named_by_a_bare_participle():
    named = collections.Counter(
        node.name
        for room in ROOMS
        for path in (ROOT / room).rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and BARE.fullmatch(node.name)
    )
    assert named.total() <= 105, named

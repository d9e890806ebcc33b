"""The rooms stand on each other as the architecture says, and the suite needs no ROS."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

_ROOT = Path(__file__).parents[1]
_ROOMS = ("conformance", "reference_robot", "loadtests", "reports")
_ALLOWED = {
    "conformance": {"conformance"},
    "reference_robot": {"reference_robot", "conformance.contract"},
    "loadtests": {"loadtests", "conformance.contract"},
    "reports": {"reports"},
}


def _imports(path: Path) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names |= {node.module}
    return names


def _modules(folder: str) -> list[Path]:
    return [path for path in (_ROOT / folder).rglob("*.py") if "interfaces" not in path.parts]


@pytest.mark.parametrize("room", _ROOMS)
def test_a_room_imports_only_what_it_stands_on(room):
    modules = _modules(room)
    assert modules
    for path in modules:
        for name in _imports(path):
            if name.split(".")[0] in {*_ROOMS, "roaas"}:
                assert any(name == allowed or name.startswith(allowed + ".") for allowed in _ALLOWED[room]), (
                    path,
                    name,
                )


def test_the_ground_floor_imports_nothing_of_ours():
    for path in _modules("conformance/contract"):
        ours = {name for name in _imports(path) if name.split(".")[0] in {*_ROOMS, "roaas"}}
        assert all(name.startswith("conformance.contract") for name in ours), (path, ours)


def test_the_suite_and_the_load_tests_start_without_ros():
    blocked = (
        "import sys; sys.modules['rclpy'] = None; import roaas; roaas.main(['{}', '--help'], standalone_mode=False)"
    )
    for command in ("certify", "load", "report", "compare", "contract", "selftest"):
        done = subprocess.run(
            [sys.executable, "-c", blocked.format(command)], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr


def test_ros_is_named_only_where_it_is_needed():
    for room in ("conformance", "loadtests", "reports"):
        for path in _modules(room):
            if "probe" in path.parts:
                continue
            assert not {name for name in _imports(path) if name.split(".")[0] == "rclpy"}, path

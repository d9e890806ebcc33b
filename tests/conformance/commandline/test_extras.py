"""A command that lacks an extra says which, and what the base needs is in the base."""

import sys
from importlib.metadata import packages_distributions, requires

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from processes import ended

from conformance.commandline.extras import EXTRAS, lacking, missing_extra

OPTIONAL = sorted({module for modules in EXTRAS.values() for module in modules})


def brought_by(extra):
    """Distributions that an extra of roaas adds to its base, those of extras that it includes as well."""
    found = set()
    for line in requires("roaas"):
        need = Requirement(line)
        if need.marker is None or not need.marker.evaluate({"extra": extra}) or need.marker.evaluate({"extra": ""}):
            continue
        found |= {canonicalize_name(need.name)} if need.name != "roaas" else set()
        for inner in need.extras if need.name == "roaas" else ():
            found |= brought_by(inner)
    return found


@pytest.mark.parametrize("extra", EXTRAS)
def test_the_modules_are_those_of_the_extra(extra):
    owners = packages_distributions()
    assert {canonicalize_name(owners[module][0]) for module in EXTRAS[extra]} == brought_by(extra)


def test_all_is_everything_but_ros_and_the_tools_of_developers():
    assert brought_by("all") == brought_by("soap") | brought_by("load") | brought_by("robot")


def test_a_missing_module_is_named_with_the_command_that_installs_it(monkeypatch):
    assert lacking("load", "'roaas load'") is None
    monkeypatch.setitem(sys.modules, "scipy", None)
    assert lacking("load", "'roaas load'") == missing_extra("scipy.stats", "'roaas load'")
    assert missing_extra("scipy", "'roaas load'") == (
        "'roaas load' needs the Python module 'scipy', which is not installed: pip install 'roaas[load]'"
    )
    assert missing_extra("zeep", "it").endswith("pip install 'roaas[soap]'")
    assert missing_extra("nobodys_module", "it") is None
    assert missing_extra(None, "it") is None


@pytest.mark.parametrize(
    ("words", "module", "extra"),
    [
        (["load", "--rest", "http://127.0.0.1:1"], "locust", "load"),
        (["compare", "old.json", "new.json"], "numpy", "load"),
        (["certify", "--publishers-wsdl", "http://127.0.0.1:1/x?wsdl"], "zeep", "soap"),
        (["selftest", "--target", "plain"], "zeep", "soap"),
        (["certify", "--wsdl", "http://127.0.0.1:1/x?wsdl"], "zeep", "soap"),
    ],
)
def test_a_command_without_its_extra_says_so_in_one_line(tmp_path, words, module, extra):
    script = f"import sys; sys.modules.update(dict.fromkeys({OPTIONAL!r})); import roaas; roaas.main({words!r})"
    done = ended(sys.executable, "-c", script, cwd=tmp_path)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    last = done.stderr.strip().splitlines()[-1]
    assert f"needs the Python module {module!r}" in last
    assert last.endswith(f"pip install 'roaas[{extra}]'")
    assert done.stdout == ""

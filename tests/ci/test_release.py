"""What a release needs: licences that go with ours, one version, the same Pythons everywhere, pinned actions."""

import re
import tomllib
from importlib.metadata import distribution, metadata, requires
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from processes import ended

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
WORKFLOWS = {path.stem: yaml.safe_load(path.read_text("utf-8")) for path in (ROOT / ".github/workflows").glob("*.yml")}
_FREE = re.compile(
    r"(MIT|BSD|Apache|PSF|Python Software Foundation|MPL|Mozilla|ISC|0BSD|ZPL|Zlib|CC0|Unlicense)", re.IGNORECASE
)


def installed_with(name, extras, found):
    """Add the distributions that one needs with its extras, at any depth."""
    for need in map(Requirement, requires(name) or ()):
        key = (canonicalize_name(need.name), frozenset(need.extras))
        used = need.marker is None or any(need.marker.evaluate({"extra": extra}) for extra in ("", *extras))
        if used and key not in found:
            found.add(key)
            installed_with(need.name, need.extras, found)
    return found


def licence(name):
    """The licence of a distribution: its expression, else its classifiers, else the first line of its text."""
    known = metadata(name)
    classified = [one for one in known.get_all("Classifier") or () if one.startswith("License ::")]
    return known["License-Expression"] or "; ".join(classified) or (known["License"] or "").partition("\n")[0]


def test_the_licences_of_what_is_installed_go_with_ours():
    names = {name for name, _ in installed_with("roaas", ["all"], set())} - {"roaas"}
    assert len(names) > 60
    assert not {name: licence(name) for name in names if not _FREE.search(licence(name))}
    assert not [name for name in names if re.search(r"\bA?GPL", licence(name))]


def test_the_base_needs_neither_numbers_nor_pictures_nor_soap():
    base = {name for name, _ in installed_with("roaas", [], set())}
    assert base.isdisjoint({"numpy", "matplotlib", "scipy", "locust", "gevent", "zeep", "xmlschema", "hdrhistogram"})
    assert len(base) < 50
    assert "ros-rclpy" not in {name for name, _ in installed_with("roaas", ["all"], set())}


def test_the_version_is_one():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == PROJECT["version"] == distribution("roaas").version
    assert f"\n## {PROJECT['version']} " in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_pythons_are_the_same_everywhere():
    tested = WORKFLOWS["tests"]["jobs"]["pythons"]["strategy"]["matrix"]["python"]
    declared = [one.rpartition(" ")[2] for one in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", one)]
    assert tested == declared
    assert PROJECT["requires-python"] == f">={tested[0]}"
    span = f"{tested[0]} to {tested[-1]}"
    for page in ("README.md", "docs/releases.md", "Makefile"):
        assert span in (ROOT / page).read_text(encoding="utf-8"), page


@pytest.mark.parametrize("name", WORKFLOWS)
def test_a_workflow_pins_what_others_wrote_and_gives_each_job_its_rights(name):
    workflow = WORKFLOWS[name]
    assert workflow["permissions"] == {}
    for job in workflow["jobs"].values():
        assert "permissions" in job
        used = [step["uses"] for step in job.get("steps", ()) if "uses" in step]
        assert all(re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40}", one) for one in used)


def test_only_the_job_that_publishes_has_an_identity():
    jobs = WORKFLOWS["release"]["jobs"]
    assert [name for name, job in jobs.items() if "id-token" in job["permissions"]] == ["publish"]
    assert jobs["publish"]["environment"] == "pypi"
    assert not [step for step in jobs["publish"]["steps"] if "run" in step]
    assert "secrets." not in (ROOT / ".github/workflows/release.yml").read_text(encoding="utf-8")


def test_the_demo_needs_no_tools_of_developers():
    done = ended("make", "--dry-run", "--always-make", "demo", cwd=ROOT)
    assert done.returncode == 0, done.stderr
    assert "'.[load,robot,ros]'" in done.stdout
    assert ",dev]" not in done.stdout

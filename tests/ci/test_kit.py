"""The action's and the template's own scripts against robots that are good, broken, absent, hanging: red but for good.

The services themselves are not here. What they would do with the two files is done by hand: inputs go into the
environment, then the script to bash.
"""

import json
import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import yaml
from processes import ended
from warm_commands import beginning

from conformance.contract.pack import Contract
from proof.selftest.proxy import Proxy
from proof.selftest.robots import running
from proof.table1.mutants import MUTANTS
from proof.table1.selftest import REFERENCE
from reports.attestation.envelope import ENVELOPE_NAME
from reports.formats.catalogue import FORMATS

CI = Path(__file__).parents[2] / "ci"
ACTION = yaml.safe_load((CI / "github" / "action.yml").read_text(encoding="utf-8"))
TEMPLATE = yaml.safe_load((CI / "gitlab" / "roaas.yml").read_text(encoding="utf-8"))
FILES = {"result.json", "certificate.html", *(one.file for one in FORMATS.values())}


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    """A folder with the two programs that an installed suite has: of the code at hand."""
    folder = tmp_path_factory.mktemp("runner") / "roaas" / "bin"
    folder.mkdir(parents=True)
    # A robot goes on until it is ended, and gets a Python of its own.
    own, warm = (f'{shlex.join(words)} -m roaas "$@"' for words in ((sys.executable,), beginning()))
    text = f'#!/bin/sh\n[ "$1" = robot ] && exec {own}\nexec {warm}\n'
    (folder / "roaas").write_text(text, encoding="utf-8")
    (folder / "roaas-ci").symlink_to(CI / "certify.sh")
    (folder / "roaas").chmod(0o755)
    return folder


@pytest.fixture(scope="module")
def good(session_domain_id):
    with running(Contract.load(), REFERENCE, session_domain_id) as robot:
        yield robot


@pytest.fixture
def broken(good):
    proxy = Proxy(good.rest, good.publishers)
    proxy.change = next(one for one in MUTANTS if one.catches == ("rest-formats/xml",)).make()
    yield proxy.rest
    proxy.close()


@pytest.fixture
def hanging():
    """Take connections and say nothing."""
    with socket.create_server(("127.0.0.1", 0), backlog=64) as server:
        yield f"http://127.0.0.1:{server.getsockname()[1]}"


@pytest.fixture
def absent():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    return f"http://127.0.0.1:{port}"


def bash(script, environment, folder):
    command = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script]
    return ended(*command, env=environment, cwd=folder)


def test_the_script_says_which_variables_it_reads(programs, tmp_path):
    environment = {"PATH": os.environ["PATH"]}
    told = ended("bash", programs / "roaas-ci", "--help", env=environment, cwd=tmp_path)
    assert (told.returncode, "  ROAAS_URL  " in told.stdout, "#" in told.stdout) == (0, True, False), told.stdout
    for arguments, said in (((), "set ROAAS_URL"), (("robot.toml",), "takes no arguments, such as 'robot.toml'")):
        refused = ended("bash", programs / "roaas-ci", *arguments, env=environment, cwd=tmp_path)
        assert (refused.returncode, said in refused.stderr) == (2, True), refused.stderr


def on_github(programs, folder, **inputs):
    """Run the step `certify` as a runner would: the inputs go into its environment, and its script to bash."""
    step = next(one for one in ACTION["runs"]["steps"] if one.get("id") == "certify")
    given = {name: str(one["default"]) for name, one in ACTION["inputs"].items()} | inputs
    environment = {
        name: re.sub(r"\${{ inputs\.([\w-]+) }}", lambda found: given[found[1]], value)
        for name, value in step["env"].items()
    }
    assert "${{" not in str(environment)
    around = {
        "GITHUB_ACTIONS": "true",
        "GITHUB_ACTION_PATH": str(CI / "github"),
        "GITHUB_OUTPUT": str(folder / "output"),
        "GITHUB_STEP_SUMMARY": str(folder / "summary"),
        "RUNNER_TEMP": str(programs.parents[1]),
    }
    return bash(step["run"], {**os.environ, **around, **environment}, folder)


def on_gitlab(programs, folder, **variables):
    environment = {**os.environ, **TEMPLATE["variables"], **variables, "PATH": f"{programs}:{os.environ['PATH']}"}
    return bash("\n".join(TEMPLATE["roaas"]["script"]), environment, folder)


def names(folder):
    """Return the files of a run, without what it recorded: which scenarios were played depends on the claims."""
    return {path.name for path in folder.iterdir()} - {"traces.json.gz", "history.jsonl.gz"}


CLASS = {"classes": "rest-formats", "effort": "quick"}


def test_a_good_robot_is_green_and_a_broken_one_red(programs, good, broken, tmp_path):
    (tmp_path / "robot.toml").write_text('[claims]\nclasses = ["rest-formats"]\n', encoding="utf-8")
    (tmp_path / "token").write_text("leave me", encoding="utf-8")
    given = {"statement": "robot.toml", "effort": "quick", "allow-motion": "true", "token": "s3cret"}
    done = on_github(programs, tmp_path, rest=good.rest, **given)
    assert done.returncode == 0, done.stdout + done.stderr
    out = tmp_path / "roaas-results"
    assert names(out) == FILES
    assert json.loads((out / "badge.json").read_text(encoding="utf-8"))["color"] == "brightgreen"
    assert "Conformant" in (tmp_path / "summary").read_text(encoding="utf-8")
    assert "::error" not in done.stdout
    assert not any(b"s3cret" in path.read_bytes() for path in out.iterdir())

    done = on_github(programs, tmp_path, rest=broken, **given)
    assert done.returncode == 1
    assert names(out) == FILES
    # What a robot says comes between the two lines that keep GitHub from taking it for a command.
    stop, guard = re.search(r"^::stop-commands::(\w{32})$", done.stdout, re.MULTILINE), "::{}::"
    judged, annotated = done.stdout.split(guard.format(stop[1]))
    assert "not conformant to rest-formats only" in judged
    assert re.search(r"^::error file=robot\.toml,line=2,title=rest-formats/xml", annotated, re.MULTILINE)
    assert (tmp_path / "output").read_text(encoding="utf-8") == "exit-code=0\nexit-code=1\n"
    assert "Not conformant" in (tmp_path / "summary").read_text(encoding="utf-8")


def test_a_device_is_judged_by_its_description_without_a_statement(programs, good, tmp_path):
    url = f"{good.rest}/openapi.json"
    called = "PUT /robot/velocity/\nDELETE /robot/navigation/action/goal/"
    given = {"url": url, "call": called, "classes": "description", "effort": "quick", "allow-motion": "true"}
    done = on_github(programs, tmp_path, **given)
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads((tmp_path / "roaas-results" / "result.json").read_text(encoding="utf-8"))
    for pattern in called.splitlines():
        assert pattern in str(result["command"])


def test_a_robot_that_is_absent_or_hangs_or_could_not_be_judged_is_red(programs, good, absent, hanging, tmp_path):
    folders = {name: tmp_path / name for name in ("absent", "hanging", "unjudged")}
    for folder in folders.values():
        folder.mkdir()
    with ThreadPoolExecutor() as pool:
        runs = {
            "absent": pool.submit(
                on_gitlab, programs, folders["absent"], ROAAS_REST=absent, ROAAS_CLASSES="rest-formats"
            ),
            "hanging": pool.submit(on_github, programs, folders["hanging"], rest=hanging, timeout="0.3", **CLASS),
            "unjudged": pool.submit(on_github, programs, folders["unjudged"], rest=good.rest, **CLASS),
        }
    done = {name: run.result() for name, run in runs.items()}
    assert {name: one.returncode for name, one in done.items()} == {"absent": 3, "hanging": 3, "unjudged": 4}
    for name, folder in folders.items():
        assert names(folder / "roaas-results") == FILES
        assert ("::error " in done[name].stdout) == (name != "absent")
    for name in ("hanging", "unjudged"):
        assert "Inconclusive" in (folders[name] / "summary").read_text(encoding="utf-8")
    # What GitLab's job promises is there.
    assert "::" not in done["absent"].stdout
    artifacts = TEMPLATE["roaas"]["artifacts"]
    for promised in (*artifacts["paths"], *artifacts["reports"].values()):
        assert (folders["absent"] / promised.replace("$ROAAS_OUT", TEMPLATE["variables"]["ROAAS_OUT"])).exists()
    assert artifacts["when"] == "always"


def _bare_image(folder):
    """Return the environment of an image without the suite, whose ``pip`` makes the command that it is to install."""
    for name in ("bash", "sh", "cp"):
        (folder / name).symlink_to(shutil.which(name))
    # It stands for `python -m pip install`, and keeps what it is told to install.
    texts = {"python": f'echo "$@" > installed\ncp {folder}/wheel {folder}/roaas-ci\n', "wheel": "echo > ran\n"}
    for name, text in texts.items():
        (folder / name).write_text(f"#!/bin/sh\n{text}", encoding="utf-8")
        (folder / name).chmod(0o755)
    return {**TEMPLATE["variables"], "PATH": str(folder)}


@pytest.mark.parametrize(
    "suite",
    ["", "./roaas-0.1.0-py3-none-any.whl[soap]", "roaas[soap] @ git+https://gitlab.example/GROUP/roaas.git@v0.1.0"],
)
def test_gitlabs_job_installs_what_is_named_and_says_what_to_name(suite, tmp_path):
    image, project = tmp_path / "bin", tmp_path / "project"
    image.mkdir()
    project.mkdir()
    environment = {**_bare_image(image), **({"ROAAS_SUITE": suite} if suite else {})}
    done = bash("\n".join(TEMPLATE["roaas"]["script"]), environment, project)
    if not suite:
        assert (done.returncode, "set ROAAS_SUITE to a wheel" in done.stderr) == (2, True), done.stderr
        assert not (image / "roaas-ci").exists(), "nothing is installed from a registry that has no release"
        return
    assert (done.returncode, (project / "ran").exists()) == (0, True), done.stderr
    assert (project / "installed").read_text(encoding="utf-8") == f"-m pip install --quiet {suite}\n"


def test_wrong_usage_is_red_and_no_old_result_is_taken_for_new(programs, absent, tmp_path):
    out = tmp_path / "roaas-results"
    out.mkdir()
    for name in {*FILES, ENVELOPE_NAME}:
        (out / name).write_text("of an earlier run", encoding="utf-8")
    assert on_github(programs, tmp_path, rest=absent, statement="$(touch injected).toml").returncode == 2
    assert list(out.iterdir()) == []
    assert not (tmp_path / "injected").exists()
    assert "exit code 2" in (tmp_path / "summary").read_text(encoding="utf-8")
    assert on_github(programs, tmp_path, rest=absent, **{"allow-motion": "yes"}).returncode == 2


def text_of(image):
    return (CI.parent / "deploy" / "container" / f"Containerfile.{image}").read_text(encoding="utf-8")


def test_the_images_commands_do_what_they_are_for(programs, domain_id):
    said = {}
    for name in ("suite", "robot"):
        found = re.findall(r"^(?:ENTRYPOINT|CMD) (\[.*\])$", text_of(name), re.MULTILINE)
        said[name] = [word for words in found for word in json.loads(words)]
    environment = {**os.environ, "PATH": f"{programs}:{os.environ['PATH']}", "ROS_DOMAIN_ID": str(domain_id)}
    assert bash(" ".join(said["suite"]), environment, programs).returncode == 0
    command = [*said["robot"], "--rest-port=0", "--soap-port=0"]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as robot:
        try:
            ready = re.match(r"ready rest=http://0\.0\.0\.0:(\d+) ", robot.stdout.readline())
            (check,) = re.findall(r"^ +(\[\"python\".*\])$", text_of("robot"), re.MULTILINE)
            _, *words = json.loads(check.replace("7003", ready[1]))
            assert subprocess.run([sys.executable, *words], timeout=60, check=False).returncode == 0
        finally:
            robot.terminate()


def test_inputs_reach_scripts_by_the_environment_alone():
    scripts = [step["run"] for step in ACTION["runs"]["steps"] if "run" in step]
    assert len(scripts) >= 2
    assert not any("${{" in script for script in scripts)
    assert "$[[" not in str(TEMPLATE)


def test_what_others_wrote_is_pinned():
    used = [step["uses"] for step in ACTION["runs"]["steps"] if "uses" in step]
    assert all(re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40}", one) for one in used)


@pytest.mark.parametrize(
    "command",
    [
        ["check-jsonschema", "--builtin-schema", "vendor.github-actions", "github/action.yml"],
        ["check-jsonschema", "--builtin-schema", "vendor.gitlab-ci", "gitlab/roaas.yml"],
        ["check-jsonschema", "--builtin-schema", "vendor.github-workflows", "../.github/workflows/release.yml"],
        ["check-jsonschema", "--builtin-schema", "vendor.github-workflows", "../.github/workflows/tests.yml"],
        ["check-jsonschema", "--builtin-schema", "vendor.citation-file-format", "../CITATION.cff"],
        ["zizmor", "--offline", "--no-progress", "github/action.yml", "../.github/workflows"],
        ["shellcheck", "certify.sh", "release.sh", "wheel.sh"],
        [
            "hadolint",
            *(str(one) for name in ("Containerfile.*", "Dockerfile") for one in CI.parent.glob(f"deploy/*/{name}")),
        ],
    ],
    ids=lambda command: f"{command[0]} {command[-1]}",
)
def test_the_files_pass_the_fields_linters(command):
    program = Path(sys.executable).with_name(command[0])
    done = ended(program, *command[1:], cwd=CI)
    assert done.returncode == 0, done.stdout + done.stderr

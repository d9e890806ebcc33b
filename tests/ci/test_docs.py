"""Every command and every CI file in README.md and docs/ is one that there is; the quick ones are run, on one robot."""

import re
import shlex
import shutil
import sys
from itertools import dropwhile, groupby
from pathlib import Path

import click
import pytest
import yaml
from processes import ended

from conformance.contract.pack import Contract
from proof.selftest.robots import running
from proof.table1.selftest import PLAIN
from roaas import main

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
ACTION = yaml.safe_load((ROOT / "ci" / "github" / "action.yml").read_text(encoding="utf-8"))


def fences(language):
    """Each fence of a language, with the name of its page."""
    for page in PAGES:
        for text in re.findall(
            rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
        ):
            yield page.name, text


def commands():
    """Each command of the pages as words, with the name of its page; variables that are set before it left out."""
    for page, text in fences("sh"):
        for line in re.sub(r"\\\n", " ", text).splitlines():
            lexer = shlex.shlex(line, posix=True, punctuation_chars="();|&")
            lexer.whitespace_split = True
            # Of a pipeline, a list and a subshell: each command.
            for operator, words in groupby(lexer, key=lambda word: set(word) <= set("();|&")):
                named = list(dropwhile(re.compile(r"[A-Z_]+=").match, words))
                if named and not operator:
                    yield page, named


COMMANDS = list(commands())
# Of others: what is here of them is looked at, and they are run by hand.
OTHERS = {
    ".", "curl", "docker", "eval", "gh", "make", "openssl", "pip", "python", "ros2", "sudo", "umask", "uvx", "zcat",
}  # fmt: skip
OTHERS |= {"roaas", "roaas-ci", "roaas-load-node", "st", "zcat", "grep"}


def test_there_are_commands_and_no_program_that_nobody_looked_at():
    assert {words[0] for _, words in COMMANDS} <= OTHERS
    assert len(COMMANDS) > 20


@pytest.mark.parametrize(
    ("page", "words"), COMMANDS, ids=lambda value: value if isinstance(value, str) else " ".join(value)[:60]
)
def test_a_command_is_one_that_there_is(page, words, monkeypatch):
    del page
    if words[0] == "roaas":
        # The files are the reader's own.
        monkeypatch.setattr(click.Path, "convert", lambda _self, value, _parameter, _context: Path(value))
        command, name, arguments = main, "roaas", words[1:]
        while isinstance(command, click.Group):
            name, *arguments = arguments
            command = command.get_command(click.Context(main), name)
            assert command is not None, name
        command.make_context(name, arguments)
    elif words[0] == "make":
        assert re.search(rf"^{words[1]}:", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    elif words[:2] == ["python", "-m"]:
        assert (ROOT / Path(*words[2].split(".")).with_suffix(".py")).is_file()
    elif words[0] == "python":
        compile((ROOT / words[1]).read_text(encoding="utf-8"), words[1], "exec")
    elif words[:2] == ["docker", "build"]:
        assert (ROOT / words[words.index("-f") + 1]).is_file()


def documented(start):
    """The command of the pages that is this one, or the last that begins so."""
    begin_so = [words for _, words in COMMANDS if shlex.join(words).startswith(start)]
    return next((words for words in begin_so if shlex.join(words) == start), begin_so[-1])


def test_a_newcomers_way_through_the_pages(tmp_path):
    """What the pages say of certifying, signing and showing, word for word but for the robot's address."""
    with running(Contract.load(), PLAIN) as robot:

        def run(start, folder=tmp_path):
            rest = robot.rest.removeprefix("http://")
            words = [word.replace("robot:7003", rest) for word in documented(start)[1:]]
            return ended(sys.executable, "-m", "roaas", *words, cwd=folder)

        assert run("roaas certify --init robot.toml --rest http://robot:7003").returncode == 0
        statement = tmp_path / "robot.toml"
        text = re.sub(
            r"^\[claims\].*?(?=^\[)", "", statement.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL
        )
        statement.write_text(f'{text}\n[claims]\nclasses = ["rest-formats"]\n', encoding="utf-8")
        assert run("roaas keygen").returncode == 0
        judged = run("roaas certify robot.toml --allow-motion --requirements 1.2 --sign")
        assert judged.returncode == 0, judged.stdout + judged.stderr
    out = tmp_path / "out"
    shutil.copy(tmp_path / "keys" / "public-key.pem", out)
    verified = run("roaas verify certificate.intoto.json --key public-key.pem --result .", out)
    assert verified.returncode == 1  # signed by that key, and one class is less than the policy asks for
    assert "class" in verified.stdout + verified.stderr
    shutil.copytree(out, tmp_path / "roaas-results")
    assert run("roaas report roaas-results").returncode == 0
    assert {"roaas.sarif", "ctrf-report.json"} <= {path.name for path in (tmp_path / "roaas-results").iterdir()}


@pytest.mark.parametrize(
    "text",
    [text for page, text in fences("yaml") if page == "ci.md"],
    ids=["a GitHub workflow", "code scanning", "the GitLab template", "a GitLab job"],
)
def test_a_file_for_a_ci_service_is_valid(text, tmp_path):
    document = yaml.safe_load(text)
    kind = "github-workflows" if "jobs" in document else "gitlab-ci"
    (tmp_path / "file.yml").write_text(text, encoding="utf-8")
    linter = Path(sys.executable).with_name("check-jsonschema")
    command = [linter, "--builtin-schema", f"vendor.{kind}", tmp_path / "file.yml"]
    done = ended(*command)
    assert done.returncode == 0, done.stdout
    for job in document.get("jobs", {}).values():
        ours = next(step for step in job["steps"] if "/ci/github@" in step.get("uses", ""))
        assert set(ours["with"]) <= set(ACTION["inputs"])
    for included in document.get("include", []):
        assert (ROOT / included["file"]).is_file()
        template = yaml.safe_load((ROOT / included["file"]).read_text(encoding="utf-8"))
        known = (ROOT / "ci" / "certify.sh").read_text(encoding="utf-8")
        assert all(name in known or name in template["variables"] for name in document["variables"])

"""Toy robots in processes of their own, and `roaas load` as people start it."""

import json
import os
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import jsonschema
import pytest
from click.testing import CliRunner
from processes import LOAD, ended, free_port

from conformance.commandline.exit_codes import ExitCode
from conformance.papers_robot.statement import CONTRACT_DIR
from loadtests.cli import load as load_cli
from reports.latency.page import latency_markdown
from reports.pages.untrusted import plain

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in `roaas load`: its threads spin on a busy machine

HERE = Path(__file__).parent
SCHEMA = json.loads((HERE.parents[1] / "reports" / "schemas" / "roaas-latency-1.schema.json").read_text())


@dataclass
class Toy:
    process: subprocess.Popen
    port: int
    host: str = "127.0.0.1"
    scheme: str = "http"
    prefix: str = ""

    @property
    def url(self):
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}://{host}:{self.port}{self.prefix}"

    def both(self):
        """Options that name both interfaces."""
        services = (
            f"--{name}-wsdl {CONTRACT_DIR / name}.wsdl --{name}-endpoint {self.url}/{name}"
            for name in ("publishers", "subscribers")
        )
        return f"--rest {self.url} {' '.join(services)}".split()


@pytest.fixture
def started():
    """Start a program of this folder that prints `ready PORT`; gives both. All end with the test."""
    running = []

    def start(script, *options, on=()):
        command = [*on, sys.executable, HERE / script, *options]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        running.append(process)
        word, port = process.stdout.readline().split()
        assert word == "ready"
        return process, int(port)

    yield start
    for process in running:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.fixture
def toy(started):
    """Start a toy robot with options, and words before its command."""

    def start(*options, host="127.0.0.1", on=()):
        words = [str(option) for option in options]
        process, port = started("toy_robot.py", "--host", host, *words, on=on)
        prefix = words[words.index("--prefix") + 1] if "--prefix" in words else ""
        return Toy(process, port, host, "https" if "--tls" in words else "http", prefix)

    return start


@dataclass
class Loaded:
    code: int
    out: str
    err: str
    folder: Path

    @property
    def result(self):
        """The result file; whatever became of the run it keeps to its schema, and all reports say its headline."""
        file = self.folder / "latency.json"
        assert file.is_file(), f"exit code {self.code} without a result: {self.out + self.err}"
        result = json.loads(file.read_text())
        jsonschema.Draft202012Validator(SCHEMA).validate(result)
        short, (words, sentence) = latency_markdown(result), (result["headline"][key] for key in ("words", "sentence"))
        # What a heading says is not said again below it, and what is left begins with a capital letter.
        assert plain(words, 1500) in short
        assert plain(sentence.removeprefix(words).lstrip(".: ")[1:], 1500) in short
        assert not self.out or self.out.rstrip().endswith(sentence)
        assert not re.search(r"\b(None|nan)\b", short + self.out)
        return result

    def series(self, operation, interface):
        """A series of the wire client."""
        return next(
            entry
            for entry in self.result["series"]
            if (entry["operation"], entry["interface"], entry["client"]) == (operation, interface, "wire")
        )


@pytest.fixture(scope="session")
def load_command():
    """The words that begin `roaas load` in a process of its own."""
    return LOAD


@pytest.fixture
def load(tmp_path):
    """Run `roaas load`; `begin` gives the process and a function that waits for it. A string may hold several words, as
    in a shell.

    `on` are words before the command.
    """

    folder = tmp_path / "out"

    def words(options):
        return [word for option in options for word in (shlex.split(option) if isinstance(option, str) else [option])]

    def run(*options):
        done = ended(*LOAD, *words(options), "--out", folder)
        return Loaded(done.returncode, done.stdout, done.stderr, folder)

    def begin(*options, on=()):
        command = [*on, *LOAD, *words(options), "--out", folder]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

        def finish():
            out, err = process.communicate(timeout=240)
            return Loaded(process.returncode, out, err, folder)

        return process, finish

    run.begin = begin
    return run


@pytest.fixture(scope="session")
def usage_error():
    """Run `roaas load` in this process, up to an error before its first request; returns the error."""

    def run(*options):
        words = [word for option in options for word in shlex.split(str(option))]
        done = CliRunner().invoke(load_cli, words)
        assert done.exit_code == ExitCode.USAGE, done.output
        return " ".join(done.output.split())

    return run


@pytest.fixture
def wait_for():
    """Wait for a line on a process' standard error."""

    def wait(process, pattern):
        found = next((found for line in process.stderr if (found := re.search(pattern, line))), None)
        assert found, f"no {pattern!r} on stderr"
        return found

    return wait


@pytest.fixture(name="free_port")
def free_port_fixture():
    """A TCP port that nothing listens on."""
    return free_port()


@pytest.fixture(scope="session")
def certificate(tmp_path_factory):
    """A certificate for localhost that signs itself: (certificate, key)."""
    folder = tmp_path_factory.mktemp("tls")
    cert, key = folder / "cert.pem", folder / "key.pem"
    command = (
        "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=localhost "
        "-addext subjectAltName=DNS:localhost,IP:127.0.0.1"
    )
    subprocess.run([*command.split(), "-keyout", key, "-out", cert], check=True, capture_output=True)
    return cert, key

"""Toy robots in processes of their own, and `roaas load` as people start it."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as in `roaas load`: its threads spin on a busy machine

HERE = Path(__file__).parent
CONTRACT = HERE.parents[1] / "conformance" / "contract"


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
        return [
            "--rest",
            self.url,
            "--publishers-wsdl",
            str(CONTRACT / "publishers.wsdl"),
            "--publishers-endpoint",
            f"{self.url}/publishers",
            "--subscribers-wsdl",
            str(CONTRACT / "subscribers.wsdl"),
            "--subscribers-endpoint",
            f"{self.url}/subscribers",
        ]


@pytest.fixture
def toy():
    """Start a toy robot with options; all end with the test."""
    started = []

    def start(*options, host="127.0.0.1"):
        words = [str(option) for option in options]
        process = subprocess.Popen(
            [sys.executable, HERE / "toy_robot.py", "--host", host, *words], stdout=subprocess.PIPE, text=True
        )
        started.append(process)
        word, port = process.stdout.readline().split()
        assert word == "ready"
        prefix = words[words.index("--prefix") + 1] if "--prefix" in words else ""
        return Toy(process, int(port), host, "https" if "--tls" in words else "http", prefix)

    yield start
    for process in started:
        process.kill()
        process.wait()


@dataclass
class Loaded:
    code: int
    out: str
    err: str
    folder: Path

    @property
    def result(self):
        return json.loads((self.folder / "latency.json").read_text())

    def series(self, operation, interface, client="wire"):
        wanted = (operation, interface, client)
        return next(
            entry
            for entry in self.result["series"]
            if (entry["operation"], entry["interface"], entry["client"]) == wanted
        )


COMMAND = [sys.executable, "-c", "from loadtests.cli import load; load(prog_name='roaas load')"]


@pytest.fixture
def load(tmp_path):
    """Run `roaas load`; `begin` gives the process and a function that waits for it."""

    def run(*options):
        return run.begin(*options)[1]()

    def begin(*options):
        folder = tmp_path / "out"
        words = [*COMMAND, *(str(option) for option in options), "--out", str(folder)]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

        def finish():
            out, err = process.communicate(timeout=90)
            return Loaded(process.returncode, out, err, folder)

        return process, finish

    run.begin = begin
    return run


@pytest.fixture(scope="session")
def certificate(tmp_path_factory):
    """A certificate for localhost that signs itself: (certificate, key)."""
    folder = tmp_path_factory.mktemp("tls")
    cert, key = folder / "cert.pem", folder / "key.pem"
    subprocess.run(
        [
            "openssl",
            "req",
            "-x509",
            "-newkey",
            "ec",
            "-pkeyopt",
            "ec_paramgen_curve:P-256",
            "-nodes",
            "-days",
            "2",
            "-subj",
            "/CN=localhost",
            "-addext",
            "subjectAltName=DNS:localhost,IP:127.0.0.1",
            "-keyout",
            key,
            "-out",
            cert,
        ],
        check=True,
        capture_output=True,
    )
    return cert, key

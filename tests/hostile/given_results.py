"""A real result with findings, signed, and the example of a load test: what somebody changes before it is sent."""

import copy
import json
import shutil
import signal
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

from click.testing import CliRunner, Result
from small_device import certified, constant, described, reading, small_device

from reports.attestation.keys import PRIVATE_NAME, PUBLIC_NAME, generate
from roaas import main

EXAMPLES = Path(__file__).parents[1] / "reports" / "data"
# What a command may take for one file, s: many times what it takes on a busy machine, and far from for ever.
BOUND_S = 100


@dataclass(frozen=True)
class Given:
    """A folder with results that are well made.

    Attributes:
        folder: holds result/ (a certification with findings), load/, fleet/, and keys/.
        device: address of the device, which is no longer there.
    """

    folder: Path
    device: str

    def document(self, name: str) -> Any:
        """Return a new copy of the JSON in a file of the folder."""
        return copy.deepcopy(json.loads((self.folder / name).read_text(encoding="utf-8")))

    def sent(self, folder: Path) -> Path:
        """Return a copy of the folder, for somebody to change."""
        shutil.copytree(self.folder, folder, dirs_exist_ok=True)
        return folder


def make(folder: Path) -> Given:
    """Certify a device whose body and status are wrong, load test it, and make keys."""
    description = described({"/state": reading({"type": "object", "properties": {"on": {"type": "boolean"}}})})
    with small_device(description, {"/state": constant({"on": 1})}) as url:
        done = certified(url, folder / "result")
    assert "description/body-schema" in done.blamed, done.text
    for name, example in (("load/latency.json", "latency-example.json"), ("fleet/fleet.json", "fleet-example.json")):
        (folder / name).parent.mkdir()
        (folder / name).write_bytes((EXAMPLES / example).read_bytes())
    latency = json.loads((folder / "load" / "latency.json").read_text(encoding="utf-8"))
    latency["series"] = latency["series"][:2]
    (folder / "load" / "latency.json").write_text(json.dumps(latency), encoding="utf-8")
    generate(folder / "keys")
    return Given(folder, url)


@contextmanager
def _bound() -> Iterator[None]:
    def late(_: int, __: FrameType | None) -> None:
        raise AssertionError(f"it takes more than {BOUND_S} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(BOUND_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def run(command: str, folder: Path) -> Result:
    """Run a command in this process, within the bound; {} in it is the folder."""
    key, public = folder / "keys" / PRIVATE_NAME, folder / "keys" / PUBLIC_NAME
    words = [word.format(folder, key=key, public=public) for word in command.split()]
    with _bound():
        return CliRunner().invoke(main, words)


def check(done: Result, *codes: int) -> None:
    """Check that a command ended with one of these exit codes, as a command does, and printed nothing that acts."""
    assert done.exception is None or isinstance(done.exception, SystemExit), repr(done.exception)
    assert done.exit_code in codes, (done.exit_code, done.output[-2000:])
    assert "Traceback" not in done.output, done.output[-2000:]
    assert "the suite itself failed" not in done.output, done.output[-2000:]
    for line in done.output.splitlines():
        assert not line.lstrip().startswith("::"), line
        assert "##[" not in line.replace("\\##[", "").replace("#\\#[", ""), line
        assert "##vso[" not in line.replace("#\\#vso[", ""), line
        acting = {one for one in line if unicodedata.category(one) in {"Cc", "Cf", "Cs", "Zl", "Zp"}}
        assert not acting, (acting, line)

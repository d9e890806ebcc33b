"""Commands that tests run to their end."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


def ended(*command: object, check: bool = False, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run a command to its end; return what it wrote, as text."""
    given = {"capture_output": True, "text": True, "timeout": 240} | options
    return subprocess.run([str(word) for word in command], check=check, **given)


@contextmanager
def independent_robot(name: str) -> Iterator[tuple[subprocess.Popen[str], str, str]]:
    """Start an independent robot of the pack table1; yield its process, its REST address and its publishers' WSDL."""
    command = [sys.executable, "-m", "conformance.packs.table1.independent_robots", name]
    command += ["--rest-port=0", "--soap-port=0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            words = process.stdout.readline().split()
            assert words[0] == "ready"
            yield process, *(word.split("=", 1)[1] for word in words[1:3])
        finally:
            process.kill()

"""Run the commands of RoAAS in processes that have imported their modules before.

These imports take two thirds of a short certification's processor time. A server does them once, and forks twice for
each command. The second process runs the command; the first waits for it. The command gets the arguments, the working
directory, the environment and the streams of its client, and the client ends with its exit code.
"""

import gc
import json
import os
import runpy
import secrets
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

_IMPORTED = (
    "anyio", "click", "cryptography.hazmat.primitives.asymmetric.ed25519", "h11", "h2.connection",
    "httpcore", "httpx", "hypothesis", "jinja2", "jsonschema", "jsonschema_rs", "jsonpath", "lxml.etree", "msgspec",
    "pdb", "pytest", "readline", "regress", "schemathesis", "schemathesis.graphql",
    "schemathesis.specs.openapi.schemas", "securesystemslib", "segno", "yaml",
)  # fmt: skip
# The guard is a program that reads its stdin.
_NOT_IMPORTED = "conformance.api.rest.guard_process"
_CLIENT = """
import array, json, os, socket, sys
words = json.dumps([sys.argv[2:], os.getcwd(), dict(os.environ)]).encode()
with socket.socket(socket.AF_UNIX) as server:
    server.connect("\\0" + sys.argv[1])
    fds = array.array("i", [0, 1, 2])
    server.sendmsg([b"%20d" % len(words)], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, fds)])
    server.sendall(words)
    code = int(server.makefile().read())
if code < 0:
    os.kill(os.getpid(), -code)
sys.exit(code)
"""


@cache
def beginning() -> tuple[str, ...]:
    """Return the words that stand for `python` before `-m roaas` or `-c ...`; start the server for them."""
    if sys.platform != "linux":
        return (sys.executable,)
    name = f"roaas-tests-{os.getpid()}-{secrets.token_hex(8)}"
    # The server ends when this process does, which holds the other end of its stdin.
    server = subprocess.Popen(
        (sys.executable, __file__, name),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
    )
    _SERVERS.append(server)
    assert server.stdout is not None
    assert server.stdout.readline() == b"ready\n"
    return (sys.executable, "-I", "-S", "-c", _CLIENT, name)


_SERVERS: list[subprocess.Popen[bytes]] = []


def _serve(name: str) -> None:
    """Serve clients until the process that started this one has closed its stdin."""
    del sys.path[0]  # the folder of this file
    for package in _IMPORTED:
        with suppress(ModuleNotFoundError):  # of an extra that is not installed
            import_module(package)
    for plugin in import_module("_pytest.config").default_plugins:
        import_module(f"_pytest.{plugin}")
    for room in map(import_module, ("conformance", "reports")):
        for module in walk_packages(room.__path__, f"{room.__name__}."):
            if not module.name.startswith(_NOT_IMPORTED):
                import_module(module.name)
    import_module("loadtests.described.run")  # what `roaas load` needs before it starts the process that measures
    assert len(list(Path("/proc/self/task").iterdir())) == 1  # a process with threads must not fork
    gc.collect()
    gc.freeze()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind("\0" + name)
        listener.listen(64)
        print("ready", flush=True)  # noqa: T201 - its starter waits for that
        while select.select([listener, sys.stdin], [], [])[0] == [listener]:
            connection, _ = listener.accept()
            with connection:
                if os.fork() == 0:
                    listener.close()
                    _attend(connection)


def _attend(connection: socket.socket) -> None:
    """Run the command of a client in a process of its own; send its exit code, or kill it when the client is gone."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    head, streams, _, _ = socket.recv_fds(connection, 20, 3)
    with connection.makefile("rb") as stream:
        words, folder, environment = json.loads(stream.read(int(head)))
    command = os.fork()
    if command == 0:
        connection.close()
        _run(words, folder, environment, streams)
    for stream in (0, 1, 2, *streams):
        os.close(stream)
    threading.Thread(target=_kill_without, args=(connection, command), daemon=True).start()
    _, status = os.waitpid(command, 0)
    with suppress(OSError):
        connection.sendall(str(os.waitstatus_to_exitcode(status)).encode())
    os._exit(0)


def _kill_without(connection: socket.socket, command: int) -> None:
    """Kill a command when its client has ended. A client that still waits ends after the process that calls this."""
    connection.recv(1)
    os.kill(command, signal.SIGKILL)


def _run(words: list[str], folder: str, environment: dict[str, str], streams: list[int]) -> None:
    """Do in this process what `python` with these words does in a new one, and end it."""
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    os.environ.clear()
    os.environ.update(environment)
    tempfile.tempdir = None  # found anew, by the command's environment
    os.chdir(folder)
    sys.path.insert(0, folder)
    sys.argv[1:] = words[2:]
    if words[0] == "-m":
        runpy.run_module(words[1], run_name="__main__", alter_sys=True)
    else:
        exec(words[1], {})  # noqa: S102 -- the text that a test gives `python -c`
    sys.exit()


if __name__ == "__main__":
    _serve(sys.argv[1])

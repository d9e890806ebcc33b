"""Run the commands of RoAAS in processes that have imported their modules before.

These imports take two thirds of a short certification's processor time, and reading the suite's own files a tenth. A
server does both once, and forks twice for each command. The second process runs the command; the first waits for it.
The command gets the arguments, the working directory, the environment and the streams of its client, and the client
ends with its exit code. Its peak memory is at least that of all modules.
"""

import _socket
import gc
import json
import os
import runpy
import secrets
import signal
import socket
import subprocess
import sys
import tempfile
from contextlib import suppress
from functools import cache
from importlib import import_module
from os import close, fork
from pathlib import Path
from pkgutil import walk_packages
from select import select
from signal import signal as set_signal
from threading import Lock

from conformance.commandline.endings import PARENT_VARIABLE

#: The environment variable with the name of the server for the process of `roaas load` that measures.
MEASURING = "ROAAS_TESTS_MEASURING"
#: The environment variable with the file to which the client writes the command's peak memory, in MB.
PEAK = "ROAAS_TESTS_PEAK"
#: The environment variable with the file descriptor to which the client writes the process id of the command.
PID = "ROAAS_TESTS_PID"

_IMPORTED = (
    "anyio", "click", "cryptography.hazmat.primitives.asymmetric.ed25519", "h11", "h2.connection",
    "httpcore", "httpx", "hypothesis", "jinja2", "jsonschema", "jsonschema_rs", "jsonpath", "lxml.etree", "msgspec",
    "pdb", "pytest", "readline", "regress", "schemathesis", "schemathesis.graphql",
    "schemathesis.specs.openapi.schemas", "securesystemslib", "segno", "yaml",
)  # fmt: skip
# Functions that read the suite's own files and keep what these hold, with their argument.
_READ = (
    ("conformance.contract.generic", "generic_ledger", ()),
    ("conformance.explaining.advice", "topic_of", ("no requirement",)),  # looks at the pattern of each topic
    ("conformance.engine.result", "_known_servers", ()),
    *(("conformance.documents.description_faults", "validator", (version,)) for version in ("3.0", "3.1")),
)
# The guard is a program that reads its stdin.
_NOT_IMPORTED = "conformance.api.rest.guard_process"
_CLIENT = """
import array, json, os, socket, sys
peak, told = (os.environ.pop(f"ROAAS_TESTS_{name}", None) for name in ("PEAK", "PID"))
words = json.dumps([sys.argv[2:], os.getcwd(), dict(os.environ)]).encode()
with socket.socket(socket.AF_UNIX) as server:
    server.connect("\\0" + sys.argv[1])
    fds = array.array("i", [0, 1, 2])
    server.sendmsg([b"%20d" % len(words)], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, fds)])
    server.sendall(words)
    answer = server.makefile()
    pid = answer.readline()
    if told:
        os.write(int(told), pid.encode())
    code, peak_kb = map(int, answer.read().split())
if peak:
    open(peak, "w").write(str(peak_kb >> 10))
if code < 0:
    os.kill(os.getpid(), -code)
sys.exit(code)
"""


def beginning(kind: str = "commands") -> tuple[str, ...]:
    """Return the words that stand for `python` before `-m roaas` or `-c ...`; start the server for them.

    Args:
        kind: "commands", or "measuring" for the process of `roaas load` that measures, which imports Locust.
    """
    if sys.platform != "linux":
        return (sys.executable,)
    with _STARTING:
        return _started(kind)


@cache
def _started(kind: str) -> tuple[str, ...]:
    name = f"roaas-tests-{os.getpid()}-{secrets.token_hex(8)}"
    # The server ends when this process does, which holds the other end of its stdin.
    server = subprocess.Popen(
        (sys.executable, __file__, name, kind),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
    )
    _SERVERS.append(server)
    assert server.stdout is not None
    assert server.stdout.readline() == b"ready\n"
    return (sys.executable, "-I", "-S", "-c", _CLIENT, name)


# Tests that go on side by side share one server.
_STARTING = Lock()
_SERVERS: list[subprocess.Popen[bytes]] = []


def _import_commands() -> None:
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
    for module, name, given in _READ:
        getattr(import_module(module), name)(*given)


def _serve(name: str, kind: str) -> None:
    """Serve clients until the process that started this one has closed its stdin.

    Sockets, forks and signals are those of Python itself, because Locust replaces them when it is imported.
    """
    del sys.path[0]  # the folder of this file
    if kind == "measuring":
        import_module("loadtests.engine.run")
    else:
        _import_commands()
    assert len(list(Path("/proc/self/task").iterdir())) == 1  # a process with threads must not fork
    gc.collect()
    gc.freeze()
    set_signal(signal.SIGCHLD, signal.SIG_IGN)
    listener = _socket.socket(_socket.AF_UNIX)
    listener.bind("\0" + name)
    listener.listen(64)
    print("ready", flush=True)  # noqa: T201 - its starter waits for that
    while select([listener, sys.stdin], [], [])[0] == [listener]:
        descriptor, _ = listener._accept()  # noqa: SLF001 - what accept() is made of, without a socket of gevent
        if fork() == 0:
            listener.close()
            _attend(_socket.socket(fileno=descriptor))
        close(descriptor)


def _attend(connection: _socket.socket) -> None:
    """Run the command of a client in a process of its own; send its exit code, or kill it when the client is gone."""
    set_signal(signal.SIGCHLD, signal.SIG_DFL)
    head, streams, _, _ = socket.recv_fds(connection, 20, 3)
    text = connection.recv(int(head), socket.MSG_WAITALL)
    command = fork()
    if command == 0:
        connection.close()
        _run(*json.loads(text), streams)
    for stream in (0, 1, 2, *streams):
        close(stream)
    with suppress(OSError):
        connection.sendall(b"%d\n" % command)
    ended = os.pidfd_open(command)
    if ended not in select([connection, ended], [], [])[0]:
        os.kill(command, signal.SIGKILL)
    _, status, used = os.wait4(command, 0)
    with suppress(OSError):
        connection.sendall(b"%d %d" % (os.waitstatus_to_exitcode(status), used.ru_maxrss))
    os._exit(0)


class _Popen(subprocess.Popen):
    """Has the process of `roaas load` that measures come from the server for it."""

    def __init__(self, args, **options) -> None:
        server = os.environ.get(MEASURING)
        if server and args == [sys.executable, "-P", "-m", "loadtests"] and not options.get("pass_fds"):
            args = [sys.executable, "-I", "-S", "-c", _CLIENT, server, "-m", "loadtests"]
        super().__init__(args, **options)


def _run(words: list[str], folder: str, environment: dict[str, str], streams: list[int]) -> None:
    """Do in this process what `python` with these words does in a new one, and end it."""
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        close(stream)
    os.environ.clear()
    os.environ.update(environment)
    tempfile.tempdir = None  # found anew, by the command's environment
    os.chdir(folder)
    sys.path.insert(0, folder)
    sys.argv[1:] = words[2:]
    if words[1] == "loadtests":  # it ends with its parent, which is the process that waits for it
        os.environ[PARENT_VARIABLE] = str(os.getppid())
    else:
        subprocess.Popen = _Popen
    if words[0] == "-m":
        runpy.run_module(words[1], run_name="__main__", alter_sys=True)
    else:
        exec(words[1], {})  # noqa: S102 -- the text that a test gives `python -c`
    sys.exit()


if __name__ == "__main__":
    _serve(*sys.argv[1:])

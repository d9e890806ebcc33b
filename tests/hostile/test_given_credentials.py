"""Credentials as users give them: keys with a passphrase, passwords in URLs. No command asks for or shows one."""

import base64
import json
import os
import pty
import re
import select
import signal
import ssl
import sys
import threading
from pathlib import Path

import pytest
from aiohttp import web
from echoing_device import leaks
from processes import ended
from small_device import REFUSED, answers, certified, constant, described, small_device
from web_certificate import pair

from conformance.api.rest import guard
from conformance.commandline.secret_file import names_user
from conformance.statement.endpoints import Endpoints
from conformance.statement.statement import StatementError
from conformance.target.connecting import connection_of
from loadtests.clients.endpoint import Endpoint, EndpointError
from roaas import main

_PASSPHRASE = "key-pa55 phrase/9"  # noqa: S105 - of no device
_IN_URL = "in-url-pa55"
_HOUSE = Path(__file__).parents[2]
_NUMBER = {"type": "object", "required": ["number"], "properties": {"number": {"type": "integer"}}}
# By how the key is encrypted, as openssl's options: each kind of file that it writes.
_KEYS = {"not encrypted": (), "pkcs8": ("pkcs8", "-topk8", "-v2", "aes-256-cbc"), "traditional": ("ec", "-aes128")}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Make the certificates of server and client, the client's key in each form, and files with passphrases."""
    folder = tmp_path_factory.mktemp("keys")
    pair(folder, "server")
    pair(folder, "client")
    plain = folder / "client-key.pem"
    for kind, command in _KEYS.items():
        made = folder / f"{kind}.key"
        if not command:
            made.write_bytes(plain.read_bytes())
            continue
        tail = ("-in", plain, "-out", made, "-passout", f"pass:{_PASSPHRASE}")
        ended("openssl", *command, *tail, check=True)
    both = (folder / "client.pem").read_bytes() + (folder / "pkcs8.key").read_bytes()
    (folder / "both.pem").write_bytes(both)
    (folder / "passphrase").write_text(_PASSPHRASE + "\n", encoding="utf-8")
    (folder / "wrong").write_text("something-else", encoding="utf-8")
    (folder / "empty").touch()
    (folder / "long").write_text("x" * 5000, encoding="utf-8")
    (folder / "binary").write_bytes(b"\xff\xfe")
    for file in folder.iterdir():
        file.chmod(0o600)
    return folder


@pytest.fixture(scope="module")
def device(files):
    """Serve a device over TLS that refuses clients without the certificate; one of its responses breaks the schema."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(files / "server.pem", files / "server-key.pem")
    context.load_verify_locations(files / "client.pem")
    context.verify_mode = ssl.CERT_REQUIRED
    operation = {"get": {"responses": {"200": answers(_NUMBER), "4XX": REFUSED}}}
    stopped = threading.Event()

    async def stop(_: web.Request) -> web.Response:
        stopped.set()
        return web.json_response({"number": 1})

    routes = {"/good": constant({"number": 1}), "/bad": constant({"number": "one"}), "/stop": {"POST": stop}}
    with small_device(described({"/good": operation, "/bad": operation}), routes, context) as url:
        yield url, stopped


def _options(files: Path, key: str, passphrase: str = "") -> list[object]:
    own = ["--client-cert-file", files / "both.pem"] if key == "both" else None
    named = own or ["--client-cert-file", files / "client.pem", "--client-key-file", files / f"{key}.key"]
    return [*named, *(["--client-key-passphrase-file", files / passphrase] if passphrase else [])]


@pytest.mark.parametrize("key", [*_KEYS, "both"])
def test_a_key_in_each_form_is_read(files, key):
    assert connection_of(_endpoints(files, key, "passphrase" if key != "not encrypted" else "")).certificate


def test_certify_load_and_replay_with_a_key_that_is_encrypted(tmp_path, files, device):
    url, _ = device
    options = [*_options(files, "pkcs8", "passphrase"), "--ca-file", files / "server.pem"]
    done = certified(f"{url}/openapi.json", tmp_path / "out", *options, "--class", "description")
    assert done.requirement("description/body-schema")["verdict"] == "fail", done.text
    plan = ["--operation", "GET /good", "--rate", "40", "--duration", "0.5", "--warmup", "0.1", "--processes", "1"]
    words = ("load", f"{url}/openapi.json", *options, *plan, "--out", tmp_path / "load")
    load = ended(sys.executable, "-m", "roaas", *words)
    assert load.returncode in {0, 4}, load.stdout + load.stderr  # 4: a busy machine
    measured = json.loads((tmp_path / "load" / "latency.json").read_text(encoding="utf-8"))
    assert measured["errors"] == []
    command = (sys.executable, "-m", "roaas", "replay", tmp_path / "out", "description/body-schema")
    again = ended(*command, *options, "--token-for", url)
    assert "still there: description/body-schema" in again.stdout, again.stdout + again.stderr
    elsewhere = ended(*command, *options)
    assert (elsewhere.returncode, "--token-for" in elsewhere.stderr) == (2, True), "the result decides nothing"
    told = (done.text, load.stdout, load.stderr, again.stdout, again.stderr)
    assert leaks(tmp_path, [_PASSPHRASE], *told) == []


def _endpoints(files: Path, key: str, passphrase: str) -> Endpoints:
    options = _options(files, key, passphrase)
    names = [str(option)[2:].replace("-", "_") for option in options[::2]]
    return Endpoints(**dict(zip(names, map(str, options[1::2]), strict=True)))


# The key, the passphrase's file, and what the message says of it.
_UNUSABLE = {
    "no passphrase": ("pkcs8", "", "is encrypted: name the file with its passphrase by --client-key-passphrase-file"),
    "no passphrase, old form": ("traditional", "", "is encrypted: name the file"),
    "no passphrase, in one file": ("both", "", "is encrypted: name the file"),
    "wrong": ("pkcs8", "wrong", "does not decrypt the client key"),
    "wrong, old form": ("traditional", "wrong", "does not decrypt the client key"),
    "empty": ("traditional", "empty", "does not decrypt the client key"),
    "too long": ("pkcs8", "long", "does not decrypt the client key"),
    "not UTF-8": ("pkcs8", "binary", "it is not UTF-8"),
}


@pytest.mark.parametrize("case", _UNUSABLE)
def test_a_key_that_cannot_be_used_is_told(files, case):
    key, passphrase, said = _UNUSABLE[case]
    with pytest.raises(StatementError, match=re.escape(said)) as raised:
        connection_of(_endpoints(files, key, passphrase))
    assert _PASSPHRASE not in str(raised.value)


@pytest.mark.parametrize("command", ["certify", "load", "replay"])
def test_no_command_asks_for_a_passphrase(tmp_path, files, command):
    (tmp_path / "result.json").write_text('{"format": "roaas-result/1", "requirements": []}', encoding="utf-8")
    target = tmp_path if command == "replay" else "https://127.0.0.1:9/openapi.json"
    code, text = _on_a_terminal(command, target, *_options(files, "pkcs8"))
    assert (code, "is encrypted: name the file" in " ".join(text.split())) == (2, True), text


def _on_a_terminal(*words: object) -> tuple[int, str]:
    """Run a command that has a terminal, where it could ask; return its exit code and what it wrote."""
    pid, terminal = pty.fork()
    if pid == 0:
        os.execv(sys.executable, [sys.executable, "-m", "roaas", *map(str, words)])  # noqa: S606 - of this terminal
    text = b""
    while select.select([terminal], [], [], 120)[0]:
        try:
            text += os.read(terminal, 65536)
        except OSError:  # its end
            break
    else:
        os.kill(pid, signal.SIGKILL)
    os.close(terminal)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), text.decode()


def test_the_process_that_stops_a_device_has_the_key_too(files, device):
    url, stopped = device
    names = ("server.pem", "client.pem", "pkcs8.key", "passphrase")
    stop = {
        "host": "127.0.0.1",
        "port": int(url.rpartition(":")[2]),
        "tls": json.dumps([str(files / name) for name in names]),
        "request": base64.b64encode(b"POST /stop HTTP/1.1\r\nHost: x\r\nContent-Length: 0\r\n\r\n").decode(),
    }
    told = {"stops": [stop], "login": None, "for_s": 20, "deadline_s": 10}
    program = Path(guard.__file__).with_name("guard_process.py")
    ended(sys.executable, "-I", "-S", program, input=json.dumps(told) + "\n", check=True)
    assert stopped.is_set()


# Where a URL is given: the words after `roaas`, and what a statement has.
_WITH_URL = {
    "certify": ("certify", "URL/openapi.json"),
    "certify --rest": ("certify", "--rest=URL"),
    "certify --base-url": ("certify", "x.json", "--base-url", "URL"),
    "certify --wsdl": ("certify", "--wsdl", "URL?wsdl"),
    "certify --init": ("certify", "--init", "robot.toml", "URL/openapi.json"),
    "load": ("load", "URL/openapi.json"),
    "load --stream": ("load", "x.json", "--stream", "ws://USER@127.0.0.1:9/x"),
    "load --against": ("load", "--rest", "http://127.0.0.1:9", "--against", "URL"),
    "replay --token-for": ("replay", ".", "--token-for", "URL"),
    "diff": ("diff", "URL/a.json", "x.json"),
    "selftest --api": ("selftest", "--api", "URL/openapi.json"),
    "a statement": ("certify", "robot.toml"),
    "a statement's base_url": ("certify", "described.toml"),
    "a statement for load": ("load", "robot.toml"),
    "a fleet": ("certify", "--fleet", "fleet.toml"),
}
_USERS = {
    "both": f"operator:{_IN_URL}",
    "a slash": f"operator:in/{_IN_URL}",
    "an at sign": f"operator:x@{_IN_URL}",
    "escaped": "operator:" + "".join(f"%{ord(char):02x}" for char in _IN_URL),
    "a token alone": _IN_URL,
}


@pytest.mark.parametrize("command", _WITH_URL)
def test_a_user_in_a_url_is_refused_and_shown_nowhere(tmp_path, monkeypatch, capfd, command):
    url = f"http://{_USERS['both']}@127.0.0.1:9"
    for name, text in {
        "robot.toml": f'[endpoints]\nrest = "{url}"\n',
        "described.toml": f'[api]\nopenapi = "x.json"\nbase_url = "{url}"\n',
        "fleet.toml": '[[robot]]\nstatement = "robot.toml"\n',
    }.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    words = [word.replace("URL", url).replace("USER", _USERS["both"]) for word in _WITH_URL[command]]
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["roaas", *words])
    with pytest.raises(SystemExit) as ended_with:
        main(words)
    said = capfd.readouterr()
    assert (ended_with.value.code, "--basic-file" in said.err) == (2, True), said
    for given in tmp_path.glob("*.toml"):
        given.unlink()
    assert leaks(tmp_path, [_IN_URL], said.out, said.err) == []


@pytest.mark.parametrize("user", _USERS)
def test_each_form_of_a_user_in_a_url_is_seen(user):
    for url in (f"http://{_USERS[user]}@robot/", f"HTTPS://{_USERS[user]}@[::1]:80", f"--rest=ws://{_USERS[user]}@r"):
        assert names_user([url]), url
    with pytest.raises(EndpointError) as raised:
        Endpoint.parse(f"http://{_USERS[user]}@robot")
    assert _IN_URL not in str(raised.value)


@pytest.mark.parametrize(
    "text", ["http://h:80/users/@me", "http://h/a:b@c", "http://h?x=a:b@c", "http://[::1]:8/@x", "GET /a@b", "a@b.c"]
)
def test_a_url_without_a_user_is_none(text):
    assert not names_user(text)


def test_plain_locust_refuses_a_user_in_a_url():
    command = ("-m", "locust", "-f", _HOUSE / "loadtests" / "locustfile.py", "--headless", "-u", "1", "-t", "1s")
    done = ended(sys.executable, *command, "--rest", f"http://{_USERS['a slash']}@127.0.0.1:9", cwd=_HOUSE)
    assert "cannot begin: a URL has a user" in done.stderr, done.stderr
    assert leaks(_HOUSE / "none", [_IN_URL], done.stdout, done.stderr) == []

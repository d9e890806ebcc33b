"""No credential of a load test is in what it writes, nor in a list of processes, nor sent to a server nobody named."""

import html
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from echoing_device import ENCODINGS, EchoingService, echoing_device, leaks
from processes import shown_of
from soap_devices import serving

from conformance.transport.reach import Trust
from loadtests.clients.robot import Robot, Secrets, with_secrets

_SECRETS = {
    "token": "tok3n/of+this&load-93jd82hd", "basic": "pa55 wörd/43", "wsse": "wsse-pa55 word",
    "key": "k3y in&hdr-8842", "lease": "h3ad er-value\"1'",
}  # fmt: skip
# The options of each credential, with the names of files, over SOAP and over REST.
_SOAP = (
    *("--token-file", "token", "--api-key", "query key", "--api-key-file", "key", "--headers-file", "lease"),
    *("--username-token-file", "wsse"),
)
_REST = ("--basic-file", "basic", "--api-key", "cookie sid", "--api-key-file", "key", "--headers-file", "lease")
_PLAN = ("--rate", "60", "--duration", "0.6", "--warmup", "0.1", "--processes", "2")


@pytest.fixture
def kept(tmp_path):
    """Write each credential to a file of its own; return the folder."""
    folder = tmp_path / "kept"
    folder.mkdir()
    for name, secret in _SECRETS.items():
        before = {"basic": "operator:", "wsse": "operator:", "lease": "X-Lease: "}.get(name, "")
        (folder / name).write_text(before + secret, encoding="utf-8")
    return folder


def _measured(kept: Path, out: Path, *words: str) -> tuple[dict, list[str]]:
    """Run a load test; return its result, and all that it said and that a list of processes shows of it."""
    given = [str(kept / word) if word in _SECRETS else word for word in words]
    command = [sys.executable, "-m", "roaas", "load", *given, *_PLAN, "--out", str(out)]
    said, seen = shown_of(command)
    assert len(seen) >= 4, f"the command, the master, two workers: {said}"
    result = json.loads((out / "latency.json").read_text(encoding="utf-8"))
    return result, [said, *seen.values()]


class _Tiring(EchoingService):
    """Answers as it should twelve times, and then one message of four with a fault that has what it was sent."""

    calls = 0

    def app(self, environ: dict[str, Any], start: Callable[..., Any]) -> list[bytes]:
        if environ["REQUEST_METHOD"] == "GET":
            return super().app(environ, start)
        body = environ["wsgi.input"].read(int(environ.get("CONTENT_LENGTH") or 0)).decode("latin-1")
        fields = " ".join(str(value) for name, value in environ.items() if name.startswith("HTTP_"))
        self.calls += 1
        if self.calls <= 12 or self.calls % 4:
            start("200 OK", [("Content-Type", "text/xml; charset=utf-8")])
            load = "<load><grams>1</grams><stable>true</stable></load>"
            return [self.envelope(f'<c:GetLoadResponse xmlns:c="urn:scale">{load}</c:GetLoadResponse>')]
        start("500 Internal Server Error", [("Content-Type", "text/xml; charset=utf-8")])
        sent = f"{environ.get('QUERY_STRING')} {fields} {body}"
        written = [html.escape(write(sent)) for name, write in ENCODINGS.items() if name != "utf_16"]
        return [self.fault("Server", "".join(written))[1]]


def test_over_soap(tmp_path, kept):
    with serving(_Tiring()) as url:
        words = (f"{url}/scale.wsdl", "--operation", "GetLoad", *_SOAP)
        result, shown = _measured(kept, tmp_path / "out", *words)
    assert "$ROAAS_" in json.dumps(result["errors"]), f"the device's faults show what it was sent: {shown[0]}"
    assert leaks(tmp_path / "out", _SECRETS.values(), *shown) == []


def test_over_rest(tmp_path, kept):
    with echoing_device() as url:
        words = (f"{url}/openapi.json", "--operation", "GET /tiring", *_REST)
        result, shown = _measured(kept, tmp_path / "out", *words)
    assert "$ROAAS_" in json.dumps(result["errors"]), f"the device's errors show what it was sent: {shown[0]}"
    assert leaks(tmp_path / "out", _SECRETS.values(), *shown) == []


# What a master names, and whether a worker that was given http://robot:8000/openapi.json sends its credentials there.
_NAMED = {
    "the same": (Robot("http://robot:8000/api", None, None), True),
    "another host": (Robot("http://robot.evil:8000", None, None), False),
    "another port": (Robot("http://robot:8001", None, None), False),
    "another scheme": (Robot("https://robot:8000", None, None), False),
    "the SOAP service elsewhere": (Robot("http://robot:8000", "http://evil/soap", None), False),
    "a WSDL elsewhere": (Robot(None, "http://robot:8000", None, publishers_wsdl="http://evil/x?wsdl"), False),
    "a WSDL in a file": (Robot(None, "http://robot:8000", None, publishers_wsdl="/folder/x.wsdl"), True),
    "a rosbridge elsewhere": (Robot(None, None, None, rosbridge="ws://evil:9090"), False),
    "a trusted host": (Robot("http://other:80", None, None), True),
}


@pytest.mark.parametrize("name", _NAMED)
def test_a_worker_sends_its_credentials_to_no_server_that_the_master_alone_names(name):
    robot, allowed = _NAMED[name]
    trust = Trust.of("http://robot:8000/openapi.json", hosts=["other"])
    for secrets in (Secrets(token="t0ken-of-robot", trust=trust), Secrets(token="t0ken-of-robot")):  # noqa: S106
        if allowed or secrets.trust is None:
            assert with_secrets(robot, secrets).token
        else:
            with pytest.raises(ValueError, match="do not go to"):
                with_secrets(robot, secrets)
    assert with_secrets(robot, Secrets(trust=trust)) == robot, "without credentials any server will do"

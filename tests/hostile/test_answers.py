"""Whatever a device answers, its reader ends in time and memory, with a verdict and without a traceback."""

import json
import resource
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest
from answering import ANSWERS, answering
from processes import ended
from small_device import answers, described

from conformance.documents.representation import UnreadableError, read
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, NoAnswerError
from conformance.transport.raw import head, read_one, talk

_NAMES = list(ANSWERS)
_SECONDS = 1.0
# Besides the deadline: what a busy machine needs for the octets that a reader takes at most.
_LATE_S = 30.0
_MOST_MB = 500


def _peak_mb() -> int:
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return size >> (20 if sys.platform == "darwin" else 10)


@pytest.mark.parametrize("endless", [False, True], ids=["whole", "beginning"])
@pytest.mark.parametrize("number", range(len(_NAMES)), ids=_NAMES)
def test_the_clients_of_the_suite_end(number: int, *, endless: bool) -> None:
    with answering() as port:
        client = HttpClient(f"http://127.0.0.1:{port}", Connection(timeout_s=_SECONDS, endless=endless))
        began, before = time.monotonic(), _peak_mb()
        for _ in range(2):
            with suppress(NoAnswerError, UnreadableError):
                response = client.send("GET", f"/{number}").response
                read(response.media_type or "application/json", response.body, {"type": "object"})
        client.close()
        client = HttpClient(f"http://127.0.0.1:{port}", Connection(timeout_s=_SECONDS, endless=endless))
        if not endless:
            request = head(client, "GET", f"/{number}")
            read_one(client, request, talk(client, request, answers=1), "GET")
        client.close()

    assert time.monotonic() - began < 3 * _SECONDS + _LATE_S
    assert _peak_mb() - before < _MOST_MB / 2


def test_what_follows_a_response_is_never_the_response_to_the_next_request() -> None:
    with answering() as port:
        client = HttpClient(f"http://127.0.0.1:{port}", Connection(timeout_s=60))
        two = _NAMES.index("two responses for one")

        statuses = [client.send("GET", f"/{two}").response.status for _ in range(4)]

        assert statuses == [200] * 4


def test_interim_responses_before_the_final_one_are_read() -> None:
    good = b"HTTP/1.1 103 Early Hints\r\n\r\n" * 90 + b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nok"
    with answering({"interim": good}) as port:
        client = HttpClient(f"http://127.0.0.1:{port}", Connection(timeout_s=60))

        assert client.send("GET", "/0").response.body == b"ok"
        request = head(client, "GET", "/0")
        found, rest = read_one(client, request, talk(client, request, answers=1), "GET")
        assert isinstance(found, Exchange)
        assert (found.response.body, rest) == (b"ok", b"")


def _write_description(path: Path, names: list[str]) -> None:
    kinds = ("application/json", "application/xml", "application/yaml")
    content = {kind: {"schema": {"type": "object"}} for kind in kinds}
    operation = {"responses": {"200": {**answers({}), "content": content}, "4XX": answers({})}}
    paths = {f"/{_NAMES.index(name)}": {"get": operation} for name in names}
    path.write_text(json.dumps(described(paths)), encoding="utf-8")


_SLOW = [name for name in _NAMES if "slow" in name]
_QUICK = [name for name in _NAMES if name not in _SLOW]


@pytest.mark.parametrize("names", [_QUICK[0::4], _QUICK[1::4], _QUICK[2::4], _QUICK[3::4]], ids=["1", "2", "3", "4"])
def test_a_device_that_answers_so_gets_a_verdict(names: list[str], tmp_path: Path) -> None:
    _write_description(tmp_path / "api.json", names)
    with answering() as port:
        where = ("--base-url", f"http://127.0.0.1:{port}", "--timeout", 1, "--minutes", 0.1)
        options = ("--effort", "quick", "--wait", 1, "-q", "--out", tmp_path / "out")
        command = (sys.executable, "-m", "roaas", "certify", tmp_path / "api.json", *where, *options)
        done = ended(*command, peak_mb=tmp_path / "peak")

    assert "Traceback" not in done.stdout + done.stderr
    assert done.returncode in {1, 3, 4}, done.stdout + done.stderr
    result = json.loads((tmp_path / "out/result.json").read_text(encoding="utf-8"))
    assert result["requirements"]
    assert int((tmp_path / "peak").read_text()) < _MOST_MB


@pytest.mark.parametrize("client", ["wire", "library"])
def test_the_clients_of_load_tests_end(client: str, tmp_path: Path) -> None:
    program = Path(__file__).parent / "answer_clients.py"
    with answering() as port:
        command = (sys.executable, "-m", "gevent.monkey", program, client, port, len(_NAMES))
        done = ended(*command, peak_mb=tmp_path / "peak")  # the program measures itself, from a small parent on

    found = dict(zip(_NAMES, map(json.loads, done.stdout.splitlines()), strict=True))
    assert "Traceback" not in done.stderr, done.stderr
    assert {name: one for name, one in found.items() if one["megabytes"] > _MOST_MB} == {}
    assert {name: one for name, one in found.items() if one["seconds"] > 2 * 2 + _LATE_S} == {}
    assert all("200" not in outcome for name in _ENDLESS for outcome in found[name]["outcomes"]), found
    second = found["two responses for one"]["outcomes"]
    assert all("201" not in outcome for outcome in second), second


_ENDLESS = [name for name in _NAMES if "without end" in name and "second" not in name]

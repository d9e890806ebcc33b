"""A history has every request of a run, whoever sends it, without a secret, and up to the moment of a kill."""

import gzip
import signal
import subprocess
import sys
import time
from contextlib import closing, suppress

import pytest
from aiohttp import web
from hypothesis import given, settings
from hypothesis import strategies as st
from small_device import certified, constant, described, reading, small_device

from conformance.commandline.secrecy import SECRETS
from conformance.history.events import VERSION, Began, Ended, Eye, HistoryError, Octets, Seen, Sent, Span, read_history
from conformance.history.writing import HISTORY_NAME, HistoryWriter
from conformance.transport import raw
from conformance.transport.client import Connection, HttpClient
from conformance.transport.credentials import Credentials, bearer
from conformance.transport.exchange import NoAnswer, NoAnswerError, Outgoing, Request, Response
from conformance.transport.fetching import Fetcher
from conformance.transport.parallel import send_together
from conformance.transport.passage import EyeState, Passage
from conformance.transport.raw import PartialRequest
from conformance.transport.reach import Trust

STARTED = "2026-11-28T00:00:00.000000Z"
ANY = Passage(Request("GET", "http://device/a"), 1, 1, 1, time.monotonic(), 0.0, time.monotonic(), 10.0, None, "no")


@pytest.fixture(autouse=True)
def _forgotten():
    yield
    SECRETS.forget()


def written(folder, *passages):
    writer = HistoryWriter(folder, "1", STARTED)
    for passage in passages:
        writer.record(passage)
    writer.close()
    assert writer.problem == ""
    return list(read_history(folder / HISTORY_NAME))


async def _moved(_):
    return web.Response(status=302, headers={"Location": "/a"})


ROUTES = {"/a": constant({"a": 1}), "/moved": {"GET": _moved}}


def test_every_client_and_socket_is_recorded(tmp_path):
    with small_device(described({"/a": reading({"type": "object"})}), ROUTES) as url:
        writer = HistoryWriter(tmp_path, "1", STARTED)
        connection = Connection(timeout_s=10, recorder=writer)
        with closing(HttpClient(url, connection)) as client:
            client.send("GET", "/a")
            client.send("GET", "/a")
            writer.begin("together")
            send_together([[(client, Outgoing("GET", "/a"))] * 2])
            writer.begin("by hand")
            raw.talk(client, raw.head(client, "GET", "/a"), answers=1)
            PartialRequest(client, "PUT", "/a", sent=b"{", promised=9).vanish()
            Fetcher(connection, Trust.of(url))(f"{url}/moved")
        connection.recorder.saw("topic", time.monotonic(), [1.5, float("nan")])
        connection.recorder.eye("topic", EyeState.LOST)
        writer.close()
    began, *events, ended = read_history(tmp_path / HISTORY_NAME)
    assert began == Began(VERSION, "1", STARTED)
    sent = [one for one in events if isinstance(one, Sent)]
    assert [one.id for one in sent] == list(range(1, 9))
    assert isinstance(ended, Ended)
    assert ended.events == len(sent)
    first, second, *together, by_hand, half, moved, fetched = sent
    assert (second.connection, second.place) == (first.connection, 2)
    assert {one.span for one in together} == {"together"}
    assert len({one.connection for one in (first, by_hand, half, *together)}) == 5
    assert len({one.client for one in (first, *together)}) == 3
    assert b"200 OK" in by_hand.octets.content
    assert (half.whole, half.came, half.outcome.problem) == (False, None, "the suite reset the connection")
    assert (moved.came.status, fetched.came.status, fetched.came.body.content) == (302, 200, b'{"a": 1}')
    for one in (first, second, by_hand, *together):
        assert 0 < one.sent_s <= one.first_s <= one.ended_s <= ended.at_s
    assert first.outcome.response.body == b'{"a": 1}'
    seen, eye = (one for one in events if isinstance(one, Seen | Eye))
    assert (seen.values, eye.state) == ((1.5, "nan"), EyeState.LOST)
    assert [one.name for one in events if isinstance(one, Span)] == ["together", "by hand"]


def test_a_request_without_a_response_is_recorded_with_the_reason(tmp_path):
    async def breaks_off(request):
        request.transport.abort()
        return web.Response()

    with small_device(described({}), {"/a": {"GET": breaks_off}}) as url:
        writer = HistoryWriter(tmp_path, "1", STARTED)
        with closing(HttpClient(url, Connection(recorder=writer))) as client, pytest.raises(NoAnswerError):
            client.send("GET", "/a", fresh=True)
        writer.close()
    *_, sent, _ = read_history(tmp_path / HISTORY_NAME)
    assert (sent.kind, sent.came, sent.first_s) == (NoAnswer.CLOSED, None, 0.0)
    assert sent.outcome.problem


def test_a_certification_keeps_all_its_requests(tmp_path):
    device = described({"/a": reading({"type": "object", "required": ["a"], "properties": {"a": {"type": "integer"}}})})
    with small_device(device, ROUTES) as url:
        done = certified(f"{url}/openapi.json", tmp_path / "out")
    events = list(read_history(tmp_path / "out" / HISTORY_NAME))
    sent = [one for one in events if isinstance(one, Sent)]
    assert len(sent) >= done.result["requests"] > 50
    assert isinstance(events[-1], Ended)
    assert done.exit_code == 0, done.text
    names = {one.span for one in sent}
    assert any(name.startswith("test_http_methods.py") for name in names)


def test_secrets_are_variables_in_every_part(tmp_path):
    SECRETS.keep("kep7-secret-value", "$ROAAS_TOKEN")
    secret, began = b"kep7-secret-value", time.monotonic()
    request = Request("POST", "http://device/a", (("X-Own", secret.decode()),), secret, secret + b"\xff")
    response = Response(200, (("X-Echo", secret.decode()),), secret + b"\xff", 1.0)
    events = written(tmp_path, Passage(request, 1, 1, 1, began, began, began, 1.0, response, secret.decode()))
    plain = gzip.decompress((tmp_path / HISTORY_NAME).read_bytes())
    assert b"kep7" not in plain
    assert events[1].came.body.content == b"$ROAAS_TOKEN\xff"
    assert events[1].request.raw == b"$ROAAS_TOKEN\xff"


def test_credentials_are_never_written(tmp_path):
    with small_device(described({}), ROUTES) as url:
        writer = HistoryWriter(tmp_path, "1", STARTED)
        connection = Connection(recorder=writer, credentials=Credentials((bearer("t0ken-of-the-run"),)))
        with closing(HttpClient(url, connection)) as client:
            client.send("GET", "/a")
            raw.talk(client, raw.head(client, "GET", "/a"), answers=1)
            PartialRequest(client, "GET", "/a", head_only=-2).vanish()
        writer.close()
    plain = gzip.decompress((tmp_path / HISTORY_NAME).read_bytes())
    assert b"t0ken" not in plain
    assert plain.count(b"$ROAAS_TOKEN") == 2  # a request that is never whole is shown without its credentials


@pytest.mark.parametrize("octets", [b"", b"{}", b"\x00\xff", "ä\u2028".encode(), b"a" * (1 << 20)])
def test_a_body_comes_back_bit_for_bit(octets):
    assert Octets.of(octets).content == octets


def test_of_a_long_body_the_hash_is_kept(tmp_path):
    began = time.monotonic()
    long = Response(200, (), bytes((1 << 20) + 1), 1.0)
    sent = written(tmp_path, Passage(Request("GET", "http://a/"), 1, 1, 1, began, began, began, 1.0, long))[1]
    assert (sent.came.body.length, len(sent.came.body.sha256), sent.outcome) == ((1 << 20) + 1, 64, None)
    assert (tmp_path / HISTORY_NAME).stat().st_size < 2000


KILLED = """
import sys, time
sys.path[:0] = sys.argv[2:]
from pathlib import Path
from test_history import ANY, STARTED
from conformance.history.writing import HistoryWriter
writer = HistoryWriter(Path(sys.argv[1]), "1", STARTED)
for number in range(500):
    writer.record(ANY)
until = Path(sys.argv[1], "history.jsonl.gz")
while not until.exists() or until.stat().st_size < 400:
    time.sleep(0.01)
print("written", flush=True)
while True:
    writer.record(ANY)
    time.sleep(0.001)
"""


def test_what_was_written_before_a_kill_can_be_read(tmp_path):
    command = [sys.executable, "-c", KILLED, str(tmp_path), *sys.path]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "written\n"
        process.send_signal(signal.SIGKILL)
    events = list(read_history(tmp_path / HISTORY_NAME))
    assert isinstance(events[0], Began)
    assert sum(isinstance(one, Sent) for one in events) >= 500
    assert not isinstance(events[-1], Ended)


def test_a_history_cut_anywhere_is_read_up_to_there(tmp_path):
    whole = written(tmp_path, *[ANY] * 20)
    octets = (tmp_path / HISTORY_NAME).read_bytes()
    for length in range(12, len(octets), 7):
        (tmp_path / "cut.gz").write_bytes(octets[:length])
        events = list(read_history(tmp_path / "cut.gz"))
        assert events == whole[: len(events)]


def test_an_earlier_history_is_replaced_and_no_link_is_followed(tmp_path):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.write_text("kept")
    (tmp_path / HISTORY_NAME).symlink_to(elsewhere)
    written(tmp_path, ANY)
    assert elsewhere.read_text() == "kept"


def test_what_cannot_be_written_is_told_and_ends_nothing(tmp_path):
    writer = HistoryWriter(tmp_path / "missing", "1", STARTED)
    writer.record(ANY)
    writer.close()
    assert "No such file" in writer.problem


BEGAN = '{"event":"began","version":1,"suite":"1","started":"now"}'


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        ([BEGAN.replace('"version":1', '"version":99')], "of version 99"),
        (['{"event":"span","at_s":1,"name":"x"}'], "its first"),
        ([BEGAN, BEGAN], "its first"),
        ([BEGAN, '{"event":"sent"}'], "missing required field"),
        ([BEGAN, '{"event":"other"}'], "other"),
        ([BEGAN, "[" * 100_000], "cannot be read"),
    ],
)
def test_a_file_that_is_no_history_is_refused(tmp_path, lines, why):
    path = tmp_path / "a.gz"
    path.write_bytes(gzip.compress("".join(f"{line}\n" for line in lines).encode()))
    with pytest.raises(HistoryError, match=why):
        list(read_history(path))


@settings(max_examples=100, deadline=None, derandomize=True)
@given(octets=st.binary(max_size=200), zipped=st.booleans())
def test_no_file_ends_in_anything_but_events_or_an_error(tmp_path_factory, octets, zipped):
    path = tmp_path_factory.mktemp("history") / "a.gz"
    path.write_bytes(gzip.compress(octets) if zipped else octets)
    with suppress(HistoryError):
        list(read_history(path))

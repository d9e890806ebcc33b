"""Where a request to the reference robot ends: what is in doubt is refused, and the connection is closed."""

import pytest
from web_protocol import closed, request, runs, statuses

HOST = b"Host: a\r\n"
CHUNKED = b"Transfer-Encoding: chunked"
HELLO = b"5\r\nhello\r\n0\r\n\r\n"
UPGRADE = b"Connection: Upgrade\r\n"


def put(*fields, body=b"hello", version=b"1.1"):
    return b"PUT /now HTTP/%b\r\n%b%b\r\n%b" % (version, HOST, b"".join(one + b"\r\n" for one in fields), body)


def length(value):
    return put(b"Content-Length: " + value)


def coded(value, *fields):
    return put(b"Transfer-Encoding: " + value, *fields, body=HELLO)


def chunks(body):
    return put(CHUNKED, body=body)


def head(octets):
    return octets + HOST + b"\r\n"


# Requests after which the robot says 4xx or 5xx and closes the connection: nothing is executed, nothing of it remains.
REFUSED = {
    "two lengths": put(b"Content-Length: 5", b"Content-Length: 5"),
    "two unequal lengths": put(b"Content-Length: 5", b"Content-Length: 6"),
    **{
        f"length {value!a}": length(value)
        for value in (b"5, 5", b"5, 6", b"+5", b"-5", b"0x5", b"5_0", b"5.0", b"5 5", b"", b"5\0", b"9" * 5000)
    },
    "length over 64 bits": length(b"18446744073709551621"),
    "length in Arabic digits": length("\u0665".encode()),
    "space before the colon": put(b"Content-Length : 5"),
    "tab before the colon": put(b"Content-Length\t: 5"),
    "length and coding": put(CHUNKED, b"Content-Length: 5", body=HELLO),
    "coding and length": put(b"Content-Length: 5", CHUNKED, body=HELLO),
    **{
        f"coding {value!a}": coded(value)
        for value in (
            *(b"identity", b"chunked, identity", b"identity, chunked", b"gzip, chunked", b"gzip", b"chunked, chunked"),
            *(b"xchunked", b"chunkedx", b'"chunked"', b"chunked;q=1", b"\x0bchunked", b"chunked,", b"", b"chunked\0"),
            *(b"\r\n chunked", b"chunked\r\nTransfer-Encoding: chunked", b"gzip\r\nTransfer-Encoding: chunked"),
            b"chunked\r\nTransfer-Encoding: identity",
        )
    },
    "coding in HTTP/1.0": put(CHUNKED, body=HELLO, version=b"1.0"),
    "coding in HTTP/1.0, kept alive": put(CHUNKED, b"Connection: keep-alive", body=HELLO, version=b"1.0"),
    "coding and length in HTTP/1.0": put(b"Content-Length: 5", CHUNKED, b"Connection: keep-alive", version=b"1.0"),
    **{
        f"chunk size {size!a}": chunks(size + b"\r\nhello\r\n0\r\n\r\n")
        for size in (b"+5", b"-5", b"0x5", b"5_", b" 5", b"5 ", b"5\t", b"", b"10000000000000005", b"4", b"5 ; a=b")
    },
    "chunks with bare LF": chunks(b"5\nhello\n0\n\n"),
    "bare LF after a chunk": chunks(b"5\r\nhello\n0\r\n\r\n"),
    "no line end after a chunk": chunks(b"5\r\nhelloXX0\r\n\r\n"),
    "bare LF in an extension": chunks(b"5;a\nhello\r\n0\r\n\r\n"),
    "bare CR in an extension": chunks(b"5;a\rb\r\nhello\r\n0\r\n\r\n"),
    "NUL in an extension": chunks(b"5;a\0\r\nhello\r\n0\r\n\r\n"),
    "length as a trailer": chunks(b"5\r\nhello\r\n0\r\nContent-Length: 50\r\n\r\n"),
    "no colon in a trailer": chunks(b"5\r\nhello\r\n0\r\nX y\r\n\r\n"),
    "folded field": put(b"X: a\r\n b", body=b""),
    "first field folded": b"GET /now HTTP/1.1\r\n X: a\r\nHost: a\r\n\r\n",
    "bare CR in a field": put(b"X: a\rb", body=b""),
    "bare LF in a field": put(b"X: a\nY: b", body=b""),
    "bare LF everywhere": b"GET /now HTTP/1.1\nHost: a\n\n",
    "NUL in a value": put(b"X: a\0b", body=b""),
    "NUL in a name": put(b"X\0: a", body=b""),
    "control character in a value": put(b"X: a\x01b", body=b""),
    "space in a name": put(b"X y: a", body=b""),
    "no colon": put(b"Xy", body=b""),
    "no name": put(b": a", body=b""),
    "NUL in the target": head(b"GET /n\0w HTTP/1.1\r\n"),
    "octets beyond ASCII in the target": head(b"GET /n\xffw HTTP/1.1\r\n"),
    "tabs in the request line": head(b"GET\t/now\tHTTP/1.1\r\n"),
    "space after the version": head(b"GET /now HTTP/1.1 \r\n"),
    **{
        f"version {version!a}": head(b"GET /now %b\r\n" % version)
        for version in (b"HTTP/1.2", b"HTTP/2.0", b"HTTP/0.9", b"http/1.1", b"HTTP/1.10", b"HTTP/01.1")
    },
    "version kept alive": head(b"GET /now HTTP/2.0\r\nConnection: keep-alive\r\n"),
    "no version": b"GET /now\r\n\r\n",
    "HTTP/2 without an upgrade": b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    "TLS": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + b"\0" * 60,
    "a tunnel": head(b"CONNECT a:80 HTTP/1.1\r\n"),
    "space before the method": b" " + request(),
    "byte order mark": b"\xef\xbb\xbf" + request(),
    "many fields": put(*[b"A%d: b" % one for one in range(20_000)], body=b""),
    "many small fields": put(*[b"a:"] * 20_000, body=b""),
    "a long field": put(b"X: " + b"a" * 70_000, body=b""),
}

# Requests that are executed with this body; the next request on the connection is answered as well.
TAKEN = {
    "length with zeros": (length(b"00005"), b"hello"),
    "length between tabs": (length(b"\t5\t"), b"hello"),
    "coding in capitals": (coded(b"CHUNKED"), b"hello"),
    "extension": (chunks(b'5;a=b;c="d"\r\nhello\r\n0\r\n\r\n'), b"hello"),
    "trailer": (chunks(b"5\r\nhello\r\n0\r\nX: y\r\n\r\n"), b"hello"),
    "body of GET": (request(body=b"hello"), b"hello"),
    "body of DELETE": (request(method="DELETE", body=b"hello"), b"hello"),
    "empty lines before": (b"\r\n\r\n" + request(), b""),
    **{
        f"offer of {offer!a}": (put(UPGRADE + offer, b"Content-Length: 5"), b"hello")
        for offer in (b"Upgrade: h2c", b"UPGRADE: h2c", b"uPGRADE:websocket", b"Upgrade: h2c\r\nUpgrade: TLS/1.0")
    },
    "offer with chunks": (put(UPGRADE + b"UPGRADE: h2c", CHUNKED, body=HELLO), b"hello"),
    "offer without a body": (put(UPGRADE + b"UPGRADE: h2c", body=b""), b""),
    "offer with GET": (request("/now", "Connection: Upgrade", "UPGRADE: websocket"), b""),
}


@pytest.mark.parametrize("first", [b"", request("/now?before")], ids=["alone", "after another request"])
@runs()
async def test_what_is_in_doubt_is_refused_and_closes_the_connection(robot, first):
    wrong = {}
    for name, octets in REFUSED.items():
        robot.interface.seen.clear()
        async with robot.talk(first + octets + request("/now?smuggled")) as (reader, _):
            got = statuses(await closed(reader))[bool(first) :]
        seen = robot.interface.seen[bool(first) :]
        if len(got) != 1 or not 400 <= got[0] <= 505 or seen:
            wrong[name] = (got, seen)
    assert wrong == {}


@pytest.mark.parametrize("cut", [None, 7, -3], ids=["whole", "in the method", "in the body"])
@pytest.mark.parametrize("first", [b"", request("/now?before")], ids=["alone", "after another request"])
@runs()
async def test_what_is_clear_is_executed_and_the_connection_goes_on(robot, first, cut):
    wrong = {}
    for name, (octets, body) in TAKEN.items():
        robot.interface.seen.clear()
        whole = first + octets + request("/now?next", "Connection: close")
        split = len(whole) if cut is None else len(first) + (cut if cut > 0 else len(octets) + cut)
        async with robot.talk(whole[:split]) as (reader, writer):
            await writer.drain()
            writer.write(whole[split:])
            got = statuses(await closed(reader))
        seen = [body for _, _, body in robot.interface.seen]
        if set(got) != {200} or seen[bool(first) :] != [body, b""]:
            wrong[name] = (got, seen)
    assert wrong == {}


ENDLESS = {
    "chunk extension": (b"5;", b"a" * 65_536),
    "chunk extensions": (b"", b"1;" + b"a" * 60_000 + b"\r\nx\r\n"),
    "chunk size": (b"", b"0" * 65_536),
    "trailer": (b"0\r\nX: ", b"a" * 65_536),
    "trailers": (b"0\r\n", b"X: " + b"a" * 1000 + b"\r\n"),
}


@pytest.mark.parametrize("refused", [False, True], ids=["", "refused before"])
@pytest.mark.parametrize(("begin", "more"), ENDLESS.values(), ids=ENDLESS)
@runs()
async def test_framing_without_end_is_ended(robot, begin, more, refused):
    target = "/closed" if refused else "/now"
    async with robot.talk(request(target, CHUNKED.decode(), method="PUT") + begin) as (reader, writer):
        await sent(writer, more, 500_000)
        assert statuses(await reader.readuntil(b"\r\n\r\n")) == [401 if refused else 431]
        with pytest.raises(ConnectionError):
            await sent(writer, more, 50_000_000)
    await robot.port.is_empty.wait()
    assert robot.interface.seen == []
    assert robot.port.held.size == 0


async def sent(writer, octets, size):
    for _ in range(size // len(octets)):
        writer.write(octets)
        await writer.drain()


@runs()
async def test_requests_in_one_segment_leave_others_their_turn(robot):
    async with robot.talk(request("/now?first")) as (reader, writer):
        # Connected before: a name is looked up in another thread, which a busy machine may let wait.
        assert statuses(await reader.read(1 << 16)) == [200]
        async with robot.talk(request() * 5000 + request("/now?last", "Connection: close")) as (many, _):
            writer.write(request("/now?other", "Connection: close"))
            assert statuses(await closed(reader)) == [200]
            assert len(robot.interface.seen) < 5000
            assert statuses(await closed(many)) == [200] * 5001
    assert robot.port.held.size == 0

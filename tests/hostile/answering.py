"""What a device may answer to hurt whoever reads it, as data, and a server that sends it byte by byte."""

import socket
import struct
import threading
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import chain, repeat

MEGABYTE = 1 << 20
_JSON = b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n"
_CHUNKED = _JSON + b"Transfer-Encoding: chunked\r\n\r\n"
_GOOD = _JSON + b"Content-Length: 2\r\n\r\n{}"
_KILOBYTES = b"a" * 65_536


def _whole(body: bytes, media_type: str = "application/json", *fields: str) -> bytes:
    lines = ["HTTP/1.1 200 OK", f"Content-Type: {media_type}", f"Content-Length: {len(body)}", *fields, "", ""]
    return "\r\n".join(lines).encode() + body


def _after(head: bytes, piece: bytes, times: int = 4000) -> Callable[[], Iterator[bytes]]:
    """Return what sends a piece so often, some 250 MB."""
    return lambda: chain([head], repeat(piece, times))


def _dripping(head: bytes, piece: bytes) -> Callable[[], Iterator[bytes]]:
    def answer() -> Iterator[bytes]:
        yield head
        while True:
            time.sleep(0.2)
            yield piece

    return answer


def _packed(head: bytes, tail: bytes) -> bytes:
    """Return 1500 MB of zeros, packed: a packed megabyte, repeated, as each test process imports this module."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    piece = packer.compress(b"\0" * MEGABYTE) + packer.flush(zlib.Z_FULL_FLUSH)
    return head + piece * 1500 + packer.flush() + tail


# The tails are the CRC-32 and the size, and the Adler-32, of that many zeros.
_GZIPPED = _packed(b"\x1f\x8b\x08" + bytes(7), struct.pack("<II", 0xAA4BAF42, 1500 * MEGABYTE))
_DEFLATED = _packed(b"\x78\xda", struct.pack(">I", 0x7E8B0001))


def _laughs(line: str, top: str) -> bytes:
    lines = [line.format(i, i - 1) for i in range(1, 15)]
    return (top + "".join(lines)).encode()


_ALIASES = _laughs("x{0}: &a{0} [" + "*a{1}," * 10 + "]\n", "x0: &a0 [lol]\n")
_MERGED = _ALIASES.replace(b"[lol]", b"{k: v}").replace(b"[", b"{<<: [").replace(b"]", b"]}")
_COOKIES = b"".join(b"Set-Cookie: a%d=b\r\n" % i for i in range(2000))
_ENTITIES = b"<!DOCTYPE a [<!ENTITY a0 'lol'>%b]><a>&a13;</a>" % b"".join(
    b"<!ENTITY a%d '%b'>" % (i, b"&a%d;" % (i - 1) * 10) for i in range(1, 14)
)
#: For each name, what is sent for each request, if it is a text, or a function that returns the pieces.
ANSWERS: dict[str, bytes | Callable[[], Iterator[bytes]]] = {
    "a body without end": _after(_JSON + b"\r\n", _KILOBYTES),
    "a long body with its length": _after(_JSON + b"Content-Length: 999999999999\r\n\r\n", _KILOBYTES),
    "a chunk extension without end": _after(_CHUNKED + b"2;", _KILOBYTES),
    "many chunk extensions": _after(_CHUNKED, b"1;%b\r\na\r\n" % (b"e" * 60_000)),
    "chunks of one octet": _after(_CHUNKED, b"1\r\na\r\n" * 10_000, 5),
    "a trailer without end": _after(_CHUNKED + b"2\r\n{}\r\n0\r\n", b"X-A: b\r\n" * 8000),
    "a header without end": _after(b"HTTP/1.1 200 OK\r\n", b"X-A: b\r\n" * 8000),
    "a header field without end": _after(b"HTTP/1.1 200 OK\r\nX-A: ", _KILOBYTES),
    "a status line without end": _after(b"HTTP/1.1 200 ", _KILOBYTES),
    "cookies": b"HTTP/1.1 200 OK\r\n%bContent-Length: 2\r\n\r\n{}" % _COOKIES,
    "interim responses without end": _after(b"", b"HTTP/1.1 100 Continue\r\n\r\n" * 3000),
    "interim responses of its own": _after(b"", b"HTTP/1.1 150 Yes\r\n\r\n" * 3000),
    "a slow body": _dripping(_CHUNKED, b"1\r\na\r\n"),
    "a slow header": _dripping(b"HTTP/1.1 200 OK\r\n", b"X-A: b\r\n"),
    "slow interim responses": _dripping(b"", b"HTTP/1.1 100 Continue\r\n\r\n"),
    "two responses for one": _GOOD + _GOOD.replace(b"200 OK", b"201 No"),
    "a second response without end": _after(_GOOD, _KILOBYTES),
    "HTTP/1.0 with chunks": _CHUNKED.replace(b"HTTP/1.1", b"HTTP/1.0") + b"2\r\n{}\r\n0\r\n\r\n",
    "a gzip bomb": _whole(_GZIPPED, "application/json", "Content-Encoding: gzip"),
    "a deflate bomb": _whole(_DEFLATED, "application/json", "Content-Encoding: deflate"),
    "deep JSON": _whole(b"[" * 100_000 + b"]" * 100_000),
    "deep JSON objects": _whole(b'{"a":' * 100_000 + b"1" + b"}" * 100_000),
    "a JSON number of 8 MB": _whole(b"1" * (8 * MEGABYTE)),
    "a JSON fraction of 8 MB": _whole(b"0." + b"1" * (8 * MEGABYTE)),
    "a JSON name twice among many": _whole(b"{%b}" % b",".join(b'"%d":0' % (i % 200_000) for i in range(200_001))),
    "XML entities": _whole(_ENTITIES, "application/xml"),
    "deep XML": _whole(b"<a>" * 100_000, "application/xml"),
    "XML attributes": _whole(b"<a %b/>" % b" ".join(b"a%d=''" % i for i in range(100_000)), "application/xml"),
    "YAML aliases": _whole(_ALIASES, "application/yaml"),
    "YAML merge keys": _whole(_MERGED, "application/yaml"),
    "deep YAML": _whole(b"- " * 100_000, "application/yaml"),
    "deep YAML in brackets": _whole(b"[" * 100_000, "application/yaml"),
    "nothing but zeros": _after(b"", b"\0" * 65_536),
    "a TLS alert": b"\x15\x03\x01\x00\x02\x02\x28",
    "a redirect to itself": b"HTTP/1.1 302 Found\r\nLocation: \r\nContent-Length: 0\r\n\r\n",
    "Digest challenges": b"HTTP/1.1 401 No\r\nWWW-Authenticate: Digest realm=a, nonce=b\r\nContent-Length: 0\r\n\r\n",
}  # fmt: skip


@contextmanager
def answering(answers: dict[str, bytes | Callable[[], Iterator[bytes]]] = ANSWERS) -> Iterator[int]:
    """Serve for each path /0, /1, ... the answer at this place of the table; yields the port."""
    listener = socket.create_server(("127.0.0.1", 0), backlog=128)
    listener.settimeout(0.2)
    ended = threading.Event()
    every = list(answers.values())

    def talk(link: socket.socket) -> None:
        with link, suppress(OSError, ValueError, IndexError):
            link.settimeout(30)
            while head := _head(link):
                number = int(head.split(b" ")[1].partition(b"?")[0].strip(b"/") or b"0")
                answer = every[number]
                for piece in [answer] if isinstance(answer, bytes) else answer():
                    if ended.is_set():
                        return
                    link.sendall(piece)
                if not isinstance(answer, bytes):
                    return

    def serve() -> None:
        while not ended.is_set():
            with suppress(OSError):
                threading.Thread(target=talk, args=(listener.accept()[0],), daemon=True).start()

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    yield listener.getsockname()[1]
    ended.set()
    thread.join(10)
    listener.close()


def _head(link: socket.socket) -> bytes:
    """Return the head of the next request, whose body is read as well; empty where the connection ends."""
    octets = b""
    while b"\r\n\r\n" not in octets:
        piece = link.recv(65_536)
        if not piece:
            return b""
        octets += piece
    return octets

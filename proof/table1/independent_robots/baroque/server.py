"""HTTP/1.1 on asyncio's streams, framed by h11."""

import asyncio
import threading
from dataclasses import dataclass
from email.message import Message
from email.utils import formatdate

import h11

from proof.table1.independent_robots.baroque.rest import problem
from proof.table1.independent_robots.plain.server import Application, origin_form

_MAX_HEAD = 48 * 1024
_MAX_BODY = 1024 * 1024
_MAX_TARGET = 8000
_IDLE_S = 20.0
_NO_BODY = {204, 304}


@dataclass
class Ask:
    """A request."""

    method: str
    target: str
    headers: Message
    body: bytes = b""


class Loop:
    """An event loop in a thread of its own."""

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()

    def listen(self, application: Application, port: int) -> str:
        """Serve an application on loopback. Return its URL."""

        async def listen() -> int:
            server = await asyncio.start_server(lambda r, w: _talk(application, r, w), "127.0.0.1", port, backlog=128)
            return int(server.sockets[0].getsockname()[1])

        return f"http://127.0.0.1:{asyncio.run_coroutine_threadsafe(listen(), self._loop).result(10)}"

    def stop(self) -> None:
        """Close every connection and stop the event loop."""
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5)


async def _talk(application: Application, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    connection = h11.Connection(h11.SERVER, max_incomplete_event_size=_MAX_HEAD)
    try:
        while await _exchange(connection, application, reader, writer):
            connection.start_next_cycle()
    except (TimeoutError, OSError, h11.LocalProtocolError):
        pass
    finally:
        writer.close()


async def _exchange(
    connection: h11.Connection, application: Application, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
) -> bool:
    """Read one request and send its response. Return whether the connection can be used for another request."""
    method = "GET"
    try:
        ask = await _next(connection, reader, writer)
        if ask is None:
            return False
        method = ask.method
        reply = application.answer(ask.method, ask.target, ask.headers, ask.body)
    except h11.RemoteProtocolError as error:
        reply = problem(error.error_status_hint, str(error))
        reply.fields["connection"] = "close"
    except _TooLargeError as error:
        reply = problem(error.status, str(error))
        reply.fields["connection"] = "close"
    fields = [("DATE", formatdate(usegmt=True)), ("x-Robot", "baroque"), *reply.fields.items()]
    if reply.media_type:
        fields.append(("CONTENT-type", reply.media_type))
    if not reply.body and reply.status not in _NO_BODY:
        fields.append(("content-LENGTH", "0"))
    encode = [(name.encode(), value.encode("latin-1", "replace")) for name, value in fields]
    writer.write(connection.send(h11.Response(status_code=reply.status, headers=encode)) or b"")
    if reply.body and method != "HEAD":
        third = len(reply.body) // 3 + 1
        for start in range(0, len(reply.body), third):
            writer.write(connection.send(h11.Data(data=reply.body[start : start + third])) or b"")
    writer.write(connection.send(h11.EndOfMessage()) or b"")
    await writer.drain()
    return connection.our_state is h11.DONE and connection.their_state is h11.DONE


class _TooLargeError(Exception):
    def __init__(self, status: int, detail: str) -> None:
        super().__init__(detail)
        self.status = status


async def _next(connection: h11.Connection, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> Ask | None:
    ask: Ask | None = None
    body = bytearray()
    while True:
        event = connection.next_event()
        if event is h11.NEED_DATA:
            if connection.they_are_waiting_for_100_continue:
                go_on = h11.InformationalResponse(status_code=100, headers=[])
                writer.write(connection.send(go_on) or b"")
            connection.receive_data(await asyncio.wait_for(reader.read(65536), _IDLE_S))
        elif isinstance(event, h11.Request):
            ask = _ask_of(event)
        elif isinstance(event, h11.Data):
            body += event.data
            if len(body) > _MAX_BODY:
                raise _TooLargeError(413, f"a body of more than {_MAX_BODY} octets")
        elif isinstance(event, h11.EndOfMessage) and ask is not None:
            ask.body = bytes(body)
            return ask
        else:
            return None


def _ask_of(event: h11.Request) -> Ask:
    headers = Message()
    for name, value in event.headers:
        headers.add_header(name.decode("latin-1"), value.decode("latin-1"))
    if len(event.target) > _MAX_TARGET:
        raise _TooLargeError(414, f"a target of {len(event.target)} octets")
    length = str(headers.get("Content-Length", "0"))
    if length.isdigit() and int(length) > _MAX_BODY:
        raise _TooLargeError(413, f"a body of more than {_MAX_BODY} octets")
    return Ask(event.method.decode("latin-1"), origin_form(event.target.decode("latin-1")), headers)

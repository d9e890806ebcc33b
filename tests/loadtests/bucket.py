"""A device of known capacity: `python bucket.py RATE` answers at most RATE requests a second, by its own clock.

With a second number, each response takes so many ms longer for each second since the first request.
Requests wait in one queue, and each leaves it when its token is due (GCRA), so that a late wake-up costs no capacity.
"""

import asyncio
import json
import sys

DESCRIPTION = {
    "openapi": "3.1.0",
    "info": {"title": "bucket", "version": "1"},
    "paths": {"/state": {"get": {"responses": {"200": {"description": "x", "content": {"application/json": {}}}}}}},
}


def answer(value):
    body = json.dumps(value).encode()
    return b"HTTP/1.1 200 OK\r\nContent-Type: application/json\r\nContent-Length: %d\r\n\r\n%s" % (len(body), body)


STATE, DESCRIBED = answer({"x": 1}), answer(DESCRIPTION)


class Device(asyncio.Protocol):
    interval = 0.0
    burst = 0.0
    due = 0.0
    slower = 0.0
    first = 0.0

    def connection_made(self, transport):
        self.transport, self.given = transport, b""

    def data_received(self, data):
        self.given += data
        while b"\r\n\r\n" in self.given:
            head, _, self.given = self.given.partition(b"\r\n\r\n")
            if b"/openapi.json" in head.partition(b"\r\n")[0]:
                self.transport.write(DESCRIBED)
                continue
            loop = asyncio.get_running_loop()
            Device.due = max(Device.due, loop.time() - Device.burst) + Device.interval
            Device.first = Device.first or loop.time()
            loop.call_at(Device.due + Device.slower * (loop.time() - Device.first), self.transport.write, STATE)


async def serve(rate, slower=0.0):
    Device.interval, Device.burst, Device.slower = 1 / rate, 0.03, slower / 1e3
    server = await asyncio.get_running_loop().create_server(Device, "127.0.0.1", 0, backlog=1024)
    sys.stdout.write(f"ready {server.sockets[0].getsockname()[1]}\n")
    sys.stdout.flush()
    await server.serve_forever()


asyncio.run(serve(*map(float, sys.argv[1:])))

"""A TCP relay that delays: `python relay.py LISTEN_HOST TO_HOST TO_PORT`; prints the port that it listens on.

What comes in at either end goes out at the other 5 to 7 ms later, by lot, and in order.
"""

import asyncio
import random
import sys

DELAY_S, JITTER_S = 0.005, 0.002


async def forward(reader, writer):
    """One direction of one connection."""
    loop, rng = asyncio.get_running_loop(), random.Random(1)  # noqa: S311 -- no secrets, but delays
    due = 0.0
    try:
        while octets := await reader.read(1 << 16):
            due = max(due, loop.time() + DELAY_S + rng.uniform(0, JITTER_S))
            loop.call_at(due, writer.write, octets)
    finally:
        loop.call_at(max(due, loop.time()), writer.close)


async def main(host, to_host, to_port):
    """Relay until killed."""

    async def accept(reader, writer):
        there, back = await asyncio.open_connection(to_host, to_port)
        await asyncio.gather(forward(reader, back), forward(there, writer), return_exceptions=True)

    server = await asyncio.start_server(accept, host, 0)
    sys.stdout.write(f"{server.sockets[0].getsockname()[1]}\n")
    sys.stdout.flush()
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], sys.argv[2], int(sys.argv[3])))

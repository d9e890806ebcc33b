"""A bare uvicorn ASGI application that responds with fixed bytes, as the baseline for the robot's response times.

``python bare.py ANSWERS.json`` serves ``{"/path": {"status": …, "headers": [[name, value], …], "body": …}, …}`` and
prints its port. With ``--count`` it prints at the end how many requests it has served.
"""

import contextlib
import json
import socket
import sys
from pathlib import Path
from typing import Any

import uvicorn


def application(answers: dict[str, Any]) -> Any:
    """Return an ASGI application that looks up the path and sends the fixed response."""
    messages = {
        path: (
            {
                "type": "http.response.start",
                "status": answer["status"],
                "headers": [(name.encode(), value.encode()) for name, value in answer["headers"]],
            },
            {"type": "http.response.body", "body": answer["body"].encode()},
        )
        for path, answer in answers.items()
    }

    async def bare(scope: Any, _receive: Any, send: Any) -> None:
        start, body = messages[scope["path"]]
        await send(start)
        await send(body)

    return bare


class Counting:
    """An application that counts its requests."""

    def __init__(self, inner: Any) -> None:
        self.inner, self.count = inner, 0

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Count a request and respond to it."""
        self.count += 1
        await self.inner(scope, receive, send)


def main(path: str, *options: str) -> None:
    """Serve until killed."""
    serving = application(json.loads(Path(path).read_text()))
    if options:
        serving = Counting(serving)
    listener = socket.create_server(("127.0.0.1", 0))
    print(listener.getsockname()[1], flush=True)
    config = uvicorn.Config(
        serving,
        loop="uvloop",
        http="httptools",
        ws="none",
        lifespan="off",
        interface="asgi3",
        access_log=False,
        log_config=None,
        server_header=False,
    )
    with contextlib.suppress(KeyboardInterrupt):
        uvicorn.Server(config).run(sockets=[listener])
    if options:
        print(serving.count, flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])

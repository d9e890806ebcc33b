"""The yardstick: a bare uvicorn ASGI application that answers fixed bytes.

``python bare.py ANSWERS.json`` serves ``{"/path": {"status": …, "headers": [[name, value], …], "body": …}, …}`` and
prints its port.
"""

import json
import socket
import sys
from pathlib import Path
from typing import Any

import uvicorn


def application(answers: dict[str, Any]) -> Any:
    """Return the application: one lookup, two messages."""
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


def main(path: str) -> None:
    """Serve until killed."""
    listener = socket.create_server(("127.0.0.1", 0))
    print(listener.getsockname()[1], flush=True)
    config = uvicorn.Config(
        application(json.loads(Path(path).read_text())),
        loop="uvloop",
        http="httptools",
        ws="none",
        lifespan="off",
        interface="asgi3",
        access_log=False,
        log_config=None,
        server_header=False,
    )
    uvicorn.Server(config).run(sockets=[listener])


if __name__ == "__main__":
    main(sys.argv[1])

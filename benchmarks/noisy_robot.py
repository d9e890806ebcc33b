"""A robot whose noise is made: `python noisy_robot.py SEED SHIFT`; prints its port. For `calibration.py`.

It answers the pose over REST and over SOAP after a time that is log-normal about a level which wanders as a first-order
autoregressive series, as a shared machine's does; over SOAP the time is multiplied by SHIFT.
"""

import asyncio
import json
import math
import random
import sys
import time

LEVEL_S = 0.006
FAST, DRIFT, MEMORY_S = 0.2, 0.1, 2.0  # standard deviations on the logarithmic scale; how long the level remembers

_AXES = {"x": 0.0, "y": 0.0, "z": 0.0}
_POSE = {
    "header": {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "odom"},
    "child_frame_id": "base_link",
    "pose": {"pose": {"position": _AXES, "orientation": _AXES | {"w": 1.0}}, "covariance": [0.0] * 36},
    "twist": {"twist": {"linear": _AXES, "angular": _AXES}, "covariance": [0.0] * 36},
}


def _xml(name: str, value: object) -> str:
    if isinstance(value, dict):
        return f"<{name}>{''.join(_xml(key, inner) for key, inner in value.items())}</{name}>"
    if isinstance(value, list):
        return "".join(_xml(name, inner) for inner in value)
    return f"<{name}>{value}</{name}>"


_REST = ("application/json", json.dumps(_POSE).encode())
_SOAP = (
    "text/xml",
    (
        '<S:Envelope xmlns:S="http://schemas.xmlsoap.org/soap/envelope/"><S:Body>'
        f'<n:GetPoseResponse xmlns:n="http://soap.turtlebot.mybot.org/">{_xml("return", _POSE)}</n:GetPoseResponse>'
        "</S:Body></S:Envelope>"
    ).encode(),
)


class Robot:
    """The server's state: the level, and when it was looked at last."""

    def __init__(self, seed: int, shift: float) -> None:
        self._lot = random.Random(seed)  # noqa: S311 -- noise, no secret
        self._shift = shift
        self._level = self._lot.gauss(0.0, DRIFT)
        self._at = time.monotonic()

    def takes_s(self, *, soap: bool) -> float:
        """How long the next answer takes."""
        now = time.monotonic()
        kept = math.exp(-(now - self._at) / MEMORY_S)
        self._level = kept * self._level + math.sqrt(1 - kept * kept) * self._lot.gauss(0.0, DRIFT)
        self._at = now
        return LEVEL_S * math.exp(self._level + self._lot.gauss(0.0, FAST)) * (self._shift if soap else 1.0)

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer one connection's requests."""
        try:
            while True:
                head = await reader.readuntil(b"\r\n\r\n")
                soap = head.startswith(b"POST")
                if soap:
                    length = head.lower().split(b"content-length:", 1)[1].split(b"\r\n", 1)[0]
                    await reader.readexactly(int(length))
                await asyncio.sleep(self.takes_s(soap=soap))
                kind, body = _SOAP if soap else _REST
                writer.write(
                    f"HTTP/1.1 200 OK\r\nContent-Type: {kind}\r\nContent-Length: {len(body)}\r\n\r\n".encode() + body
                )
        except (asyncio.IncompleteReadError, ConnectionError):
            writer.close()


async def main() -> None:
    """Serve until killed."""
    server = await asyncio.start_server(Robot(int(sys.argv[1]), float(sys.argv[2])).serve, "127.0.0.1", 0)
    print(server.sockets[0].getsockname()[1], flush=True)
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main())

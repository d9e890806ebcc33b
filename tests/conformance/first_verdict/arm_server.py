"""An arm's server that is lost after one request: ``python arm.py PORT HOW PIDFILE``; a run in a process of its own."""

import asyncio
import os
import signal
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from aiohttp import web
from small_device import Handle, application, described, error, reading

_ARRAY = {"type": "array", "items": {"type": "number"}, "minItems": 6, "maxItems": 6}
_NUMBER = {"name": "z", "in": "query", "schema": {"type": "number"}}
_INDEX = {"name": "index", "in": "query", "schema": {"type": "integer"}}
DESCRIPTION = described(
    {
        "/joints": reading(_ARRAY, parameters=[_INDEX]),
        "/pose": reading({"type": "object", "required": ["z"]}, parameters=[_NUMBER]),
        "/speed": reading({"type": "integer"}),
    }
)
# What no arm reaches.
_FAR = 1e100


class Arm:
    """The device, which is lost in one of several ways, or in none ("well")."""

    def __init__(self, how: str) -> None:
        self.how = how
        self.least_index = 0
        self.is_poisoned = False
        self.sites: list[web.TCPSite] = []

    async def joints(self, request: web.Request) -> web.Response:
        """Answer six angles."""
        if self.how == "first":
            os._exit(1)
        try:
            self.least_index = min(self.least_index, int(request.query.get("index", "0")))
        except ValueError:
            return error(400, "index is no integer")
        return web.json_response([0.0] * 6)

    async def pose(self, request: web.Request) -> web.Response:
        """Answer the height asked for; a value that no arm reaches is one too many for some."""
        try:
            z = float(request.query.get("z", "0"))
        except ValueError:
            return error(400, "z is no number")
        if self.how == "sequence" and self.least_index < 0:
            os._exit(1)
        if abs(z) > _FAR and self.how != "well":
            await self._lost()
        if self.is_poisoned:
            return error(500, "the controller is in an error state")
        return web.json_response({"z": z}) if abs(z) < _FAR else error(400, "z is out of reach")

    async def speed(self, _: web.Request) -> web.Response:
        """Answer what is no integer, so that the run has found something else before or after the loss."""
        return error(500, "error state") if self.is_poisoned else web.json_response(1 if self.how == "well" else "fast")

    async def _lost(self) -> None:
        if self.how == "exit":
            os._exit(1)
        if self.how == "hang":
            signal.pause()
        if self.how == "deaf":
            for site in self.sites:
                await site.stop()
            await asyncio.Event().wait()
        self.is_poisoned = self.how == "poison"

    @property
    def routes(self) -> Mapping[str, Mapping[str, Handle]]:
        """The handlers by path and method."""
        return {"/joints": {"GET": self.joints}, "/pose": {"GET": self.pose}, "/speed": {"GET": self.speed}}


async def serve(port: int, how: str) -> None:
    """Serve until the end of the process."""
    arm = Arm(how)
    runner = web.AppRunner(application(DESCRIPTION, arm.routes), access_log=None)
    await runner.setup()
    while not arm.sites:
        site = web.TCPSite(runner, "127.0.0.1", port, reuse_address=True)
        with suppress(OSError):  # the process before still has the port
            await site.start()
            arm.sites.append(site)
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    await asyncio.Event().wait()


def main(port: str, how: str, pid_file: str) -> None:
    """End the process that was the device before, and be the device."""
    path = Path(pid_file)
    if path.exists():
        with suppress(ProcessLookupError):
            os.kill(int(path.read_text()), signal.SIGKILL)
    path.write_text(str(os.getpid()))
    asyncio.run(serve(int(port), how))


if __name__ == "__main__":
    main(*sys.argv[1:])

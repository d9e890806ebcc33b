"""A robot on Flask behind gunicorn, one process with threads because its state is in memory.

Flask redirects paths without their final slash or with two slashes in a row; gunicorn, with its defaults, rejects
malformed requests with its own error pages. gunicorn accepts request lines of 4,094 bytes, and treats a chunked request
whose client vanished as complete: `web-server/target-length` and `safety/client-vanished`, both SHOULD, warn of that.
The robot conforms all the same.
"""

import subprocess
import sys
from collections.abc import Callable

from proof.table1.independent_robots.routing import bound

_THREADS = 16


def serve(rest_port: int, _soap_port: int) -> tuple[str, str, Callable[[], None]]:
    """Start the robot. Return REST's base URL, an empty WSDL address, and a function that stops the robot."""
    sock, rest = bound(rest_port)
    command = [sys.executable, "-P", "-m", "gunicorn", "--bind", f"fd://{sock.fileno()}", "--threads", str(_THREADS)]
    command += ["--log-level", "critical"]
    command += [f"{__name__}.application:application"]
    # This interpreter, with arguments made above.
    process = subprocess.Popen(command, pass_fds=[sock.fileno()])  # noqa: S603
    sock.close()

    def stop() -> None:
        process.terminate()
        process.wait()

    return rest, "", stop

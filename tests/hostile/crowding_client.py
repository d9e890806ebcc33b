"""A hostile client: keeps many connections to one port open, as one of the attacks in test_robot_clients.py tells.

It reads a line of JSON with the arguments of `main`, where `first` and `more` are hexadecimal. It opens `count`
connections from `address`, sends `first` on each, and then `more` on each, five times a second. It replaces what the
robot closes, and prints "up" after each round.
"""

import contextlib
import json
import resource
import socket
import ssl
import sys
import time


def main(port: int, count: int, address: str, first: bytes, more: bytes, *, tls: bool, reads: bool) -> None:
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    connections: list[socket.socket] = []
    while True:
        until = time.monotonic() + 1.5  # a robot that accepts no more must not keep this client from dripping
        while len(connections) < count and time.monotonic() < until:
            with contextlib.suppress(OSError):
                connection = socket.create_connection(("127.0.0.1", port), 1, (address, 0))
                if tls:
                    connection = context.wrap_socket(connection)
                connection.setblocking(False)
                connections.append(connection)
                connection.send(first)
        connections = [one for one in connections if is_alive(one, more, reads=reads)]
        sys.stdout.write("up\n")
        sys.stdout.flush()
        time.sleep(0.2)


def is_alive(connection: socket.socket, more: bytes, *, reads: bool) -> bool:
    """Send more; return whether the robot keeps the connection."""
    try:
        if more:
            connection.send(more)
        if reads and connection.recv(65536) == b"":
            connection.close()
            return False
    except (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
        return True
    except OSError:
        connection.close()
        return False
    return True


if __name__ == "__main__":
    told = json.loads(sys.stdin.readline())
    main(**told | {"first": bytes.fromhex(told["first"]), "more": bytes.fromhex(told["more"])})

"""A robot that answers the contract's calls and misbehaves on demand: `python toy_robot.py [--option value]…`.

Prints `ready PORT`. With --tls CERT KEY it speaks https; --host ::1 takes IPv6.
"""

import argparse
import asyncio
import gzip
import json
import os
import ssl
import sys
import time

NAMESPACE = "http://soap.turtlebot.mybot.org/"
COVARIANCE = [0.0] * 36
AXES = {"x": 0.0, "y": 0.0, "z": 0.0}
ODOMETRY = {
    "header": {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "odom"},
    "child_frame_id": "base_link",
    "pose": {"pose": {"position": AXES, "orientation": AXES | {"w": 1.0}}, "covariance": COVARIANCE},
    "twist": {"twist": {"linear": AXES, "angular": AXES}, "covariance": COVARIANCE},
}


def xml(name, value):
    if isinstance(value, dict):
        return f"<{name}>{''.join(xml(key, inner) for key, inner in value.items())}</{name}>"
    if isinstance(value, list):
        return "".join(xml(name, inner) for inner in value)
    return f"<{name}>{value}</{name}>"


def envelope(body):
    return (
        '<?xml version="1.0"?><S:Envelope xmlns:S="http://schemas.xmlsoap.org/soap/envelope/">'
        f"<S:Body>{body}</S:Body></S:Envelope>"
    ).encode()


FAULT = envelope("<S:Fault><faultcode>S:Server</faultcode><faultstring>out of coffee</faultstring></S:Fault>")
POSE = envelope(f'<n:GetPoseResponse xmlns:n="{NAMESPACE}">{xml("return", ODOMETRY)}</n:GetPoseResponse>')
SHORT_POSE = envelope(f'<n:GetPoseResponse xmlns:n="{NAMESPACE}">{xml("return", {"x": 1})}</n:GetPoseResponse>')


class Robot:
    def __init__(self, options):
        self.options = options
        self.count = 0
        self.begun = 0.0

    async def answer(self, method, target, headers, body):  # noqa: PLR0911 -- one for each way to answer
        options = self.options
        self.count += 1
        if options.token and headers.get("authorization") != f"Bearer {options.token}":
            return 401, b"who are you?", "text/plain"
        if options.prefix:
            if not target.startswith(options.prefix):
                return 404, b"not below the prefix", "text/plain"
            target = target[len(options.prefix) :]
        if options.redirect:
            return 307, b"", "text/plain"
        hangs = options.hang_every and not self.count % options.hang_every
        if hangs or options.delay:
            await asyncio.sleep(3600 if hangs else options.delay)
        if method == "POST":
            return self.soap(body)
        if target == "/count":
            return 200, str(self.count).encode(), "text/plain"
        if target == "/robot/pose/":
            return 200, json.dumps(ODOMETRY).encode(), "application/json"
        if target.startswith("/robot/app/delivery/") and method == "PUT":
            return (503, b"tired", "text/plain") if self.options.fault else (204, b"", "")
        return 404, b"no such resource", "text/plain"

    def soap(self, body):
        if self.options.fault:
            return 500, FAULT, "text/xml"
        if b"GetPose" in body:
            return 200, SHORT_POSE if self.options.short else POSE, "text/xml"
        name = "ExecuteCoffeeRequest" if b"ExecuteCoffeeRequest" in body else "ExecuteDeliveryRequest"
        return 200, envelope(f'<n:{name}Response xmlns:n="{NAMESPACE}"/>'), "text/xml"

    async def serve(self, reader, writer):
        try:
            while await self.one(reader, writer):
                pass
        except (ConnectionError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            pass
        finally:
            writer.close()

    async def one(self, reader, writer):
        options = self.options
        if options.idle:
            try:
                head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), options.idle)
            except TimeoutError:
                return False
        else:
            head = await reader.readuntil(b"\r\n\r\n")
        lines = head.decode("latin-1").split("\r\n")
        method, target, _ = lines[0].split(" ")
        headers = {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in lines[1:-2])}
        body = await reader.readexactly(int(headers.get("content-length", 0)))
        begun = time.monotonic()
        if options.stall_at and self.begun and 0 <= begun - self.begun - options.stall_at < options.stall:
            left = options.stall - (begun - self.begun - options.stall_at)
            time.sleep(left)  # noqa: ASYNC251 -- the whole robot stands still
        if self.count == options.ready_after:
            self.begun = time.monotonic()
        if options.die_after and self.count >= options.die_after:
            os._exit(1)
        if target.endswith("/hang-up"):
            self.count += 1
            return False
        time.sleep(options.busy)  # noqa: ASYNC251 -- the whole robot is busy: it answers 1 / busy a second
        status, content, kind = await self.answer(method, target, headers, body)
        return await self.write(writer, status, content, kind)

    async def write(self, writer, status, content, kind):
        form = self.options.form
        timing = "" if self.options.silent else "Server-Timing: app;dur=0.015\r\n"
        location = "Location: http://elsewhere.invalid/robot/pose/\r\n" if 300 <= status < 400 else ""
        head = f"{timing}{location}Server: toy/1\r\n" + (f"Content-Type: {kind}\r\n" if kind else "")
        if form == "gzip":
            content, head = gzip.compress(content), f"{head}Content-Encoding: gzip\r\n"
        if form == "garbage":
            writer.write(b"hello\r\n\r\n")
        elif form == "cut":
            writer.write(f"HTTP/1.1 {status} X\r\n{head}Content-Length: {len(content) + 9}\r\n\r\n".encode() + content)
            await writer.drain()
            return False
        elif form == "old":
            writer.write(f"HTTP/1.0 {status} X\r\n{head}\r\n".encode() + content)
            await writer.drain()
            return False
        elif form == "chunked" and content:
            half = len(content) // 2
            writer.write(
                f"HTTP/1.1 100 Continue\r\n\r\nHTTP/1.1 {status} X\r\n{head}Transfer-Encoding: chunked\r\n\r\n".encode()
            )
            for part in (content[:half], content[half:]):
                writer.write(f"{len(part):x}\r\n".encode() + part + b"\r\n")
                await writer.drain()
                await asyncio.sleep(0.001)
            writer.write(b"0\r\n\r\n")
        elif form == "drip":
            writer.write(f"HTTP/1.1 {status} X\r\n{head}Content-Length: 1000\r\n\r\n".encode())
            for _ in range(1000):
                writer.write(b"x")
                await writer.drain()
                await asyncio.sleep(0.05)
        else:
            length = "" if status == 204 else f"Content-Length: {len(content)}\r\n"
            writer.write(f"HTTP/1.1 {status} X\r\n{head}{length}\r\n".encode() + content)
        await writer.drain()
        return True


async def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--tls", nargs=2)
    parser.add_argument("--delay", type=float, default=0.0)
    parser.add_argument("--busy", type=float, default=0.0)
    parser.add_argument("--stall", type=float, default=0.0)
    parser.add_argument("--stall-at", type=float, default=0.0)
    parser.add_argument("--ready-after", type=int, default=20)
    parser.add_argument("--die-after", type=int, default=0)
    parser.add_argument("--hang-every", type=int, default=0)
    parser.add_argument("--idle", type=float, default=0.0)
    parser.add_argument("--form", default="")
    parser.add_argument("--prefix", default="")
    parser.add_argument("--token", default="")
    for flag in ("--fault", "--short", "--redirect", "--silent"):
        parser.add_argument(flag, action="store_true")
    options = parser.parse_args()
    context = None
    if options.tls:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(*options.tls)
    server = await asyncio.start_server(Robot(options).serve, options.host, 0, ssl=context)
    sys.stdout.write(f"ready {server.sockets[0].getsockname()[1]}\n")
    sys.stdout.flush()
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main())

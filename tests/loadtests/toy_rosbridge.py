"""A small rosbridge by the published v2 protocol (ROSBRIDGE_PROTOCOL.md, section 3.2), with a ROS graph of its own.

`python toy_rosbridge.py [--hz N] [--delay S] [--refuse TEXT] [--deaf]`. Prints `ready PORT`. What is published reaches
every client that subscribes to the topic, after a delay; odometry is published N times a second.
"""

import argparse
import asyncio
import json
import sys
from collections import defaultdict

from toy_robot import ODOMETRY
from websockets.asyncio.server import broadcast, serve
from websockets.exceptions import ConnectionClosed

DELIVERY = {"message_code", *(f"{place}_{axis}" for place in ("depot", "destination", "source") for axis in "xy")}


class Bridge:
    def __init__(self, options):
        self.options = options
        self.advertised = defaultdict(dict)  # client: topic: type
        self.subscribed = defaultdict(lambda: defaultdict(set))  # topic: client: ids

    async def publish(self, topic, message):
        await asyncio.sleep(self.options.delay)
        if not self.options.deaf:
            broadcast(self.subscribed[topic], json.dumps({"op": "publish", "topic": topic, "msg": message}))

    async def odometry(self):
        while True:
            await asyncio.sleep(1 / self.options.hz)
            await self.publish("/odom", ODOMETRY)

    def handle(self, client, message):
        """Do what a client says; returns what is wrong with it, if anything."""
        op, topic, name = message["op"], message.get("topic"), message.get("id")
        if op == "advertise":
            self.advertised[client][topic] = message["type"]
        elif op == "subscribe":
            self.subscribed[topic][client].add(name)
        elif op == "unsubscribe":
            ids = self.subscribed[topic].get(client, set())
            ids.discard(name)
            if not ids or name is None:
                self.subscribed[topic].pop(client, None)
        elif op == "publish":
            if self.options.refuse:
                return self.options.refuse
            if topic not in self.advertised[client]:
                return f"{topic} is not advertised"
            if set(message["msg"]) != DELIVERY:
                return f"{sorted(message['msg'])} are not the fields of {self.advertised[client][topic]}"
            asyncio.ensure_future(self.publish(topic, message["msg"]))  # noqa: RUF006 -- the loop runs until killed
        else:
            return f"unknown operation {op}"
        return None

    async def serve(self, client):
        try:
            async for text in client:
                wrong = self.handle(client, json.loads(text))
                if wrong:
                    await client.send(json.dumps({"op": "status", "level": "error", "msg": wrong}))
        except ConnectionClosed:
            pass
        finally:
            for clients in self.subscribed.values():
                clients.pop(client, None)


async def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--hz", type=float, default=50.0)
    parser.add_argument("--delay", type=float, default=0.0)
    parser.add_argument("--refuse", default="")
    parser.add_argument("--deaf", action="store_true")
    bridge = Bridge(parser.parse_args())
    async with serve(bridge.serve, "127.0.0.1", 0) as server:
        sys.stdout.write(f"ready {server.sockets[0].getsockname()[1]}\n")
        sys.stdout.flush()
        await bridge.odometry()


if __name__ == "__main__":
    asyncio.run(main())

"""Which clients give way when a port, or an address's share of it, is full."""

import ipaddress
import math

import pytest
from web_protocol import closed, request, runs, statuses

from reference_robot.webservices.http.crowd import Crowd, address_of
from reference_robot.webservices.http.hosts import TrustedProxies


class Waiting:
    def __init__(self, since, allowed=60.0, *, is_known=False):
        self.since, self.allowed, self.is_known, self.is_gone = since, allowed, is_known, False
        self.answered = since

    def give_way(self):
        self.is_gone = True

    expire = stop = abort = give_way


BUSY = math.inf
# (tokens are required, clients as (address, since, allowed, known), address of the new client, the one that gives way)
CASES = {
    "the longest idle": (False, [("a", 5, 60, True), ("a", 3, 60, True), ("a", 4, 60, False)], "b", 1),
    "not who was just served": (False, [("a", 9.5, 60, True), ("a", 9.9, 60, True), ("a", 9.8, 60, True)], "a", None),
    "not who is being served": (False, [("a", 1, BUSY, True), ("a", 1, BUSY, True), ("a", 2, 60, True)], "a", 2),
    "all are being served": (False, [("a", 1, BUSY, True)] * 3, "a", None),
    "an address with far more": (False, [("a", 1, BUSY, True), ("a", 9.9, 60, True), ("a", 9.8, 60, True)], "b", 2),
    "first who has no token": (True, [("a", 1, 60, True), ("b", 9, 5, False), ("a", 2, 60, True)], "c", 1),
    "tokens alone": (True, [("a", 3, 60, True), ("a", 1, 60, True), ("a", 2, 60, True)], "b", 1),
    "never a used token": (True, [("a", 1, BUSY, True), ("a", 9.9, 60, True), ("a", 9.8, 60, True)], "b", None),
    "the address with most": (False, [("a", 1, 60, True), ("b", 2, 60, True), *[("b", 3, 60, True)] * 4], "c", 1),
}


@pytest.mark.parametrize(("guarded", "clients", "address", "gone"), CASES.values(), ids=CASES)
def test_who_gives_way(guarded, clients, address, gone):
    crowd = Crowd(len(clients), len(clients), is_guarded=guarded)
    waiting = [Waiting(since, allowed, is_known=known) for _, since, allowed, known in clients]
    for client, (its_address, *_) in zip(waiting, clients, strict=True):
        crowd.add(client, its_address)

    assert crowd.has_place_for(address, 10.0) == (gone is not None)

    assert [number for number, client in enumerate(waiting) if client.is_gone] == ([] if gone is None else [gone])


def test_half_a_request_gives_way_however_new_it_is():
    crowd, half = Crowd(1, 1, is_guarded=False), Waiting(9.9, is_known=True)
    half.answered = -math.inf
    crowd.add(half, "a")
    assert crowd.has_place_for("a", 10.0)
    assert half.is_gone


def test_an_address_beyond_its_share_loses_its_own_connections():
    crowd = Crowd(100, 2, is_guarded=False)
    clients = [Waiting(one) for one in range(4)]
    for client, address in zip(clients, "baab", strict=True):
        crowd.add(client, address)
    assert crowd.has_place_for("c", 10.0)
    assert not any(client.is_gone for client in clients)
    assert crowd.has_place_for("a", 10.0)
    assert [client.is_gone for client in clients] == [False, True, False, False]


@pytest.mark.parametrize(
    ("one", "other", "is_same"),
    [
        ("127.0.0.1", "127.0.0.1", True),
        ("127.0.0.1", "127.0.0.2", False),
        ("::ffff:192.0.2.1", "192.0.2.1", True),
        ("::ffff:192.0.2.1", "::ffff:192.0.2.2", False),
        ("2001:db8::1", "2001:db8::ffff:1", True),
        ("2001:db8::1", "2001:db8:0:1::1", False),
        ("fe80::1%eth0", "fe80::2%eth0", True),
    ],
)
def test_ipv6_addresses_count_by_network(one, other, is_same):
    assert (address_of((one, 1)) == address_of((other, 2))) == is_same


@runs(connections=8, of_address=2)
async def test_an_address_has_a_share(robot):
    first, writer = await robot.connect()
    second, other = await robot.connect()
    async with robot.talk(request()) as (reader, _):
        assert await closed(first) == b""
        assert statuses(await reader.readuntil(b"\r\n\r\n")) == [200]
    assert not second.at_eof()
    for each in (writer, other):
        each.close()


@runs(connections=8, of_address=2)
async def test_the_connections_of_a_trusted_proxy_are_not_counted_together(robot):
    robot.port.proxies = TrustedProxies([ipaddress.ip_network("127.0.0.0/8")])
    kept = [await robot.connect() for _ in range(6)]
    for reader, writer in kept:
        writer.write(request())
        assert statuses(await reader.readuntil(b"\r\n\r\n")) == [200]
        writer.close()

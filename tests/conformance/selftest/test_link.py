"""A relay hands on every octet, in its order, as late as its link has it."""

import itertools
import socket
import time
from dataclasses import replace

import pytest

from conformance.contract.pack import Contract
from proof.selftest.controls import VARIANTS, Case, run_controls
from proof.selftest.link import LINKS, Direction, Link, link_to
from proof.table1.selftest import PLAIN

WIFI, FAR, OUTAGE = LINKS
NEVER = (float("inf"), float("inf"))
QUICK = Link("quick", "a little later", (0.02, 0.03))


def arrivals(link, seed, *, count=5000, every=0.01, octets=1000, outage=NEVER):
    direction = Direction(link, seed, outage)
    return [direction.arrival(number * every, octets) for number in range(count)]


def test_one_seed_gives_one_link():
    assert arrivals(WIFI, "1") == arrivals(WIFI, "1") != arrivals(WIFI, "2")


@pytest.mark.parametrize("link", LINKS, ids=lambda link: link.name)
def test_segments_keep_their_order_and_none_comes_too_soon(link):
    came = arrivals(link, "1", every=0.001)
    assert all(one <= other for one, other in itertools.pairwise(came))
    assert all(at >= number * 0.001 + link.delay_s[0] for number, at in enumerate(came))


def test_one_segment_in_a_hundred_is_late():
    took = [at - number for number, at in enumerate(arrivals(WIFI, "1", every=1.0))]
    late = [one for one in took if one > WIFI.delay_s[1] + 0.01]
    assert 30 < len(late) < 70
    assert max(late) < WIFI.delay_s[1] + WIFI.late_s + 0.01


def test_a_link_is_as_wide_as_it_is():
    came = arrivals(replace(QUICK, octets_per_s=1e6), "1", every=0.0, octets=1000)
    assert came[-1] == pytest.approx(5.0, abs=0.04)


def test_nothing_passes_in_an_outage():
    came = arrivals(OUTAGE, "1", count=500, outage=(1.0, 3.0))
    assert [at for at in came if 1.01 < at < 3.0] == []
    assert came[-1] == pytest.approx(5.0, abs=0.01)


@pytest.fixture
def target():
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(60)
        yield server


@pytest.fixture
def ends(target):
    """Both ends of one connection over a link."""
    with link_to(QUICK, 1, target.getsockname()) as (address,), socket.create_connection(address, timeout=30) as client:
        robot, _ = target.accept()
        robot.settimeout(60)
        with robot:
            yield client, robot


def received(sock):
    return b"".join(iter(lambda: sock.recv(65536), b""))


def test_octets_pass_in_both_directions_and_each_end_is_handed_on(ends):
    client, robot = ends
    octets = bytes(range(256)) * 400
    started = time.monotonic()
    client.sendall(octets)
    client.shutdown(socket.SHUT_WR)
    assert received(robot) == octets
    assert time.monotonic() - started >= QUICK.delay_s[0]
    robot.sendall(octets[::-1])
    robot.shutdown(socket.SHUT_WR)
    assert received(client) == octets[::-1]


def test_a_reset_is_handed_on(ends):
    client, robot = ends
    robot.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    robot.close()
    with pytest.raises(ConnectionResetError):
        client.recv(1)


def _port_kept_by(deaf):
    deaf.bind(("127.0.0.1", 0))
    return deaf.getsockname()


def test_where_nobody_listens_the_connection_is_broken_off():
    with (
        socket.socket() as deaf,  # it keeps its port, which another test's server could get otherwise
        link_to(QUICK, 1, _port_kept_by(deaf)) as (address,),
        socket.create_connection(address, timeout=30) as client,
        pytest.raises(ConnectionResetError),
    ):
        client.recv(1)


def test_a_good_robot_behind_a_link_is_no_false_positive():
    variant = next(one for one in VARIANTS if one.link is WIFI)
    few = ("http/reachable", "http/content-type", "rest-delivery/put", "describe/wsdl-address")
    (result,) = run_controls(Contract.load(), [Case(PLAIN, variant)], tell=lambda _: None, requirements=few)
    assert result.conformant, result.false_positives

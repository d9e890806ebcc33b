import threading
import time
from contextlib import closing
from dataclasses import replace

import pytest
from toy_body import interface_of
from toy_messages import STILL, ZERO, exchange
from toy_server import serving

from conformance.api.rest.interface import RestInterface
from conformance.observe.polling import poll_for
from conformance.packs.table1.limits import DeclaredLimits
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.drive_trace import Command
from conformance.packs.table1.robot.renewing import Renewing, renewed
from conformance.packs.table1.robot.robot import LINEAR, Robot, Velocity
from conformance.packs.table1.robot.robot import STILL as STILL_VELOCITY
from conformance.packs.table1.statement import Statement
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Listener
from conformance.verdict.run import Run

_HOLD_S, _SLOW_S = 0.4, 0.15
_WANTED = Velocity(linear_x=0.3)


class Body:
    """A robot whose responses are slow. It holds a velocity for 0.4 s, and reaches it at once unless it is ``lame``."""

    def __init__(self) -> None:
        self.lame, self.until, self.puts = False, 0.0, 0
        self.lock = threading.Lock()

    def answer(self, method: str, path: str, _sent: bytes) -> tuple[int, object]:
        with self.lock:
            if method == "PUT":
                self.until, self.puts = time.monotonic() + _HOLD_S, self.puts + 1
            moves = time.monotonic() < self.until and not self.lame
        time.sleep(_SLOW_S)
        linear = ZERO | {"x": 0.3 if moves else 0.0}
        if method == "PUT":
            return 204, None
        return (
            (503, None)
            if path.endswith("/pose/")
            else (200, linear if "linear" in path else STILL | {"linear": linear})
        )


@pytest.fixture
def body() -> Body:
    return Body()


@pytest.fixture
def drive(body):
    with interface_of(body, linear_m_s=0.7, angular_rad_s=2.5, settle_s=0.3, hold_s=_HOLD_S) as api:
        api.run.effort = api.run.effort.seen(1000 * _SLOW_S)
        yield Drive(Robot(api))


def test_a_velocity_lasts_while_looks_outlast_it(body, drive):
    assert drive.paces
    assert drive.command(_WANTED)
    assert drive.reach(_WANTED, "rest-resources/velocity-converges")
    # Every renewal has been answered, and is in the record.
    assert sum(one.renewal for one in drive.trace.commands) == body.puts - 1 > 1


def test_a_velocity_that_is_not_reached_is_no_failure_where_renewals_may_have_come_too_late(body, drive):
    body.lame = True
    drive.command(_WANTED)
    with drive.renewing(replace(drive.trace.commands[-1], sent=-10.0)) as late:
        pass
    assert not late.lasted(drive.clock.now())


def _renewing(drive: Drive, *times: tuple[float, float]) -> Renewing:
    command = Command(_WANTED, 0.0, 0.1, exchange())
    renewing = Renewing(drive.robot, command)
    renewing.commands += [replace(command, sent=sent, answered=answered, renewal=True) for sent, answered in times]
    return renewing


def test_renewals_that_arrived_in_time_whatever_the_network_did(drive):
    assert _renewing(drive, (0.1, 0.25), (0.2, 0.35), (0.3, 0.45)).lasted(0.6)
    assert not _renewing(drive, (0.1, 0.25), (0.2, 0.35), (0.3, 0.45)).lasted(0.8)
    # The second may have arrived when the velocity had ended.
    assert not _renewing(drive, (0.3, 0.45), (0.4, 0.55)).lasted(0.6)


def test_what_came_too_late_before_the_first_reading_does_not_matter(drive):
    renewing = _renewing(drive, (0.3, 0.45), (0.4, 0.55))
    assert renewing.lasted(0.6, 0.5)
    assert not renewing.lasted(0.6, 0.4)


def test_a_velocity_is_held_while_something_else_is_read(body, drive):
    with drive.held(_WANTED):
        assert any(body.puts > 3 for _ in poll_for(drive.clock, 0.02, 10.0))
    assert sum(one.renewal for one in drive.trace.commands) == body.puts - 1


def test_each_renewal_is_told_when_they_are_over(body, drive):
    told = []

    class Listens(Listener):
        def answered(self, exchange):
            told.append(exchange.request.method)

    drive.robot.rest.connection.listeners.append(Listens())
    with drive.held(_WANTED):
        assert any(body.puts > 3 for _ in poll_for(drive.clock, 0.02, 10.0))
    assert told.count("PUT") == body.puts


def test_no_renewal_goes_on_where_not_all_could_be_begun(drive):
    renewing = _renewing(drive)
    threads = vars(renewing)["_threads"]
    threads[-1].start()  # its second start fails
    with pytest.raises(RuntimeError), renewing:
        pass
    for one in threads:
        one.join(60)
    assert not any(one.is_alive() for one in threads)


def test_rest_needs_no_renewal(body, drive):
    with drive.held(STILL_VELOCITY) as lasted:
        assert lasted(drive.clock.now())
    assert body.puts == 1


class XmlBody:
    """A robot that shows and takes XML, and never moves."""

    def __init__(self) -> None:
        self.taken: list[tuple[str, bytes]] = []

    def answer(self, method: str, path: str, sent: bytes) -> tuple[int, object]:
        if method == "PUT":
            self.taken.append((path, sent))
        return 200, b"<twist><linear><x>0</x></linear></twist>"


def test_a_velocity_in_xml_is_renewed_in_xml():
    body = XmlBody()
    declared = DeclaredLimits(linear_m_s=0.7, angular_rad_s=2.5, settle_s=0.3)
    with serving(body.answer, "application/xml") as url, closing(HttpClient(url, Connection())) as client:
        drive = Drive(Robot(RestInterface(Run(statement=Statement(declared=declared), allow_motion=True), client)))
        drive.command_linear(_WANTED, xml=True)
        drive.trace = drive.trace.commanded(renewed(drive.robot, drive.trace.commands[-1]))
    first, again = body.taken
    assert first == again == (LINEAR, first[1])
    assert b"<x>0.3</x>" in first[1]
    assert [one.renewal for one in drive.trace.commands] == [False, True]

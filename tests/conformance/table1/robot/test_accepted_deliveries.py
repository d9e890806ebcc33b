"""The robot's list is judged by every delivery that the robot has accepted."""

import json
from itertools import count

import pytest

from conformance.api.rest.interface import RestInterface
from conformance.api.soap.envelope import envelope
from conformance.packs.table1.checkers.deliveries import Deliveries
from conformance.packs.table1.robot.delivery import Delivery
from conformance.packs.table1.robot.robot import DELIVERIES
from conformance.packs.table1.robot.soap_services import delivery
from conformance.packs.table1.statement import Statement
from conformance.transport.client import Connection, HttpClient
from conformance.transport.exchange import Exchange, Request, Response
from conformance.verdict.evidence import CheckerListener
from conformance.verdict.run import Run

_BASE = "http://robot:7003"
_BLAMED = {"rest-delivery/list", "equivalence/delivery-rest"}


class Robot:
    """A robot with a list of its last 50 deliveries, whose clock counts deliveries."""

    def __init__(self, *earlier: Delivery) -> None:
        self.api = RestInterface(Run(statement=Statement()), HttpClient(_BASE, Connection()))
        self.observer = CheckerListener(self.api.run.judge, [Deliveries(self.api.client.url, has_probe=False)])
        self.stamps, self._listed, self._now = count(), [], 100.0
        for one in earlier:
            self.hold(one)
        self.show()

    def hold(self, one: Delivery, interface: str = "rest") -> None:
        entry = {"request": one._asdict(), "state": "done", "accepted": {"sec": next(self.stamps), "nanosec": 0}}
        self._listed = [entry | {"interface": interface}, *self._listed][:50]

    def put(self, one: Delivery, held: Delivery | None, status: int = 204) -> None:
        """Accept a delivery, and hold another one in its place."""
        if held is not None:
            self.hold(held)
        self._answered(Request("PUT", f"{_BASE}{one.rest_path}"), Response(status, (), b"", 1.0))

    def change(self, which: int) -> None:
        """Show another value in an entry from now on."""
        entry = self._listed[which]
        self._listed[which] = entry | {"request": entry["request"] | {"source_y": 0.75}}

    def show(self, after_s: float = 10.0, media_type: str = "application/json") -> None:
        """Show the list; JSON is YAML as well."""
        self._now += after_s
        request = Request("GET", f"{_BASE}{DELIVERIES}")
        shown = self._xml() if media_type == "application/xml" else json.dumps(self._listed).encode()
        self._answered(request, Response(200, (("Content-Type", media_type),), shown, 1.0))

    def _xml(self) -> bytes:
        """Return the list with numbers in the notation of another program: without a fraction if they need none."""

        def written(name: str, value: object) -> str:
            if isinstance(value, dict):
                value = "".join(written(*item) for item in value.items())
            return f"<{name}>{f'{value:g}' if isinstance(value, float) else value}</{name}>"

        return written("deliveries", {f"item{number}": one for number, one in enumerate(self._listed)}).encode()

    def _answered(self, request: Request, response: Response) -> None:
        self._now += 0.01
        object.__setattr__(response, "received_s", self._now)
        self.observer.on_response(Exchange(request, response))

    def coffee(self, **held: float) -> None:
        """Accept the paper's coffee over SOAP, and hold it with some values replaced."""
        body = envelope([delivery("ExecuteCoffeeRequest")]).serialize()
        self.hold(_COFFEE._replace(**held), "soap")
        self._answered(Request("POST", f"{_BASE}/publisher", (), body), Response(200, (), b"", 1.0))

    @property
    def blamed(self) -> set[str]:
        return set(self.api.run.judge.failure_counts())


def _some(number: float) -> Delivery:
    return Delivery(3, number, *[0.5] * 5)


_COFFEE = Delivery(4, 68.269, 38.718, 60.633, 37.51, 76.02, 41.35)
_FIFTY = [_some(-number) for number in range(1, 51)]


@pytest.mark.parametrize("earlier", [(), _FIFTY])
def test_a_robot_that_lists_what_it_accepts(earlier):
    robot = Robot(*earlier)
    for number in range(120):
        robot.put(_some(number % 7), _some(number % 7))
        if number % 9 == 0:
            robot.show(0.1)
    robot.coffee()
    robot.show()
    assert not robot.blamed
    assert robot.api.run.judge.of("rest-delivery/list").cases


@pytest.mark.parametrize("earlier", [(), _FIFTY])
@pytest.mark.parametrize("held", [None, _some(1.0000001)])
def test_one_that_is_lost_or_altered(earlier, held):
    robot = Robot(*earlier)
    robot.put(_some(1), held)
    for number in range(2, 9):
        robot.put(_some(number), _some(number))
    robot.show()
    assert robot.blamed == _BLAMED


def test_one_of_several_that_are_equal():
    robot = Robot(*_FIFTY)
    robot.coffee(source_x=60.633, destination_x=76.02)
    robot.coffee()
    robot.show()
    assert robot.blamed == {"rest-delivery/list", "equivalence/delivery-soap"}


def test_what_was_refused_or_may_have_been_pushed_out_is_not_looked_for():
    robot = Robot(*_FIFTY)
    robot.put(_some(1), None, 503)
    robot.put(_some(2), _some(2))
    for number in range(100, 160):
        robot.put(_some(number), _some(number))
    robot.show()
    assert not robot.blamed


def test_one_that_is_listed_a_moment_later():
    robot = Robot(*_FIFTY)
    robot.put(_some(1), None)
    robot.show(0.2)
    robot.hold(_some(1))
    robot.show()
    assert not robot.blamed


def test_one_that_is_listed_before_its_response():
    robot = Robot(*_FIFTY)
    robot.hold(_some(1))
    robot.show(0.1)
    robot.put(_some(1), None)
    robot.show()
    assert not robot.blamed


def test_a_clock_in_whole_seconds():
    robot = Robot(*_FIFTY)
    robot.stamps = iter([7] * 100)
    for _ in range(60):
        robot.put(_some(1), _some(1))
        robot.show(0.05)
    robot.show()
    assert not robot.blamed


@pytest.mark.parametrize(("held", "which", "blamed"), [(3, -1, True), (60, 20, True), (60, -1, False)])
def test_an_entry_that_changes_unless_it_may_have_been_pushed_out(held, which, blamed):
    robot = Robot(*map(_some, range(held)))
    robot.change(which)
    robot.show()
    robot.show()
    assert robot.blamed == ({"rest-delivery/list"} if blamed else set())


@pytest.mark.parametrize("media_type", ["application/xml", "text/plain"])
def test_an_entry_that_differs_in_another_format(media_type):
    robot = Robot(*map(_some, range(3)))
    robot.show(media_type=media_type)
    assert not robot.blamed
    robot.change(1)
    robot.show(media_type=media_type)
    assert robot.blamed == {"rest-formats/same-values"}

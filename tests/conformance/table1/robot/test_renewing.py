from contextlib import closing

from toy_server import serving

from conformance.api.rest.interface import RestInterface
from conformance.packs.table1.limits import DeclaredLimits
from conformance.packs.table1.robot.drive import Drive
from conformance.packs.table1.robot.robot import LINEAR, Robot, Velocity
from conformance.packs.table1.statement import Statement
from conformance.transport.client import Connection, HttpClient
from conformance.verdict.run import Run

_WANTED = Velocity(linear_x=0.3)


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
    declared = DeclaredLimits(linear_m_s=0.7, angular_rad_s=2.5, settle_s=0.3, hold_s=0.2)
    with serving(body.answer, "application/xml") as url, closing(HttpClient(url, Connection())) as client:
        drive = Drive(Robot(RestInterface(Run(statement=Statement(declared=declared), allow_motion=True), client)))
        drive.command(_WANTED, linear=True, xml=True)
        assert not drive.reach(_WANTED, "rest-resources/linear-put")
    first, *again = body.taken
    assert again
    assert {first, *again} == {(LINEAR, first[1])}
    assert b"<x>0.3</x>" in first[1]
    assert [one.renewal for one in drive.trace.commands] == [False, *(True for _ in again)]

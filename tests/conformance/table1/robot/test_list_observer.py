"""Lists over SOAP beside those over REST: what differs while REST shows one list is found, and a change is not."""

import json

import pytest

from conformance.packs.table1.checkers.lists import Lists
from conformance.packs.table1.robot.robot import SENSORS
from conformance.packs.table1.robot.soap_services import NAMESPACE
from conformance.transport.exchange import Exchange, Request, Response

_LIDAR = {"name": "lidar", "topic": "/scan", "type": "sensor_msgs/LaserScan"}
_CAMERA = {"name": "camera", "topic": "/image", "type": "sensor_msgs/Image"}


def over_rest(*entries):
    return SENSORS, "application/json", json.dumps(entries).encode()


def over_soap(*entries):
    items = "".join(
        f"<return>{''.join(f'<{name}>{value}</{name}>' for name, value in entry.items())}</return>" for entry in entries
    )
    body = f'<w:GetSensorsResponse xmlns:w="{NAMESPACE}">{items}</w:GetSensorsResponse>'
    envelope = f'<s:Envelope xmlns:s="http://schemas.xmlsoap.org/soap/envelope/"><s:Body>{body}</s:Body></s:Envelope>'
    return "/ws", "text/xml", envelope.encode()


_BOTH, _ONE = (_LIDAR, _CAMERA), (_LIDAR,)


@pytest.mark.parametrize(
    ("read", "wrong"),
    [
        ([over_rest(*_BOTH), over_soap(*_BOTH), over_rest(*_BOTH)], 0),
        ([over_rest(*_BOTH), over_soap(_CAMERA, _LIDAR), over_rest(*_BOTH)], 0),
        ([over_rest(*_BOTH), over_soap(*_ONE), over_rest(*_BOTH)], 1),
        ([over_rest(*_ONE), over_soap(_LIDAR, _LIDAR), over_rest(*_ONE)], 1),
        ([over_rest(*_BOTH), over_soap(*_ONE), over_rest(*_ONE)], 0),  # a sensor has gone
        ([over_soap(*_ONE), over_rest(*_BOTH)], 0),  # and one has come
        ([over_rest(*_BOTH), over_soap({**_LIDAR, "topic": "/scam"}, _CAMERA), over_rest(*_BOTH)], 1),
    ],
)
def test_a_list_that_differs_while_rest_s_does_not_change(read, wrong):
    found, checker = [], Lists(lambda path: f"http://r2{path}")
    for number, (path, media_type, body) in enumerate(read):
        method = "GET" if media_type == "application/json" else "POST"
        response = Response(200, (("Content-Type", media_type),), body, 1.0, received_s=number + 1.0)
        found += checker(Exchange(Request(method, f"http://r2{path}"), response))
    differ = [one for one in found if not one.holds and one.requirement.startswith("equivalence/")]
    assert len(differ) == wrong

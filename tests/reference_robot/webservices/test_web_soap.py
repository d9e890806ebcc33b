"""Messages and faults, by SOAP 1.1 and the WS-I Basic Profile 1.1; the services' descriptions."""

import pytest
import zeep
from lxml import etree
from web_messages import delivery_envelope, fault_of, query_envelope

from conformance.papers_robot.delivery import EXAMPLE


@pytest.mark.parametrize(
    ("name", "sent"),
    [
        ("depot_x", "INF"),
        ("depot_y", "-INF"),
        ("source_x", "NaN"),
        ("source_y", "1e400"),
        ("destination_x", "1e400"),
        ("destination_y", "-INF"),
        ("depot_x", "9" * 400),
        ("message_code", "5"),
        ("message_code", "+05"),
        ("message_code", "0" * 5000 + "4"),
    ],
)
def test_a_value_that_no_delivery_may_have_is_named_and_repeated(served, foreign, name, sent):
    answer = served.soap(delivery_envelope(**{name: sent}))
    assert fault_of(answer) == "Client"
    told = etree.fromstring(answer.content).findtext(".//faultstring")
    assert told.startswith(f"{name} must be ")
    assert f"not '{sent[:7]}" in told
    assert len(told) < 300
    assert foreign.heard_nothing()


def test_must_understand_is_0_or_1(served):
    header = '<s:Header><x:token xmlns:x="urn:x" s:mustUnderstand="true"/></s:Header>'
    assert fault_of(served.soap(delivery_envelope(header=header))) == "Client"


def test_zeep_calls_every_operation(served, foreign):
    publishers = zeep.Client(served.publishers + "?wsdl").service
    request = EXAMPLE | {"message_code": 3}
    publishers.ExecuteDeliveryRequest(request)
    publishers.ExecuteCoffeeRequest(request)
    assert [foreign.next("delivery")["message_code"] for _ in range(2)] == [3, 4]
    subscribers = zeep.Client(served.subscribers + "?wsdl").service
    assert len(subscribers.GetPose().pose.covariance) == 36
    assert subscribers.GetVelocity().linear.y == 0
    assert subscribers.GetSensors() in ([], None)
    assert subscribers.GetNavigationServices() in ([], None)
    with pytest.raises(zeep.exceptions.Fault, match="no goal"):
        subscribers.GetGoal()
    with pytest.raises(zeep.exceptions.Fault, match="no planner"):
        subscribers.GetPlan(x=1, y=2)


@pytest.mark.parametrize("sent", ["1e400", "9" * 400])
def test_a_plan_query_s_number_is_repeated(served, sent):
    answer = served.soap(query_envelope("GetPlan", f"<x>{sent}</x><y>1</y>"), url=served.subscribers)
    assert fault_of(answer) == "Client"
    told = etree.fromstring(answer.content).findtext(".//faultstring")
    assert told.startswith(f"x must be finite, not '{sent[:5]}")
    assert len(told) < 300

"""Which services a check may call: nothing is sent to the one that acts without permission, and that is put down."""

import pytest
from toy_server import serving

from conformance.api.soap.callable_services import SoapServices, callable_services, is_gone
from conformance.api.soap.calls import call
from conformance.api.soap.service import SoapService
from conformance.documents.xml import Node
from conformance.papers_robot.statement import CONTRACT_DIR
from conformance.transport.client import Connection, HttpClient
from conformance.verdict.run import Run

MOTION, OTHER = "soap-basic-profile/R2724", "soap-basic-profile/R1125"


def services(*, allow_motion: bool, url: str = "http://127.0.0.1:9") -> SoapServices:
    client = HttpClient(url, Connection())
    made = {
        name: SoapService(name, client, f"/{name}", contract_wsdl_path=CONTRACT_DIR / f"{name}.wsdl")
        for name in ("publishers", "subscribers")
    }
    return SoapServices(Run(allow_motion=allow_motion), **made)


def skips(soap: SoapServices, id_: str) -> list[str]:
    return soap.run.judge.evidence[id_].skips


def test_the_service_that_only_reads_comes_first():
    soap = services(allow_motion=True)
    assert [service.name for service in callable_services(soap, MOTION)] == ["subscribers", "publishers"]
    assert skips(soap, MOTION) == []


def test_without_permission_the_publishers_are_left_alone():
    soap = services(allow_motion=False)
    assert [service.name for service in callable_services(soap, MOTION, OTHER)] == ["subscribers"]
    assert "--allow-motion" in skips(soap, MOTION)[0]
    assert skips(soap, OTHER) == []


def test_what_does_not_answer_is_put_down_for_every_requirement():
    soap = services(allow_motion=True)
    soap.run.unreachable["subscribers"] = "no connection"
    assert [service.name for service in callable_services(soap, OTHER)] == ["publishers"]
    assert "no connection" in skips(soap, OTHER)[0]


def test_with_no_service_the_check_is_skipped():
    soap = services(allow_motion=False)
    soap.subscribers = None
    with pytest.raises(pytest.skip.Exception, match="--allow-motion"):
        callable_services(soap, MOTION)


@pytest.mark.parametrize(
    ("name", "statuses", "gone"),
    [
        ("GetGoal", (400, 400), True),
        ("GetGoal", (400, 200), False),
        ("GetGoal", (200,), False),
        ("GetPose", (400,), False),
    ],
)
def test_only_a_refusal_of_what_may_have_ended_says_nothing(name, statuses, gone):
    turns = iter(statuses)
    message = Node(name)
    with serving(lambda *_: (next(turns), b"")) as url:
        soap = services(allow_motion=False, url=url)
        service = soap.subscribers
        operation = next(one for one in service.contract.operations if one.name == name)
        assert is_gone(soap, service, (operation, message), call(service, message)) is gone
        assert next(turns, None) is None
        service.client.close()

"""Which services a check may call: nothing is sent to the one that acts without permission, and that is put down."""

import pytest

from conformance.api.soap.callable_services import SoapServices, callable_services
from conformance.api.soap.service import SoapService
from conformance.packs.table1.files import CONTRACT_DIR
from conformance.transport.client import Connection, HttpClient
from conformance.verdict.run import Run

MOTION, OTHER = "soap-basic-profile/R2724", "soap-basic-profile/R1125"


def services(*, allow_motion: bool) -> SoapServices:
    client = HttpClient("http://127.0.0.1:9", Connection())
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

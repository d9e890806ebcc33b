"""Addresses from WSDLs: what is read, and what is refused in which words."""

import re

import pytest

from conformance.documents.wsdl import WsdlError
from conformance.papers_robot.statement import CONTRACT_DIR
from loadtests.clients import wsdl
from loadtests.clients.robot import Robot


def test_the_address_is_read_from_the_wsdl():
    content = (CONTRACT_DIR / "publishers.wsdl").read_bytes()
    found = wsdl.address_in(content, "publishers.wsdl", "ExecuteDeliveryRequest")
    assert found == "http://127.0.0.1:5555/turtlesim_publisher_ws"
    elsewhere = wsdl.address_in(
        content, "http://robot.example:5555/turtlesim_publisher_ws?wsdl", "ExecuteDeliveryRequest"
    )
    assert elsewhere == "http://robot.example:5555/turtlesim_publisher_ws", "its own loopback is not ours"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            b"<html><body>Welcome</body></html>",
            "an HTML page, such as a login or an error: the root element html instead of wsdl:definitions",
        ),
        (b"no xml", "is no WSDL, but not well-formed XML"),
        (b"<!DOCTYPE x [<!ENTITY a 'b'>]><x>&a;</x>", "the root element x instead of wsdl:definitions"),
        ((CONTRACT_DIR / "subscribers.wsdl").read_bytes(), "has no operation 'ExecuteDeliveryRequest'"),
        (
            (CONTRACT_DIR / "publishers.wsdl").read_bytes().replace(b"soap:address", b"soap:nothing"),
            "has no soap:address",
        ),
        (
            (CONTRACT_DIR / "publishers.wsdl").read_bytes().replace(b"http://127.0.0.1:5555", b"REPLACE_ME"),
            "cannot be used",
        ),
        (
            (CONTRACT_DIR / "publishers.wsdl").read_bytes().replace(b"http://soap.turtlebot.mybot.org/", b"urn:else"),
            "target namespace is 'urn:else'",
        ),
    ],
)
def test_wsdls_that_cannot_be_used(content, message):
    with pytest.raises(WsdlError, match=re.escape(message)):
        wsdl.address_in(content, "x.wsdl", "ExecuteDeliveryRequest")


def test_a_wsdl_file_that_is_not_there():
    with pytest.raises(WsdlError, match="No such file"):
        wsdl.fetch("/nonexistent.wsdl", Robot(None, None, None))

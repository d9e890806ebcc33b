"""Addresses from WSDLs: what is read, and what is refused in which words."""

import re

import pytest

from conformance.papers_robot.files import CONTRACT_DIR
from loadtests.clients import wsdl
from loadtests.clients.robot import Robot
from loadtests.clients.wsdl import WsdlError


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
        (b"<html><body>Welcome</body></html>", "is not a WSDL 1.1: its root element is 'html'"),
        (b"no xml", "is not XML"),
        (b"<!DOCTYPE x [<!ENTITY a 'b'>]><x>&a;</x>", "has a document type declaration"),
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

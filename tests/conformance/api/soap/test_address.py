"""Which addresses of a robot's own WSDL are followed."""

import pytest

from conformance.api.soap.address import is_http, may_be_followed, split

HERE, THERE = "http://127.0.0.1:8080/ws?wsdl", "http://robot.example:8080/ws?wsdl"


@pytest.mark.parametrize(
    ("address", "wsdl", "with_token", "followed"),
    [
        ("http://robot.example:9/x", THERE, True, True),
        ("http://other.example/x", THERE, False, True),
        ("http://other.example/x", THERE, True, False),
        ("http://127.0.0.1:9/x", THERE, False, False),
        ("http://localhost:9/x", HERE, True, True),
        ("http://[::1]:9/x", HERE, True, True),
        ("http://other.example/x", HERE, True, False),
        ("http://0.0.0.0:8080/x", HERE, False, False),
        ("http://[::]:8080/x", THERE, False, False),
        ("REPLACE_WITH_URL", THERE, False, False),
    ],
)
def test_which_address_is_followed(address, wsdl, with_token, followed):
    assert may_be_followed(address, wsdl, with_token=with_token) is followed


@pytest.mark.parametrize("url", ["ftp://a/b", "http:///x", "http://a:0/", "http://[/", "http://a:99999/", "a", ""])
def test_what_is_no_http_url(url):
    assert not is_http(url)


def test_credentials_are_no_part_of_the_authority():
    assert split("http://me:secret@robot:1/a?b") == ("http://robot:1", "/a?b")

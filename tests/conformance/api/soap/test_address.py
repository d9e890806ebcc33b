"""Which URLs of services can be used."""

import pytest

from conformance.documents.wsdl import is_http
from conformance.transport.reach import split


@pytest.mark.parametrize("url", ["ftp://a/b", "http:///x", "http://a:0/", "http://[/", "http://a:99999/", "a", ""])
def test_what_is_no_http_url(url):
    assert not is_http(url)


def test_credentials_are_no_part_of_the_authority():
    assert split("http://me:secret@robot:1/a?b") == ("http://robot:1", "/a?b")

"""SOAP messages in multipart/related, and in charsets that Content-Type names."""

import pytest

from conformance.documents.multipart import parts_of, root_of
from conformance.documents.xml import NotXmlError

_XOP = '<x:Include xmlns:x="http://www.w3.org/2004/08/xop/include" href="cid:{}"/>'


def _package(root, *parts, end="--b--\r\n", how='boundary="b"'):
    head = 'Content-Type: application/xop+xml; charset=utf-8;\r\n type="text/xml"\r\nContent-ID: <root>'
    pieces = [f"--b\r\n{head}\r\n\r\n{root}\r\n".encode()]
    pieces += [b"--b\r\n" + part + b"\r\n" for part in parts]
    return f"multipart/related; {how}", b"".join(pieces) + end.encode()


@pytest.mark.parametrize("part", ["a@b", "a%40b"])
def test_included_parts_are_in_their_places(part):
    image = b"content-type: image/png\r\ncontent-id: <a@b>\r\n\r\n\x00\r\n--\xff"
    content_type, body = _package(f"<a><b>{_XOP.format(part)}</b></a>", image)
    assert root_of(content_type, body).findtext("b") == "AA0KLS3/"
    root, attached = parts_of(content_type, body)
    assert (root.media_type, attached.media_type, attached.body) == ("text/xml", "image/png", b"\x00\r\n--\xff")


def test_the_root_is_the_part_that_start_names():
    content_type, body = _package("<a/>", b"Content-ID: <other>\r\n\r\n<b/>", how='boundary=b; start="<other>"')
    assert root_of(content_type, b"a preamble\r\n" + body).tag == "b"
    attached = b"Content-ID: <c>\r\nContent-Transfer-Encoding: base64\r\n\r\nAAEC"
    assert parts_of(*_package("<a/>", attached))[1].body == b"\x00\x01\x02"


@pytest.mark.parametrize(
    ("package", "problem"),
    [
        (_package(f"<a>{_XOP.format('nowhere')}</a>"), "'nowhere', which is not there"),
        (_package("<a/>", end="--b\r\n"), "does not end"),
        (_package("<a/>", how=""), "without a boundary"),
        (_package("<a>"), "not well-formed"),
        (("multipart/related; boundary=b", b""), "does not end"),
    ],
)
def test_what_is_no_package_is_named(package, problem):
    with pytest.raises(NotXmlError, match=problem):
        root_of(*package)


@pytest.mark.parametrize(
    ("charset", "declared"),
    [
        ("utf-8", ""), ("UTF-8", '<?xml version="1.0"?>\n'), ("iso-8859-1", ""), ("utf-16", ""), ("utf-16le", ""),
        ("iso-8859-1", '<?xml version="1.0" encoding="utf-8"?>'), ("utf-16", '<?xml version="1.0" encoding="utf-16"?>'),
    ],
)  # fmt: skip
def test_a_charset_outranks_the_document(charset, declared):
    body = f"{declared}<a>\u00e4</a>".encode(charset)
    assert root_of(f'text/xml; charset="{charset}"', body).text == "\u00e4"
    assert root_of("text/xml; charset=unknown-8", b"<a>b</a>").text == "b"

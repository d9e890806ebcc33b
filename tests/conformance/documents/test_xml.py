"""The one XML parser: nothing is expanded or fetched, a DOCTYPE is refused, and what is no XML says why."""

import pytest

from conformance.documents.xml import NotXmlError, elements, has_doctype, parse, text_of

ENTITY = b'<!DOCTYPE a [<!ENTITY b "expanded">]><a>&b;</a>'


def test_a_doctype_is_refused():
    with pytest.raises(NotXmlError, match="DOCTYPE"):
        parse(b"<!DOCTYPE a><a/>")


def test_a_doctype_that_the_caller_judges_is_not_read():
    root = parse(ENTITY, doctype=True)
    assert has_doctype(root)
    assert text_of(root) == ""


def test_no_file_comes_in():
    document = b'<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><a>&b;</a>'
    assert text_of(parse(document, doctype=True)) == ""


@pytest.mark.parametrize("document", [b"", b"<a>", b"\xff\xfe\x00", b"<a>&b;</a>", b"<a>" + b"<b>" * 300 + b"</a>"])
def test_what_is_no_xml_says_why(document):
    with pytest.raises(NotXmlError, match="not well-formed XML: "):
        parse(document)


def test_texts_go_across_comments():
    document = b"<a>1<!-- x -->2<?y?>3<b/></a>"
    root = parse(document)
    assert text_of(root) == "123"
    assert len(root) == 3
    assert [child.tag for child in elements(root)] == ["b"]
    assert parse(document, comments=False).text == "123"

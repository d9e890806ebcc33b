"""XML and YAML: nothing is expanded or fetched, a DOCTYPE is refused, and what nobody can read says why."""

import pytest

from conformance.documents.representation import UnreadableError, by_itself, parse_yaml
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


@pytest.mark.parametrize(
    "body",
    [
        b'!!int ""',
        b'!!float ""',
        b"!!int 1:2:x",
        b"!!timestamp 1",
        b"!!timestamp 2026-99-99",
        b"!!binary \xc3\xa4",
        b"!!bool maybe",
        b"? [a]\n: 1\n",
        b"? {a: 1}\n: 1\n",
        b"a: *b",
        b"\xff",
    ],
)
def test_a_value_that_its_tag_does_not_allow_is_unreadable(body: bytes) -> None:
    with pytest.raises(UnreadableError, match="not YAML"):
        by_itself(body)


@pytest.mark.parametrize("body", [b"a: *b", b"{", b"\xff", b"? [a]\n: 1\n"])
def test_what_is_no_yaml_is_unreadable_as_text(body: bytes) -> None:
    with pytest.raises(UnreadableError, match="not YAML"):
        parse_yaml(body)

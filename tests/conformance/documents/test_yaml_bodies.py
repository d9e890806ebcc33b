"""A YAML body that no reader can make sense of is unreadable, whatever the library raises."""

import pytest

from conformance.documents.representation import UnreadableError, by_itself, parse_yaml


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

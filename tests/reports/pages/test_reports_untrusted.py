"""Text that a robot controls, made fit to be shown."""

from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from reports.pages.untrusted import beginning, code_block, code_span, excerpt, plain, visible

ANY_TEXT = st.text(st.characters(exclude_categories=()))


@given(ANY_TEXT)
def test_visible_text_fits_utf8_and_xml(text):
    shown = visible(text)
    shown.encode("utf-8")
    element = etree.Element("a")
    element.text = shown
    assert etree.fromstring(etree.tostring(element, encoding="UTF-8")).text == (shown or None)


@given(st.text(st.characters(categories=["L", "N", "P", "S"])))
def test_printable_text_stays(text):
    assert visible(text) == text


def test_escapes_are_told():
    assert visible("a\x1b[2J\u202eb\r\n\tc\ud800\U000e0001") == "a\\x1b[2J\\u202eb\\r\n\tc\\ud800\\U000e0001"


def test_excerpt_is_one_line():
    assert excerpt("a\n b\r\nc", 100) == "a b\\r c"
    assert excerpt("x" * 50, 10) == "x" * 10 + "…"


def test_beginning_tells_what_is_missing():
    whole = beginning("abc", 10)
    assert (whole.text, whole.cut) == ("abc", False)
    cut = beginning("ä" * 100, 10)
    assert (cut.text, cut.omitted, cut.total, cut.unit) == ("ä" * 10, 90, 100, "characters")
    by_producer = beginning("ä" * 100, 10, octets=1_000_000)
    assert (by_producer.omitted, by_producer.total, by_producer.unit) == (999_980, 1_000_000, "bytes")
    assert not beginning("äöü", 10, octets=6).cut


@given(ANY_TEXT)
def test_code_span_cannot_be_left(text):
    span = code_span(text)
    fence = span[: len(span) - len(span.lstrip("`"))]
    assert "\n" not in span
    assert span.endswith(fence)
    assert fence not in span[len(fence) : -len(fence)]
    assert "|" not in span.replace("\\|", "")


@given(ANY_TEXT)
def test_code_block_cannot_be_left(text):
    lines = code_block(text).split("\n")
    assert lines[0] == lines[-1]
    assert all(lines[0] not in line for line in lines[1:-1])


def test_plain_text_stays_plain():
    assert plain("a *b* <script> [x](y) `c` | @octocat #12 snake_case") == (
        "a \\*b\\* \\<script\\> \\[x\\](y) \\`c\\` \\| @<!-- -->octocat #<!-- -->12 snake\\_case"
    )

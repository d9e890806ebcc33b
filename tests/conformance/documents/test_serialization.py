"""Parameters and forms are written as the tables of OpenAPI 3.1, 4.8.12.4, show them."""

import pytest

from conformance.documents.writing import header_text, multipart_body, path_text, query_pairs, query_text

_LIST, _OBJECT = ["blue", "black"], {"R": 100, "G": 200}


@pytest.mark.parametrize(
    ("style", "explode", "text", "of_list", "of_object"),
    [
        ("simple", False, "blue", "blue,black", "R,100,G,200"),
        ("simple", True, "blue", "blue,black", "R=100,G=200"),
        ("label", False, ".blue", ".blue,black", ".R,100,G,200"),
        ("label", True, ".blue", ".blue.black", ".R=100.G=200"),
        ("matrix", False, ";c=blue", ";c=blue,black", ";c=R,100,G,200"),
        ("matrix", True, ";c=blue", ";c=blue;c=black", ";R=100;G=200"),
    ],
)
def test_paths(style, explode, text, of_list, of_object):
    written = [path_text(value, style, "c", explode=explode) for value in ("blue", _LIST, _OBJECT)]
    assert written == [text, of_list, of_object]


@pytest.mark.parametrize(
    ("style", "explode", "of_list", "of_object"),
    [
        ("form", True, "c=blue&c=black", "R=100&G=200"),
        ("form", False, "c=blue,black", "c=R,100,G,200"),
        ("spaceDelimited", False, "c=blue%20black", "c=R%20100%20G%20200"),
        ("pipeDelimited", False, "c=blue%7Cblack", "c=R%7C100%7CG%7C200"),
        ("tabDelimited", False, "c=blue%09black", None),
        ("deepObject", True, None, "c%5BR%5D=100&c%5BG%5D=200"),
    ],
)
def test_queries(style, explode, of_list, of_object):
    for value, text in ((_LIST, of_list), (_OBJECT, of_object)):
        if text is not None:
            assert query_text(query_pairs("c", value, style, explode=explode)) == text


@pytest.mark.parametrize(
    ("value", "text"), [("a b&c", "n=a%20b%26c"), (True, "n=true"), (1.5, "n=1.5"), (None, "n="), ("é/", "n=%C3%A9%2F")]
)
def test_scalars(value, text):
    assert query_text(query_pairs("n", value)) == text


def test_a_path_hides_no_slash():
    assert path_text("a/b%") == "a%2Fb%25"


@pytest.mark.parametrize(("explode", "text"), [(False, "R,100,G,200"), (True, "R=100,G=200")])
def test_headers(explode, text):
    assert header_text(_OBJECT, explode=explode) == text


def test_a_form_with_a_file():
    media_type, body = multipart_body({"n": 1, "f": b"\x00"})
    boundary = media_type.partition("boundary=")[2].encode()
    parts = body.split(b"--" + boundary)
    assert (len(parts), parts[-1]) == (4, b"--\r\n")
    assert parts[1].endswith(b'name="n"\r\n\r\n1\r\n')
    assert b"filename=" in parts[2]
    assert parts[2].endswith(b"\r\n\r\n\x00\r\n")

"""What the documentation site is made of; `make docs` builds it, and fails on each warning."""

import json
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SITE = ROOT / "docs" / "site"


@pytest.fixture(scope="module", autouse=True)
def _site():
    sys.path.insert(0, str(SITE))
    yield
    sys.path.remove(str(SITE))


def test_each_key_of_a_statement_has_a_meaning():
    import statement_keys  # noqa: PLC0415 - found by the fixture

    page = statement_keys.page()
    rows = re.findall(r"^\| (`\w+`) \| (.*) \| (.*) \| (.*) \|$", page, re.MULTILINE)
    assert len(rows) > 80
    assert [row for row in rows if not row[1].strip() or not row[3].strip()] == []
    assert "A base class" not in page  # what msgspec says of a table that says nothing of itself


def test_each_key_of_a_result_is_listed():
    import schemas  # noqa: PLC0415 - as above

    page = schemas.page()
    for name in ("result", "latency", "fleet"):
        schema = json.loads((ROOT / "reports" / "schemas" / f"roaas-{name}-1.schema.json").read_text(encoding="utf-8"))
        assert all(f"| `{key}` |" in page for key in schema["properties"])


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.html", '<link rel="stylesheet" href="https://fonts.example/css">'),
        ("a.html", '<img src="//counter.example/1.gif">'),
        ("a.html", "<style>@import 'https://fonts.example/css';</style>"),
        ("a.css", "@font-face { src: url(https://fonts.example/a.woff2) }"),
    ],
)
def test_a_page_that_loads_something_from_elsewhere_is_found(name, text, tmp_path):
    import offline  # noqa: PLC0415 - as above

    (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "b.html").write_text('<a href="https://www.rfc-editor.org/">RFC</a><img src="a.png">', encoding="utf-8")
    (problem,) = offline.loaded_from_elsewhere(tmp_path)
    assert problem.startswith(f"{name} loads ")


def test_the_pictures_are_small():
    pictures = list((ROOT / "docs" / "images").glob("*.png"))
    assert pictures
    assert all(picture.stat().st_size < 150_000 for picture in pictures)

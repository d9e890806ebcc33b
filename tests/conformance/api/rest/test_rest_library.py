"""``roaas certify --contract DIR`` judges a service of another domain, and finds what is wrong with a broken one."""

import json
import re
from collections.abc import Callable, Iterator

import pytest
from click.testing import CliRunner
from lending_library import CONTRACT, Library, open_library

from conformance.contract.pack import Contract
from roaas import main


@pytest.fixture
def certified(tmp_path) -> Iterator[Callable[..., tuple[int, dict[str, tuple[str, str]], dict[str, str]]]]:
    closing = []

    def run(library: Library, *options: str):
        rest, wsdl, close = open_library(library)
        closing.append(close)
        arguments = ["certify", "--contract", str(CONTRACT), "--rest", rest, "--publishers-wsdl", wsdl]
        result = CliRunner().invoke(main, [*arguments, "--effort", "quick", "--out", str(tmp_path), *options])
        assert result.exception is None or isinstance(result.exception, SystemExit), result.output
        document = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
        found = {item["id"]: (item["verdict"], item["reason"]) for item in document["requirements"]}
        return result.exit_code, found, document["classes"]

    yield run
    for close in closing:
        close()


def test_a_good_library_conforms(certified):
    code, found, classes = certified(Library(), "--allow-motion")
    wrong = {id_: told for id_, told in found.items() if told[0] in {"fail", "error", "skip", "warn"}}
    # The library need not show what is only judged where it is seen; its http.server takes a space before a colon.
    skipped = {id_ for id_, (verdict, _) in wrong.items() if verdict == "skip"}
    assert "http/etag-format" in skipped
    ledger = Contract.load(CONTRACT).ledger
    assert all("seen" in ledger[id_].needs for id_ in skipped), skipped
    assert set(wrong) - skipped <= {"web-server/space-before-colon"}, wrong
    assert code == 0
    assert classes["http"] == classes["rest-formats"] == classes["strict-input"] == classes["describe"] == "pass"
    assert "rest-resources" not in classes or classes["rest-resources"] == "not-claimed"


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ("every-20th-fails", "http/declared-status"),
        ("takes-unknown-fields", "strict-input/json-unknown"),
        ("xml-rounds", "rest-formats/same-values"),
        ("undescribed", "describe/openapi-operations"),
    ],
)
def test_a_broken_library_does_not(certified, fault, expected):
    class_ = expected.split("/", 1)[0]
    code, found, _ = certified(Library(fault), "--class", class_)
    assert (found[expected][0], code) == ("fail", 1)


def test_nothing_is_taken_out_without_permission(certified):
    library = Library()
    _, found, _ = certified(library, "--class", "http", "--class", "strict-input")
    assert not [asked for asked in library.log if asked[0] == "DELETE" and re.fullmatch(r"/books/\d+", asked[1])]
    assert library.books
    assert (found["http/delete-idempotent"][0], found["strict-input/json-unknown"][0]) == ("skip", "pass")

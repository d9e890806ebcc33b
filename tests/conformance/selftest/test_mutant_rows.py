"""Mutants as rows of data: what a row may say, and what it may not."""

import pytest

from proof.mutation import changes, fields
from proof.mutation.messages import Request, Response
from proof.mutation.table import read_rows

_WORDS = {"things": vars(changes) | {"GOAL": "/goal/", "fields": fields}}
_REQUEST = Request("rest", "GET", "/goal/")


def _mutants(folder, row):
    path = folder / "rows.toml"
    path.write_text(f"[things.rest.http]\n{row}\n", encoding="utf-8")
    return list(read_rows(path, _WORDS))


@pytest.mark.parametrize(
    ("change", "body"),
    [
        ("altered(rest('GET', GOAL), becomes(404))", b'{"x": 1}'),
        ("altered(rest(), values(fields.field('x', -2.5)), nth=1)", b'{"x": -2.5}'),
        ("instead(rest('PUT GET', GOAL), plain(404, b'gone', JSON, ('Allow', 'GET')))", b"gone"),
        ("always(unwanted)", None),
    ],
)
def test_a_row_names_where_which_operator_and_when(tmp_path, change, body):
    (mutant,) = _mutants(tmp_path, f'broken = ["date", "It is broken.", "{change}", {{ probe = true }}]')
    assert (mutant.name, mutant.catches, mutant.interface, mutant.probe) == ("broken", ("http/date",), "rest", True)
    if body is not None:
        sent = mutant.make()(_REQUEST, lambda _: Response(200, [("Content-Type", "application/json")], b'{"x": 1}'))
        assert sent.body == body


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ("altered(nowhere(), becomes(404))", KeyError),
        ("instead(lambda request: True, plain(204))", ValueError),
        ("(1).__class__", ValueError),
        ("GOAL.__class__", ValueError),
        ("altered(", SyntaxError),
    ],
)
def test_a_row_has_words_and_values_alone(tmp_path, change, error):
    with pytest.raises(error):
        _mutants(tmp_path, f'broken = ["date", "It is broken.", "{change}"]')

"""The tables of ways in: each cell has cases, or a reason why it has none."""

import json
from types import SimpleNamespace

import pytest

from conformance.contract.pack import Contract
from conformance.selftest import coverage, ways
from conformance.selftest.ways_argued import SILENT, Argument, Arguments, WaysFileError, arguments_in

CONTRACT = Contract.load()
_PUT, _TYPE = "rest-resources/velocity-put", "rest-resources/velocity-type"
_WAYS = {_PUT: {"putVelocity": 3, ways.TRAITS[1]: 2}, _TYPE: {"getVelocity": 5, ways.TRAITS[1]: 4}}
_ABOUT = '[about]\n"rest-resources/velocity-*" = ["*Velocity"]\n'
_SIGN = '[[argued]]\nwhy = "It has no sign."\nrequirements = ["rest-resources/*"]\nways = ["a negative number"]\n'
_OTHER = '[[argued]]\nwhy = "The other one."\nrequirements = ["*-put", "*-type"]\nways = ["*Velocity"]\n'


@pytest.fixture
def pack(tmp_path):
    """A pack with a file of ways, and the function that writes its arguments."""
    (tmp_path / ways.FILE).write_text(json.dumps(_WAYS), encoding="utf-8")

    def written(text):
        (tmp_path / "ways.toml").write_text(text, encoding="utf-8")
        return SimpleNamespace(directory=tmp_path, ledger=CONTRACT.ledger)

    return written


def test_no_cell_of_the_pack_is_empty_and_unargued():
    assert list(ways.unargued(CONTRACT)) == []
    assert arguments_in(CONTRACT.directory) is not None
    rows = [line for line in ways.tables(CONTRACT) if line.startswith("| `")]
    assert len(rows) > 100
    assert not [row for row in rows if "|  |" in row]


def test_a_cell_without_reason_is_told(pack):
    told = list(ways.unargued(pack(_ABOUT + _SIGN)))
    assert told == [
        f"{_TYPE} is not judged by putVelocity, and ways.toml does not say why",
        f"{_PUT} is not judged by getVelocity, and ways.toml does not say why",
    ]
    assert list(ways.unargued(pack(_ABOUT + _SIGN + _OTHER))) == []


def test_what_a_requirement_does_not_speak_of_needs_no_reason(pack):
    about = '[about]\n"*-put" = ["put*"]\n"*-type" = ["get*"]\n'
    contract = pack(about + _SIGN)
    assert list(ways.unargued(contract)) == []
    lines = ways.tables(contract)
    assert f"| `{_PUT}` | {SILENT} | 3 | (a) | 2 |" in lines
    assert lines[-1] == "- (a) It has no sign."


def test_a_reason_for_nothing_is_told(pack):
    spare = '[[argued]]\nwhy = "Spare."\nrequirements = ["*"]\nways = ["SOAP *"]\n'
    about = '[about]\n"rest-resources/velocity-*" = ["*Velocity"]\n"http/*" = ["get*"]\n'
    assert list(ways.unargued(pack(about + _SIGN + _OTHER + spare))) == [
        "ways.toml: about 'http/*' fits no requirement",
        "ways.toml: no cell has to do with the argument 'Spare.'",
    ]


def test_the_first_reason_that_covers_a_cell_counts():
    first, second = (Argument(why, ("http/*",), ("get*",)) for why in ("One.", "Two."))
    arguments = Arguments({"http/safe": ("put*",)}, (first, second))
    assert arguments.of("http/safe", "getPose") is first
    assert arguments.of("http/safe", "deleteGoal") == SILENT
    assert arguments.of("http/safe", "putGoal") == arguments.of("http/head", "putGoal") == ""


def test_a_pack_without_the_file_need_not_argue(tmp_path):
    (tmp_path / ways.FILE).write_text(json.dumps(_WAYS), encoding="utf-8")
    contract = SimpleNamespace(directory=tmp_path, ledger=CONTRACT.ledger)
    assert list(ways.unargued(contract)) == []
    assert f"| `{_PUT}` |  | 3 |  | 2 |" in ways.tables(contract)


def test_a_file_that_cannot_be_used_is_named(pack):
    with pytest.raises(WaysFileError, match=r"ways\.toml.*'reason'"):
        list(ways.unargued(pack('[[argued]]\nreason = "x"\nrequirements = []\nways = []\n')))


def test_cells_without_reason_are_disagreements(monkeypatch):
    monkeypatch.setattr(coverage, "unargued", lambda _: iter(["a cell"]))
    assert "a cell" in coverage.disagreements(CONTRACT)

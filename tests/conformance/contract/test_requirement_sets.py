"""Frozen sets: what is in one does not change, and what is newer does not count."""

import pytest

from conformance.contract.pack import Contract
from conformance.contract.requirement_sets import RequirementSetError, current, frozen_form, judged_by, load_set, names
from conformance.papers_robot.statement import CONTRACT_DIR
from conformance.verdict.evidence import Judge
from conformance.verdict.verdicts import ClassValue, Value, class_verdicts, score, verdict_of

CONTRACT = Contract.load()
LEDGER = CONTRACT.ledger


@pytest.mark.parametrize("name", names(CONTRACT))
def test_ids_levels_and_texts_of_a_set_stay_as_they_were(name):
    """Before a release that freezes the set: `python -m conformance.contract.freeze NAME`. After it: never."""
    kept = load_set(CONTRACT, name).requirements
    assert {id_: frozen_form(LEDGER[id_]) for id_ in kept if id_ in LEDGER} == dict(kept)


def test_a_new_id_changes_neither_the_digest_nor_what_is_in_a_set():
    """Signed certificates name the digest; requirements got the class web-server after the freeze."""
    kept = load_set(CONTRACT, "1.2")
    assert kept.digest == "sha256:dff37acc19f5bf0720efb68ec6d6e773208ca0e950ecaae5a75e6692a47aafff"
    assert {"http/host-missing", "web-server/host-missing"} & kept.requirements.keys() == {"web-server/host-missing"}


def test_what_a_suite_has_is_known_by_its_set_only_when_it_is_the_same():
    ledger = dict(LEDGER)
    newest = current(CONTRACT, ledger)
    ledger.pop(next(iter(ledger)))
    assert current(CONTRACT, ledger).name == "unfrozen"
    assert current(CONTRACT, ledger).digest != newest.digest


def test_a_contract_of_ones_own_has_no_set(tmp_path):
    (tmp_path / "openapi.yaml").write_bytes((CONTRACT_DIR / "openapi.yaml").read_bytes())
    own = Contract.load(tmp_path)
    assert judged_by(own, None) is None
    with pytest.raises(RequirementSetError, match=r"has no pack\.toml"):
        judged_by(own, "1.2")


def test_an_unknown_set_is_told_by_name():
    with pytest.raises(RequirementSetError, match=r"'0\.9'"):
        judged_by(Contract.load(), "0.9")


@pytest.mark.parametrize("passes", [True, False])
def test_a_newer_requirement_is_shown_and_does_not_count(passes):
    older, newer = [item for item in LEDGER.values() if item.class_ == "http" and item.level == "MUST"][:2]
    judge = Judge({older.id, newer.id})
    judge.check(older.id, True, None, "it does")
    judge.check(newer.id, passes, None, "it does")
    drawn = [verdict_of(item, judge.evidence[item.id], ("http",)) for item in (older, newer)]
    scored = score(drawn, {older.id}, "requirement set 1.1")
    assert [item.value for item in scored] == [Value.PASS, Value.PASS if passes else Value.WARN]
    assert [item.scored for item in scored] == [True, False]
    assert "newer than requirement set 1.1, and not scored" in scored[1].reason
    assert class_verdicts(scored, ("http",))["http"][0] is ClassValue.PASS
    assert class_verdicts(score(drawn, {newer.id}, "x"), ("http",))["http"][0] is (
        ClassValue.PASS if passes else ClassValue.FAIL
    )
    assert class_verdicts(score(drawn, set(), "x"), ("http",))["http"][0] is ClassValue.NOT_CLAIMED

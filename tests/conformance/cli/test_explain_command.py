"""``roaas explain``: every requirement is explained; an unknown one leads to its neighbours."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from conformance.cli.explain import explanation_of, ledger_of
from conformance.contract.pack import Contract
from conformance.explaining.advice import FRAMEWORKS, sources_of, topic_of, topics
from roaas import main

CONTRACT = Contract.load()
LEDGER = ledger_of(CONTRACT)
LAMP = Path(__file__).parents[3] / "examples/lamp"


def explain(*words):
    return CliRunner(env={"COLUMNS": "200"}).invoke(main, ["explain", *words])


@pytest.mark.parametrize("id_", ["http/head", "motion/hold", "description/body-schema", "soap/fault", "safety/hold"])
def test_what_why_whence_how_judged_and_how_to_fix(id_):
    done = explain(id_)
    assert done.exit_code == 0, done.output
    for heading in (f"{id_} (", "Why it matters", "Source", "How it is judged", "How to fix it"):
        assert heading in done.output
    assert f"requirements/{id_}.html" in done.output


def test_only_the_framework_that_one_uses():
    output = explain("http/head", "--framework", "flask").output
    assert "Flask:" in output
    assert "Go:" not in output


def test_a_source_is_told_in_own_words():
    output = explain("http/head").output
    assert "9.3.2: HEAD is GET without the body" in output
    assert "the contract, section “HTTP”" in output


def test_an_unknown_id_leads_to_near_ones():
    done = explain("http/haed")
    assert done.exit_code == 2
    assert "'http/haed'; did you mean http/head," in done.output


def test_a_former_id_leads_to_what_it_is_now():
    assert explain("http/head-length").output.startswith("http/head-length is now part of http/head-no-body.")


def test_without_an_id_all_are_listed():
    done = explain()
    assert done.exit_code == 0
    assert all(f"  {id_} " in done.output for id_ in LEDGER)


def test_a_pack_of_ones_own():
    done = explain("lamp/fades", "--contract", str(LAMP))
    assert done.exit_code == 0, done.output
    assert "test_lamp::fades" in done.output


@pytest.mark.parametrize("words", ["explain motion/st", "ex"])
def test_the_shell_completes_commands_and_ids(words):
    env = {"_ROAAS_COMPLETE": "bash_complete", "COMP_WORDS": f"roaas {words}", "COMP_CWORD": str(len(words.split()))}
    output = CliRunner(env=env).invoke(main, [], prog_name="roaas").output
    assert {"plain,motion/stop", "plain,explain"} & set(output.split())


def test_every_requirement_has_advice_and_a_check():
    for id_, item in LEDGER.items():
        explanation = explanation_of(CONTRACT, item)
        assert explanation.topic is not None, id_
        assert explanation.checks or item.untestable, id_


def test_every_clause_that_a_requirement_cites_is_told_in_own_words():
    # By source: the requirement that cites it.
    untold = {
        source.name: item.id
        for item in LEDGER.values()
        for source in sources_of(item.source)
        if not source.name.startswith("contract.md#")
        and (not source.title or (any(map(str.isdigit, source.name)) and not source.meanings))
    }
    whole = {"XML 1.0", "Swagger 2.0", "ROS 2 QoS", "ROS 2 actions"}
    assert {name: id_ for name, id_ in untold.items() if name not in whole} == {}, "say in sources.toml what it says"


def test_no_advice_is_out_of_use():
    used = {topic_of(id_).title for id_ in LEDGER}
    # Of requirements to come, and of those that the paper's contract does not have.
    classes = {"HTTP", "SOAP", "Invalid input", "Motion", "ROS gateways"}
    general = {id_: topic_of(id_).title for id_ in LEDGER if topic_of(id_).title in classes}
    assert general == {}, "these have the advice of their class alone: give each a table in advice.toml"
    assert {topic.title for topic in topics()} - used == classes, "no requirement has this advice"
    assert all(set(topic.code) <= set(FRAMEWORKS) for topic in topics())

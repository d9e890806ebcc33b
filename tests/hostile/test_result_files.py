"""Files of a result that somebody else wrote, as data: what is in place of the file, and what each command makes of it.

Every command ends within a bound, says in a line what is wrong, and runs, reads and writes nothing else.
"""

import gzip
import json
import os
import re
import shutil
import socket
import sys
import threading
from pathlib import Path

import given_results
import jsonschema_rs
import pytest
from given_results import check, run
from hypothesis import given, settings
from hypothesis import strategies as st
from processes import ended

from conformance.contract.pack import DEFAULT_PACK, Contract
from conformance.engine.permission import moves
from conformance.engine.resending import as_json
from conformance.statement.statement import StatementError, load_statement
from conformance.transport.exchange import Request
from conformance.verdict.finding import Sent
from reports.attestation.keys import PUBLIC_NAME

SCHEMAS = Path(__file__).parents[2] / "reports" / "schemas"
SECRET = "the content of another file"  # noqa: S105 - of no account

# What is in place of a file: its content, or how it is made.
CONTENTS = {
    "nothing": b"",
    "no UTF-8": b'{"format": "\xff\xfe"}',
    "cut": b'{"format": "roaas-result/1", "requirements": [',
    "null": b"null",
    "a list": b"[]",
    "a number": b"1" * 5000,
    "lists in lists": b"[" * 100_000 + b"]" * 100_000,
    "objects in objects": b'{"format":' * 100_000,
    "NaN": b'{"format": "roaas-result/1", "seed": NaN}',
    "infinity": b'{"format": "roaas-result/1", "seed": 1e999}',
    "two million values": b"[" + b"0," * 6_000_000 + b"0]",
    "another format": b'{"format": "roaas-result/9"}',
    "types": b'{"format": "roaas-result/1", "requirements": {"id": []}, "suite": 1, "target": [], "pack": "x"}',
    "escapes": b'{"format": "\\u001b[2J\\u202e::error::##[group]\\n::error::x"}',
}


def a_pipe(path):
    os.mkfifo(path)


def a_folder(path):
    path.mkdir()


def endless(path):
    path.symlink_to("/dev/zero")


def elsewhere(path):
    outside = path.parents[1] / "outside.json"
    outside.write_text(json.dumps({"format": SECRET}))
    path.symlink_to(outside)


def a_circle(path):
    path.symlink_to(path)


def huge(path):
    with path.open("wb") as file:
        file.truncate(1 << 40)


SPECIAL = (a_pipe, a_folder, endless, elsewhere, a_circle, huge)
# Commands that read a file of a result, and their exit codes for one that cannot be used. A refused certificate is 1.
READERS = {
    "result/result.json": {
        "replay {}/result": (2,), "judge {}/result": (2,), "report {}/result": (2,),
        "report {}/result --format badge": (2,), "diff {}/result {}/result": (2,), "sign {}/result --key {key}": (2,),
    },
    "load/latency.json": {"report {}/load": (2,), "compare {}/load {}/load": (2,)},
    "fleet/fleet.json": {"report {}/fleet": (2,)},
    "result/certificate.intoto.json": {
        "verify {}/result/certificate.intoto.json --key {public}": (1, 2),
        "registry build {}/result --keys {}/keys --out {}/site": (1, 2),
        "report {}/result": (0, 2),
    },
    "result/traces.json.gz": {"judge {}/result": (0, 2)},
    "result/history.jsonl.gz": {"judge {}/result": (1, 2)},
    "result/description/openapi.json": {"diff {}/result {}/result": (2,), "replay {}/result": (2, 4)},
    "result/description/pack.toml": {"replay {}/result": (2, 4)},
}  # fmt: skip


@pytest.fixture(scope="session", name="well_made")
def _well_made(tmp_path_factory):
    return given_results.make(tmp_path_factory.mktemp("well_made"))


def _tree(folder):
    return {path for path in folder.rglob("*") if not path.is_relative_to(folder / "sent")}


def _wrong_files():
    """Return what stands in which place: each special file in each, and each content in a third of them by turns."""
    turns = enumerate((place, what) for what in CONTENTS for place in READERS)
    return [(place, what) for place in READERS for what in SPECIAL] + [one for turn, one in turns if turn % 3 == 0]


@pytest.mark.parametrize(("place", "what"), _wrong_files(), ids=lambda one: getattr(one, "__name__", one))
def test_a_file_that_is_none(well_made, tmp_path, place, what):
    sent = well_made.sent(tmp_path / "sent")
    (sent / place).unlink(missing_ok=True)
    if isinstance(what, str):
        content = CONTENTS[what]
        (sent / place).write_bytes(gzip.compress(content, 1) if place.endswith(".gz") else content)
    else:
        what(sent / place)
    before = _tree(tmp_path)
    # What may never end meets each command. The rest is read or refused by one reader, and meets one command by turns.
    commands = [*READERS[place].items()]
    turn = [*CONTENTS, *SPECIAL].index(what) % len(commands)
    for command, codes in commands if what in {a_pipe, endless} else [commands[turn]]:
        done = run(command, sent)
        check(done, *codes)
        assert SECRET not in done.output
        assert done.exit_code == 0 or len(done.output) < 4000
    assert _tree(tmp_path) == before


@pytest.mark.parametrize("place", ["result/traces.json.gz", "result/history.jsonl.gz"])
def test_pages_need_neither_traces_nor_history(well_made, tmp_path, place):
    """Whatever is in their place."""
    sent = well_made.sent(tmp_path / "sent")
    for what in (a_pipe, endless):
        (sent / place).unlink(missing_ok=True)
        what(sent / place)
        check(run("report {}/result", sent), 0)


def test_a_command_in_a_process_of_its_own(well_made, tmp_path):
    """It says one line on stderr, and ends: a pipe without a writer does not stop it."""
    sent = well_made.sent(tmp_path / "sent")
    (sent / "result" / "result.json").unlink()
    a_pipe(sent / "result" / "result.json")
    for command in ("replay", "report"):
        done = ended(sys.executable, "-m", "roaas", command, sent / "result", cwd=tmp_path, timeout=100)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.splitlines()[-1].endswith("no regular file")


@pytest.fixture(scope="module", name="bomb")
def _bomb():
    """A quarter of a gigabyte, packed; only the process that needs it packs it."""
    return gzip.compress(b"\x1f" + bytes(1 << 28), 9)


@pytest.mark.parametrize("name", ["traces.json.gz", "history.jsonl.gz"])
@pytest.mark.parametrize("command", ["judge {}/result", "report {}/result"])
def test_a_file_that_unpacks_to_more_than_any_run_writes(well_made, bomb, tmp_path, command, name):
    sent = well_made.sent(tmp_path / "sent")
    document = well_made.document("result/result.json")
    document["classes"]["motion"] = "pass"
    (sent / "result" / "result.json").write_text(json.dumps(document))
    (sent / "result" / name).write_bytes(bomb)
    check(run(command, sent), 0, 1, 2)


@pytest.mark.parametrize("name", ["..", "pack", "{}/pack", "os", "\x1b[2J", "table1/../../pack", ""])
def test_a_pack_that_a_result_names_is_no_path(well_made, tmp_path, monkeypatch, name):
    sent, marker = well_made.sent(tmp_path / "sent"), tmp_path / "executed"
    code = f"open({str(marker)!r}, 'w').close()\n"
    for folder in (tmp_path / "pack", sent / "result", sent / "result" / "description"):
        (folder / "rules").mkdir(parents=True, exist_ok=True)
        for file in ("plugin.py", "conftest.py", "rules/test_all.py", "rules/conftest.py", "selftest.py"):
            (folder / file).write_text(code)
        (folder / "openapi.json").write_bytes((sent / "result" / "description" / "original.json").read_bytes())
        manifest = (well_made.folder / "result" / "description" / "pack.toml").read_text()
        (folder / "pack.toml").write_text(f'plugin = "plugin.py"\n{manifest.replace("described = true", "")}')
    monkeypatch.chdir(tmp_path)
    document = well_made.document("result/result.json")
    document["pack"]["name"] = name.format(tmp_path)
    for api in (document.get("api"), None):
        document.pop("api", None)
        document |= {} if api is None else {"api": api}
        (sent / "result" / "result.json").write_text(json.dumps(document))
        for command in ("replay {}/result", "judge {}/result"):
            check(run(command, sent), 0, 1, 2, 4)
    assert not marker.exists()


# What a finding may ask to send. Without --allow-motion, none of this leaves.
ACTING = {
    "a vertical tab": {"raw": b"PUT\x0b/velocity HTTP/1.1\r\nHost: r2\r\n\r\n"},
    "a form feed": {"raw": b"PUT\x0c/velocity HTTP/1.1\r\n\r\n"},
    "a bare carriage return": {"raw": b"PUT\r/velocity\rHTTP/1.1\n\n"},
    "another method": {"raw": b"MOVE /a HTTP/1.1\r\n\r\n"},
    "no version": {"raw": b"MOVE /a\r\n"},
    "lower case": {"raw": b"put /a HTTP/1.1\r\n\r\n"},
    "empty lines first": {"raw": b"\r\n\r\nPUT /a HTTP/1.1\r\n\r\n"},
    "absolute": {"raw": b"PUT http://r2/a HTTP/1.1\r\n\r\n"},
    "two requests": {"raw": b"GET / HTTP/1.1\r\nHost: r2\r\n\r\nPUT /a HTTP/1.1\r\nHost: r2\r\n\r\n"},
    "a length that hides one": {"raw": b"GET / HTTP/1.1\r\nContent-Length: 0\r\n\r\nSTOP /a HTTP/1.1\r\n\r\n"},
    "a folded line": {"raw": b"GET / HTTP/1.1\r\nX: a\r\n PUT /a HTTP/1.1\r\n\r\n"},
    "HTTP/2": {"raw": b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\x00\x00\x00\x04\x00\x00\x00\x00\x00"},
    "garbage": {"raw": b"\x16\x03\x01\x00\xff"},
    "raw that reads": {"raw": b"GET / HTTP/1.1\r\nHost: r2\r\n\r\n"},
    "MOVE": {"method": "MOVE"},
    "get in lower case": {"method": "get"},
    "TRACE": {"method": "TRACE"},
    "a body behind GET": {"body": b"PUT /a HTTP/1.1\r\nHost: r2\r\n\r\n"},
    "POST": {"method": "POST"},
    "an override": {"headers": (("X-HTTP-Method-Override", "PUT"),)},
    "an override in a value": {"headers": (("X-A", "PUT /a"),)},
    "an override in the query": {"path": "/a?_method=PUT"},
    "an encoded override": {"path": "/a?_%6dethod=PUT"},
    "chunks": {"headers": (("Transfer-Encoding", "chunked"),)},
    "an upgrade": {"headers": (("Upgrade", "h2c"),)},
    "another target": {"headers": (("X-Original-URL", "/start"),)},
    "a harmful name": {"path": "/system/shutdown"},
    "an encoded harmful name": {"path": "/system/%73hutdown"},
    "a harmful name, encoded twice": {"path": "/system/%2573hutdown"},
    "a harmful value": {"path": "/cgi?do=reboot"},
    "a harmful parameter": {"path": "/cgi?factoryReset=1"},
    "a name that acts": {"path": "/robot/move"},
    "a name that acts, within a word": {"path": "/robotMoveTo?x=1"},
    "a name that acts, behind dots": {"path": "/state/%2e%2e/m%6fve"},
    "a name that acts, as a path parameter": {"path": "/state;do=drive"},
    "a value that acts": {"path": "/cgi-bin/ptz.cgi?action=start&code=Up"},
    "a parameter that acts": {"path": "/relay/0?turn=on"},
    "a parameter that names data, and one that acts": {"path": "/cgi?format=json&cmd=drive"},
    "an override by its verb": {"headers": (("X-HTTP-Verb-Override", "PUT"),)},
}  # fmt: skip


def _failure(url, *, method="GET", path="/a", headers=(), body=b"", raw=None):
    sequence = as_json([Sent(0.0, Request(method, f"{url}{path}", headers, body, raw))])
    return {"message": "m", "number": 1, "response": {"status": 500, "headers": {}, "body": ""}, "sequence": sequence}


@pytest.mark.parametrize("name", ACTING)
def test_what_does_not_provably_read_needs_permission(name):
    assert moves(_failure("http://r2", **ACTING[name]))


def test_what_needs_permission_is_not_sent(well_made, tmp_path):
    sent, heard = well_made.sent(tmp_path / "sent"), []
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(30)
        threading.Thread(target=lambda: heard.append(_accepted(server)), daemon=True).start()
        url = f"http://127.0.0.1:{server.getsockname()[1]}"
        document = well_made.document("result/result.json")
        failures = [_failure(url, **ACTING[name]) for name in ("a vertical tab", "MOVE", "an override")]
        document["requirements"] = [document["requirements"][0] | {"failures": failures}]
        document["web_server"] = {"requirements": []}
        (sent / "result" / "result.json").write_text(json.dumps(document))
        done = run("replay {}/result", sent)
        assert heard == []
    check(done, 2)
    assert "--allow-motion" in done.output


def _accepted(server):
    try:
        return server.accept()
    except OSError:
        return "closed"


@pytest.mark.parametrize("path", ["/a", "/a?b=c", "/robot/pose/", "", "/a?format=json&start=20", "/moved"])
@pytest.mark.parametrize("method", ["GET", "HEAD", "OPTIONS"])
def test_what_reads_needs_no_permission(method, path):
    assert not moves(_failure("http://r2", method=method, path=path, headers=(("Accept", "application/json"),)))


def test_a_get_that_the_contract_calls_a_motion_needs_permission(tmp_path):
    marked = {"get": {"x-roaas-motion": True, "responses": {"200": {"description": ""}}}}
    paths = {"/drive": marked, "/state": {"get": marked["get"] | {"x-roaas-motion": False}}}
    description = {"openapi": "3.0.3", "info": {"title": "a", "version": "1"}, "paths": paths}
    (tmp_path / "openapi.json").write_text(json.dumps(description))
    contract = Contract.load(tmp_path)
    assert moves(_failure("http://r2", path="/drive"), contract, "http://r2")
    assert not moves(_failure("http://r2", path="/state"), contract, "http://r2")


NASTY = (
    "\x1b[2J\x1b]0;a\x07", "\u202egood\u2066", "::error::a", "\n::error::a\n##[error]a", "##vso[a.b]c", "\x00",
    "javascript:alert(1)", "<script>alert(1)</script>", "</style><img src=x onerror=alert(1)>", "]]>", "{{ 7 * 7 }}",
    "[a](javascript:alert(1))", "\ud800", "../../../../etc/passwd", "a" * 100_000, "", "=cmd()", "\u2028",
)  # fmt: skip
TEXTS = st.one_of(st.sampled_from(NASTY), st.text(max_size=20))
NUMBERS = st.sampled_from([-1, 0, 1, 2**62, -(2**62), 1e308, -1e308, 5e-324, 0.5])
OTHERS = st.sampled_from([None, True, [], {}, [[]], {"": {}}, [None]])


def _places(value, path=()):
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield from _places(item, (*path, key))


def _changed(document, data):
    """Change up to three values of a document."""
    for _ in range(data.draw(st.integers(1, 3))):
        path = data.draw(st.sampled_from([one for one in _places(document) if one]))
        inner = document
        for key in path[:-1]:
            inner = inner[key]
        kind = data.draw(st.sampled_from(["value", "value", "gone", "key"]))
        value = inner[path[-1]]
        # Most often of the same type, so that the file fits its schema.
        own = TEXTS if isinstance(value, str) else NUMBERS if isinstance(value, int | float) else OTHERS
        if kind == "gone":
            del inner[path[-1]]
        elif kind == "key" and isinstance(inner, dict):
            inner[data.draw(st.sampled_from(NASTY))] = inner.pop(path[-1])
        else:
            inner[path[-1]] = data.draw(st.one_of(own, own, own, TEXTS, NUMBERS, OTHERS))
    return document


def _check_pages(folder):
    for page in folder.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert "<script>alert" not in text
        assert "<img src=x" not in text
        assert 'href="javascript:' not in text
    for page in folder.rglob("*.md"):
        # Neither code nor a line of HTML holds Markdown.
        text = re.sub(r"(?ms)^<details>.*?$|(?<![`\\])(`+)(?!`).*?(?<!`)\1(?!`)", "", page.read_text(encoding="utf-8"))
        assert not re.search(r"(?<!\\)<(?:img|script|/style)|(?<!\\)\]\(javascript", text)


@pytest.mark.parametrize(
    ("place", "commands", "examples"),
    [
        (
            "result/result.json",
            (
                "replay {}/result", "report {}/result", "diff {}/result {}/result", "sign {}/result --key {key}",
                "report {}/result --format annotations --format badge --format sarif --format ctrf --format gitlab",
            ),
            30,
        ),
        ("load/latency.json", ("report {}/load", "compare {}/load {}/load"), 6),
        ("fleet/fleet.json", ("report {}/fleet",), 40),
        ("result/description/openapi.json", ("replay {}/result", "diff {}/result {}/result"), 40),
    ],
)  # fmt: skip
def test_changed_values(well_made, tmp_path_factory, place, commands, examples):
    folder = well_made.sent(tmp_path_factory.mktemp("changed") / "sent")

    @settings(max_examples=examples, database=None)
    @given(st.data())
    def each(data):
        document = _changed(well_made.document(place), data)
        (folder / place).write_text(json.dumps(document), encoding="utf-8")
        for command in commands:
            check(run(command, folder), 0, 1, 2, 4)
        _check_pages(folder)

    each()


STATEMENT = Path(__file__).parents[2] / "reference_robot" / "statement.toml"


@settings(max_examples=100, database=None)
@given(st.data())
def test_changed_statements(tmp_path_factory, data):
    """A statement with other characters in it is read, or refused with a message."""
    text = STATEMENT.read_text(encoding="utf-8")
    at = data.draw(st.integers(0, len(text)))
    more = data.draw(st.sampled_from([*NASTY, "=", "[", "[[", '"', "'''", "nan", "1e999", "a.b.c = 1\n", "\n\n[x]"]))
    path = tmp_path_factory.mktemp("statement") / "robot.toml"
    path.write_bytes((text[:at] + more + text[at + data.draw(st.integers(0, 40)) :]).encode("utf-8", "surrogatepass"))
    said = str(path)
    try:
        load_statement(path, Contract.load(DEFAULT_PACK))
    except StatementError as error:
        said = str(error)
    assert str(path) in said


MARKUP = "\n\n<img src=x onerror=alert(1)> <script>alert(1)</script> @octocat [a](javascript:alert(1)) \x1b[2J\u202e"


@pytest.mark.parametrize(
    ("place", "schema", "commands"),
    [
        ("load/latency.json", "latency", ("report {}/load", "compare {}/load {}/load --out {}/load")),
        ("fleet/fleet.json", "fleet", ("report {}/fleet",)),
        ("result/result.json", "result", ("report {}/result", "diff {}/result {}/result --out {}/result")),
    ],
)
def test_markup_in_all_texts_at_once_is_none_on_a_page(well_made, tmp_path, place, schema, commands):
    sent = well_made.sent(tmp_path / "sent")
    document = well_made.document(place)
    fits = jsonschema_rs.validator_for(json.loads((SCHEMAS / f"roaas-{schema}-1.schema.json").read_bytes())).is_valid
    for *way, last in [one for one in _places(document) if one]:
        inner = document
        for key in way:
            inner = inner[key]
        text = inner[last]
        # Dates and histograms have a form of their own, which the schema does not know in full.
        if isinstance(text, str) and last not in {"started", "finished", "at", "histogram", "response_histogram"}:
            inner[last] = text + MARKUP
            inner[last] = inner[last] if fits(document) else text
    (sent / place).write_text(json.dumps(document), encoding="utf-8")
    for command in commands:
        check(run(command, sent), 0, 1, 4)
    assert any("img src" in page.read_text(encoding="utf-8") for page in (sent / place).parent.rglob("*.md"))
    _check_pages((sent / place).parent)


@pytest.mark.parametrize("name", ["robots", "envelopes"])
def test_a_link_in_a_registry_leads_nothing_out_of_it(well_made, tmp_path, name):
    sent = well_made.sent(tmp_path / "sent")
    check(run("sign {}/result --key {key}", sent), 0)
    outside = tmp_path / "outside"
    outside.mkdir()
    old = outside / {"robots": "r-0123456789ab.html", "envelopes": f"{'0' * 64}.intoto.json"}[name]
    old.write_text(SECRET)
    (sent / "site").mkdir()
    (sent / "site" / name).symlink_to(outside)
    (sent / "trusted").mkdir()
    shutil.copy(sent / "keys" / PUBLIC_NAME, sent / "trusted" / "vendor.pem")
    check(run("registry build {}/result --keys {}/trusted --out {}/site", sent), 0)
    assert [path.name for path in outside.iterdir()] == [old.name]
    assert list((sent / "site" / name).iterdir())


def _net(word, wide=4, long=40):
    inner = {f"a{n}": {word: [{"$ref": f"#/components/schemas/a{n + 1}"}] * wide} for n in range(long)}
    return inner | {f"a{long}": {"type": "integer"}}


# Schemas that somebody puts into the description of a result, where no run leaves them.
NETS = {
    **{word: _net(word) for word in ("allOf", "anyOf", "oneOf")},
    "a circle of allOf": {f"a{n}": {"allOf": [{"$ref": f"#/components/schemas/a{(n + 1) % 9}"}] * 9} for n in range(9)},
    "a great value": {"a0": {"type": "string", "minLength": 10**9}},
    "a great list": {"a0": {"type": "array", "minItems": 10**9, "items": {"type": "array", "minItems": 10**9}}},
    "a great pattern": {"a0": {"type": "object", "properties": {"on": {"pattern": "(((a{999}){999}){999}){999}$"}}}},
}


@pytest.mark.parametrize("name", NETS)
def test_a_schema_in_a_result_that_no_run_leaves_there(well_made, tmp_path, name):
    sent = well_made.sent(tmp_path / "sent")
    place = sent / "result" / "description" / "openapi.json"
    document = json.loads(place.read_text(encoding="utf-8"))
    content = document["paths"]["/state"]["get"]["responses"]["200"]["content"]["application/json"]
    content["schema"] = {"$ref": "#/components/schemas/a0"}
    document.setdefault("components", {})["schemas"] = NETS[name]
    place.write_text(json.dumps(document), encoding="utf-8")
    for command in ("replay {}/result description/body-schema", "judge {}/result"):
        check(run(command, sent), 0, 1, 2, 4)

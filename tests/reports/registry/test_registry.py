"""The registry: green is what a trusted key signed, what is the latest, and what the policy accepts; nothing leaks."""

import base64
import json
import os
import re

import msgspec
import pytest
from click.testing import CliRunner
from lxml import html
from vendors import make_conformant, requirement

from reports.attestation.envelope import ENVELOPE_NAME
from reports.cli.registry import registry


def page_of(path):
    return html.document_fromstring(path.read_text())


def index(host):
    """Each robot with the word beside its name and its classes' tones."""
    page = page_of(host.site / "index.html")
    names = [name.text_content() for name in page.xpath("//table[@class='matrix']/thead//th")][1:]
    return {
        row.xpath("string(th/a)"): (
            row.xpath("string(th/span)"),
            dict(zip(names, [cell.get("class").split()[1] for cell in row.xpath("td")], strict=True)),
        )
        for row in page.xpath("//table[@class='matrix']/tbody/tr")
    }


def with_(*changed):
    """The requirements of a conformant result with others in place of some."""
    result = {"statement": {}, "causes": []}
    make_conformant(result)
    by_id = {one["id"]: one for one in (*result["requirements"], *changed)}
    return list(by_id.values())


def greens(site):
    """Places of the site, beside the legend, that are green."""
    found = []
    for path in site.rglob("*.html"):
        page = page_of(path)
        for legend in page.xpath("//p[contains(@class, 'small') and contains(@class, 'tally')]"):
            legend.getparent().remove(legend)
        found += page.xpath("//*[contains(concat(' ', @class, ' '), ' good ')]")
    return found


def test_a_robot_has_a_row_and_a_page(host):
    host.sign("one")
    done = host.build()
    assert (done.exit_code, done.stdout.splitlines()[0]) == (0, "1 of 1 robot has a valid certificate; 0 refused")
    assert index(host) == {"Courier 7": ("conformant", {"http": "good", "safety": "good", "describe": "quiet"})}
    row = page_of(host.site / "index.html").xpath("//tbody/tr")[0]
    text = row.text_content()
    for told in ("Example Robotics", "2.4", "RoAAS 1.1.0", "set 1.2", "standard effort", "key "):
        assert told in text
    assert row.get("data-may") == "0 1"
    robot = host.site / row.xpath("string(th/a/@href)")
    links = page_of(robot).xpath("//a/@href")
    for link in links:
        assert (robot.parent / link).resolve().is_relative_to(host.site.resolve())
        assert (robot.parent / link).exists()
    (envelope,) = [robot.parent / link for link in links if link.endswith(".json")]
    assert envelope.read_bytes() == (host.folder / "sent" / "one" / "certificate.intoto.json").read_bytes()


NOT_GREEN = [
    ({"days_ago": 366}, "expired"),
    ({"days_ago": -1}, "dated in the future"),
    ({"requirement_set": None}, "judged by another set of requirements"),
    ({"requirement_set": {"name": "1.2", "digest": "sha256:" + "8" * 64}}, "judged by another set of requirements"),
    ({"requirement_set": {"name": "1.1", "digest": "sha256:" + "7" * 64}}, "judged by another set of requirements"),
    ({"suite__digest": "sha256:" + "6" * 64}, "an unknown suite"),
    ({"effort": "quick"}, "too little effort"),
    ({"statement__motion_allowed": False}, "was not allowed to move"),
    ({"baseline": {"digest": "sha256:" + "1" * 64}}, "with accepted failures"),
    ({"statement__robot": {}}, "names no robot"),
]


@pytest.mark.parametrize(("changes", "word"), NOT_GREEN)
def test_what_does_not_count_is_nowhere_green(host, changes, word):
    host.sign("one", **changes)
    assert host.build().exit_code == 0
    ((found, tones),) = index(host).values()
    assert (found, tones["http"]) == (word, "quiet")
    assert greens(host.site) == []


def test_a_policy_says_what_counts(host):
    host.sign("one", effort="quick")
    (host.folder / "policy.toml").write_text('efforts = ["quick"]\nfirmware = "2.4"\n')
    host.build("--policy", str(host.folder / "policy.toml"))
    assert index(host)["Courier 7"][0] == "conformant"
    (host.folder / "policy.toml").write_text('efforts = ["quick"]\nfirmware = "2.5"\n')
    host.build("--policy", str(host.folder / "policy.toml"))
    assert index(host)["Courier 7"][0] == "another firmware"
    assert host.build("--device", "Courier 7", str(host.folder / "policy.toml"), "table1").exit_code == 0
    assert index(host)["Courier 7"][0] == "another firmware"
    refused = host.build("--device", "Courier 8", str(host.folder / "policy.toml"), "table1")
    assert (refused.exit_code, "no certificate names the device 'Courier 8'" in refused.output) == (2, True)


def test_the_latest_supersedes_whatever_it_says(host):
    host.sign("old", days_ago=5)
    failed = {
        "verdict": "not-conformant",
        "classes": {"http": "fail", "safety": "pass", "describe": "not-claimed"},
        "requirements": with_(requirement("fail", id_="http/a")),
    }
    host.sign("new", days_ago=1, **failed)
    host.build()
    assert index(host) == {"Courier 7": ("not conformant", {"http": "bad", "safety": "good", "describe": "quiet"})}
    (robot,) = (host.site / "robots").glob("*.html")
    now = [cell.text_content() for cell in page_of(robot).xpath("//section[@aria-labelledby='history']//td[3]")]
    assert now == ["counts", "superseded"]
    host.sign("newest", effort="quick", days_ago=0.5)
    host.build()
    assert greens(host.site) == [], "also where the latest does not count itself"


def test_a_class_with_an_accepted_failure_is_not_green(host):
    (host.folder / "policy.toml").write_text("baseline = true\n")
    accepted = requirement("warn", id_="http/a", expected_failure={"reason": "r", "expires": "2027-01-01"})
    host.sign("one", requirements=with_(accepted), baseline={"digest": "sha256:" + "1" * 64})
    host.build("--policy", str(host.folder / "policy.toml"))
    assert index(host)["Courier 7"][1] == {"http": "warning", "safety": "good", "describe": "quiet"}


def test_what_does_not_verify_is_listed_and_nothing_of_it_is_shown(host):
    host.sign("good")
    host.sign("foreign", vendor="stranger", statement__robot__name="Impostor")
    edited = host.sign("edited", statement__robot__name="Edited")
    envelope = json.loads(edited.read_text())
    payload = base64.b64decode(envelope["payload"]).decode().replace("Edited", "Secret-token-4711")
    edited.write_text(json.dumps(envelope | {"payload": base64.b64encode(payload.encode()).decode()}))
    swapped = host.sign("swapped")
    other = json.loads((host.folder / "sent" / "foreign" / "certificate.intoto.json").read_text())
    keyid = json.loads(swapped.read_text())["signatures"][0]["keyid"]
    other["signatures"][0]["keyid"] = keyid
    swapped.write_text(json.dumps(other))
    (host.folder / "sent" / "garbled").mkdir()
    (host.folder / "sent" / "garbled" / "certificate.intoto.json").write_text('{"token": "Secret-token-4711"')
    done = host.build()
    assert (done.exit_code, str(edited) in done.stderr) == (1, True), done.stderr
    assert list(index(host)) == ["Courier 7"]
    refused = [row.text_content() for row in page_of(host.site / "index.html").xpath("//table[@class='stacked']//td")]
    assert sorted(refused) == [
        "It is not an envelope with one signature.",
        "It is signed by a key that this registry does not trust.",
        "Its signature does not verify with the key that it names, or it is not a certificate of a run.",
        "Its signature does not verify with the key that it names, or it is not a certificate of a run.",
    ]
    for foreign in ("Impostor", "Secret-token-4711", str(host.folder), "garbled"):
        assert foreign not in host.text()
    assert len(list((host.site / "envelopes").iterdir())) == 1


def test_no_secret_of_a_result_reaches_the_site(host):
    secrets = ["10.20.30.40", "robot.internal.example", "Bearer s3cr3t", "/home/anna/token", "s3cr3t"]
    url = "https://anna:s3cr3t@robot.internal.example:7003"
    request = {"method": "GET", "url": url, "headers": {"Authorization": "Bearer s3cr3t"}, "body": None, "curl": url}
    finding = {"message": url, "expected": "10.20.30.40", "seen": 1, "request": request, "response": None}
    failed = requirement("fail", id_="http/a", reason=f"{url} at 10.20.30.40") | {"failures": [finding]}
    host.result["statement"]["endpoints"] = {"rest": url, "token_file": "/home/anna/token"}
    host.result["environment"]["platform"] = "robot.internal.example"
    host.sign(
        "one", verdict="not-conformant", classes={"http": "fail"}, requirements=[failed], target__rest=url,
        command=f"roaas certify --rest {url} --token-file /home/anna/token", notes=[url],
        class_reasons={"http": url},
    )  # fmt: skip
    # A signer of a later version may sign more than this one knows.
    later = json.loads(host.sign("later", days_ago=3).read_text())
    host.build()
    text = host.text()
    signed = [base64.b64decode(json.loads(path.read_text())["payload"]) for path in host.site.rglob("*.json")]
    assert len(signed) == 2
    assert later["payload"] in text
    for secret in secrets:
        assert (host.folder / "sent" / "one" / "result.json").read_text().count(secret), "it was planted"
        assert secret not in text
        assert not any(secret.encode() in payload for payload in signed)


def sign_another_text(host, monkeypatch, pattern, instead):
    """Sign what this suite would never write: what a pattern finds in the statement is replaced."""
    encode = msgspec.json.encode
    monkeypatch.setattr(
        "reports.attestation.signing.msgspec.json.encode", lambda value: re.sub(pattern, instead, encode(value))
    )
    host.sign("one")
    monkeypatch.undo()


def test_a_time_of_another_zone_lengthens_no_life(host, monkeypatch):
    sign_another_text(host, monkeypatch, rb'"(finished|timeCreated)":"([^"]+)Z"', rb'"\1":"\2-12:00"')
    host.build()
    assert index(host)["Courier 7"][0] == "not dated in UTC"
    assert greens(host.site) == []
    assert "data-until" not in (host.site / "index.html").read_text().partition("<tbody>")[2].partition("</tbody>")[0]


def test_an_envelope_that_holds_what_is_not_known_is_not_handed_on(host, monkeypatch):
    sign_another_text(host, monkeypatch, rb'"roaas":{', rb'"roaas":{"target":"10.20.30.40",')
    assert host.build().exit_code == 0
    assert index(host)["Courier 7"][0] == "conformant"
    assert list((host.site / "envelopes").glob("*")) == []
    assert "it holds fields that this registry does not know" in host.text()


def test_hostile_names_are_shown_and_do_nothing(host, hostile_text):
    names = [hostile_text.replace("\ud800", ""), "<script>alert(1)</script>", "../../../etc/passwd", "..", "CON"]
    names += ["/", "\0"]
    for number, name in enumerate(names):
        host.sign(str(number), statement__robot={"name": name, "vendor": name, "version": name})
    host.sign("none", statement__robot={})
    host.sign("like none", statement__robot={"name": "Unnamed robot"})
    host.build()
    pages = list(host.site.rglob("*"))
    assert {path.parent for path in pages if path.is_file()} == {
        host.site, host.site / "robots", host.site / "envelopes",
    }  # fmt: skip
    robots = list((host.site / "robots").iterdir())
    assert len(robots) == len(names) + 2
    assert all(re.fullmatch(r"[a-z0-9-]+-[0-9a-f]{12}\.html", path.name) for path in robots)
    for path in (host.site / "index.html", *robots):
        page = page_of(path)
        assert len(page.xpath("//script")) == 1
        assert not page.xpath("//img")
        assert not [link for link in page.xpath("//a/@href") if ":" in link]
        assert "{{7*7}}" in page.text_content() or "49" not in page.xpath("string(//h1)")


def test_firmwares_are_compared_by_the_rules_of_diff(host):
    host.sign("old", days_ago=9, statement__robot__version="2.3")
    host.sign("old again", days_ago=8, statement__robot__version="2.3")
    host.sign(
        "new", days_ago=1, verdict="not-conformant", classes={"http": "fail", "safety": "pass"},
        requirements=with_(requirement("fail", id_="http/a"), requirement("skip", id_="http/b")),
    )  # fmt: skip
    host.build()
    (robot,) = (host.site / "robots").glob("*.html")
    (section,) = page_of(robot).xpath("//section[starts-with(@aria-labelledby, 'change-')]")
    assert section.xpath("string(h2)") == "From firmware 2.3 to 2.4"
    assert section.xpath("string(p)").startswith("2 regressions: 1 new failure, 1 lost coverage")
    assert [item.text_content() for item in section.xpath(".//th/code")] == ["http/a", "http/b"]


def test_certificates_of_before_are_compared_class_by_class(host, monkeypatch):
    monkeypatch.setattr("reports.attestation.statement._outcomes", lambda _: {})
    old = host.sign("old", days_ago=9, statement__robot__version="2.3")
    monkeypatch.undo()
    assert "outcomes" not in base64.b64decode(json.loads(old.read_text())["payload"]).decode()
    host.sign(
        "new", verdict="not-conformant", classes={"http": "fail", "safety": "pass"},
        requirements=with_(requirement("fail", id_="http/a")),
    )  # fmt: skip
    assert host.build().exit_code == 0
    (robot,) = (host.site / "robots").glob("*.html")
    (section,) = page_of(robot).xpath("//section[starts-with(@aria-labelledby, 'change-')]")
    assert "only classes can be compared" in section.text_content()
    assert section.xpath("string(ul/li[1])") == "http: pass → fail"
    assert len(list((host.site / "envelopes").iterdir())) == 2


def test_what_is_gone_is_taken_away_and_what_is_not_ours_stays(host):
    gone = host.sign("one")
    host.sign("two", statement__robot__name="Courier 8")
    host.build()
    ours = {path for path in host.site.rglob("*") if path.is_file()}
    (host.site / "robots" / "notes.html").write_text("mine")
    gone.unlink()
    host.build()
    assert {path.name for path in (host.site / "robots").iterdir()} & {"notes.html"}
    assert len([path for path in ours if not path.exists()]) == 2
    assert list(index(host)) == ["Courier 8"]


@pytest.mark.parametrize(
    ("keys", "sent", "named"),
    [
        ("empty", "sent", "no public key"),
        ("keys", "nowhere", "nowhere"),
        ("keys", "empty", "no certificate.intoto.json"),
    ],
)
def test_what_cannot_be_read_is_told(host, keys, sent, named):
    host.sign("one")
    (host.folder / "empty").mkdir()
    words = ["build", str(host.folder / sent), "--keys", str(host.folder / keys), "--out", str(host.site)]
    done = CliRunner().invoke(registry, words, obj=type("Door", (), {"known": staticmethod(lambda _pack: {})})())
    assert (done.exit_code, named in done.stderr) == (2, True), done.stderr
    assert not host.site.exists()


def large(path):
    with path.open("wb") as file:
        file.truncate(1 << 40)


# What a vendor sends in place of a certificate: how it is made, beside the text of a good one.
BAD_ENTRIES = {
    "pipe": lambda path, _: os.mkfifo(path),
    "folder": lambda path, _: path.mkdir(),
    "device": lambda path, _: path.symlink_to("/dev/zero"),
    "link to another's": lambda path, _: path.symlink_to("/etc/hostname"),
    "dangling link": lambda path, _: path.symlink_to("nowhere"),
    "link in a circle": lambda path, _: path.symlink_to(path.name),
    "large": lambda path, _: large(path),
    "empty": lambda path, _: path.touch(),
    "no UTF-8": lambda path, _: path.write_bytes(b"\xff\xfe"),
    "deep": lambda path, _: path.write_text("[" * 100_000),
    "unsigned": lambda path, good: path.write_text(json.dumps(json.loads(good) | {"signatures": []})),
    "name twice": lambda path, good: path.write_text(good.replace("{", '{"payloadType": "text/plain", ', 1)),
}


@pytest.mark.parametrize("given", ["in a folder", "by their names"])
def test_bad_entries_are_told_and_left_out(host, given):
    good = host.sign("one").read_text()
    bad = [host.folder / ("sent" if given == "in a folder" else ".") / name / ENVELOPE_NAME for name in BAD_ENTRIES]
    for path, make in zip(bad, BAD_ENTRIES.values(), strict=True):
        path.parent.mkdir()
        make(path, good)
    (host.folder / "nothing").mkdir()
    done = host.build(more=[host.folder / "nothing", *(bad if given == "by their names" else [])])
    refused = [line for line in done.stderr.splitlines() if line.startswith("refused: ")]
    assert (done.exit_code, len(refused)) == (1, len(bad) + 1), done.output
    for path in (host.folder / "nothing", *bad):
        assert [line for line in refused if line.startswith(f"refused: {path}: ")], path
    assert done.stdout.startswith(f"1 of 1 robot has a valid certificate; {len(refused)} refused")
    assert list(index(host)) == ["Courier 7"]
    assert str(host.folder) not in host.text()


@pytest.mark.parametrize(
    ("octets", "why"), [(b"", "not a public key"), (b"\xff" * 9, "not a public key"), (None, "Is a directory")]
)
def test_a_key_that_cannot_be_used_is_told_and_left_out(host, octets, why):
    host.sign("one")
    bad = host.folder / "keys" / "a.pem"
    bad.mkdir() if octets is None else bad.write_bytes(octets)
    done = host.build()
    assert (done.exit_code, f"{bad}: {why}" in done.stderr) == (0, True), done.output
    assert done.stdout.startswith("1 of 1 robot has")


def test_a_private_key_among_the_keys_is_left_alone(host):
    host.sign("one")
    private = host.folder / "keys" / "signing-key.pem"
    private.write_bytes((host.folder / "stranger" / "signing-key.pem").read_bytes())
    done = host.build()
    assert (done.exit_code, "signing-key.pem is a private key" in done.stderr) == (0, True), done.stderr


def test_a_described_device_without_a_name_goes_by_its_descriptions_title(host, described_result):
    described_result["statement"]["robot"] = {}
    host.sign_as_it_is("described", described_result)
    host.build()
    assert described_result["api"]["title"] in index(host)
    assert f"firmware {described_result['api']['version']}" in host.text()

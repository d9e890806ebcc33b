"""A registry of certificates: it runs nothing that a vendor wrote, and counts what proves something."""

import shutil

from lxml import html
from signed_results import Vendor, conformant, dropped, outcomes, roaas, run

from reports.attestation.keys import PUBLIC_NAME

HOSTILE = "</td></script><script>alert(1)</script><img src=x onerror=alert(2)>\"'{{7*7}}\x1b[2J\u202e../../x\n"


def hostile_everywhere(value):
    """A value of JSON with a hostile text in place of each text and each name of a map."""
    match value:
        case dict():
            return {f"{HOSTILE}{place}": hostile_everywhere(one) for place, one in enumerate(value.values())}
        case list():
            return [hostile_everywhere(one) for one in value]
        case str():
            return HOSTILE
        case _:
            return value


def hostile_facts(document):
    facts = document["predicate"]["roaas"]
    for name, value in facts.items():
        if name in {"robot", "suite", "requirement_set"}:
            facts[name] = dict.fromkeys(value, HOSTILE)
        elif name not in {"extent", "requirements", "outcomes", "finished"}:
            facts[name] = hostile_everywhere(value)
    facts["outcomes"] = {HOSTILE: {HOSTILE: [HOSTILE]}}
    facts["requirements"] = {HOSTILE: 1}
    facts["extent"]["claims"] = [HOSTILE]


def registry(folder, *envelopes):
    """Build a site by the vendors' public keys, which are in a folder beside it."""
    done = roaas("registry", "build", *envelopes, "--keys", folder / "trusted", "--out", folder / "site")
    assert "Traceback" not in done.output
    return done


def trusted(folder, *vendors):
    (folder / "trusted").mkdir()
    for place, one in enumerate(vendors):
        shutil.copy(one.keys / PUBLIC_NAME, folder / "trusted" / f"{place}.pem")


def test_a_site_shows_what_a_trusted_vendor_wrote_and_runs_none_of_it(vendor, tmp_path):
    vendor.forge(conformant(), hostile_facts)
    trusted(tmp_path, vendor)
    done = registry(tmp_path, vendor.envelope)
    assert done.stdout.startswith("0 of 1 robot has a valid certificate; 0 refused"), done.output
    pages = sorted((tmp_path / "site").rglob("*.html"))
    assert len(pages) == 2
    for path in pages:
        assert path.resolve().is_relative_to(tmp_path / "site")
        page = html.document_fromstring(path.read_text())
        assert len(page.xpath("//script")) == 1
        assert not page.xpath("//img | //*[@onerror]")
        assert "\x1b" not in path.read_text()
    said = vendor.verify()
    assert (said.exit_code, "\x1b" in said.output) == (1, False)


def test_a_certificate_of_the_future_supersedes_none(vendor, tmp_path):
    """Otherwise nothing could ever supersede it."""
    trusted(tmp_path, vendor)
    folders = [tmp_path / "future", tmp_path / "now"]
    future, now = (Vendor(folder, vendor.keys) for folder in folders)
    future.forge(conformant(), run(finished="2099-01-01T00:00:00Z"))
    assert now.sign(conformant()).exit_code == 0
    done = registry(tmp_path, *folders)
    assert done.stdout.startswith("1 of 1 robot has a valid certificate"), done.output


def test_a_registry_says_that_two_keys_signed_for_one_robot(vendor, honest, tmp_path):
    trusted(tmp_path, vendor, honest)
    assert vendor.sign(conformant()).exit_code == 0
    assert registry(tmp_path, vendor.folder, honest.folder).stdout.startswith("1 of 1 robot")
    assert "2 keys in all" in (tmp_path / "site" / "index.html").read_text()


def test_a_registry_does_not_count_one_requirement_of_all(vendor, tmp_path):
    trusted(tmp_path, vendor)
    vendor.forge(conformant(), outcomes(dropped))
    done = registry(tmp_path, vendor.folder)
    assert done.stdout.startswith("0 of 1 robot has a valid certificate"), done.output
    assert "not the requirements of the suite" in (tmp_path / "site" / "index.html").read_text()


def test_a_key_that_was_removed_signs_nothing_any_more(vendor, honest, tmp_path):
    """A folder of keys is the only trust: what a removed key signed is refused, and links are read as files."""
    trusted(tmp_path, honest)
    (tmp_path / "trusted" / "link.pem").symlink_to(vendor.keys / PUBLIC_NAME)
    assert vendor.sign(conformant()).exit_code == 0
    assert registry(tmp_path, vendor.folder).exit_code == 0
    (tmp_path / "trusted" / "link.pem").unlink()
    done = registry(tmp_path, vendor.folder)
    assert (done.exit_code, "foreign key" in done.output) == (1, True), done.output

"""Which servers and files a description may reach, by what the user named."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from conformance.documents.wsdl import is_http
from conformance.transport.reach import ElsewhereError, Folder, Origin, Trust, at_server, is_same, split

NAMED = "http://robot.example:8000/v1/openapi.json"


@pytest.mark.parametrize(
    ("url", "trusted"),
    [
        ("http://robot.example:8000/other", True),
        ("http://ROBOT.Example:8000/other", True),
        ("HTTP://robot.example.:8000/", True),
        ("http://robot.example:8001/", False),
        ("http://robot.example/", False),
        ("https://robot.example:8000/", False),
        ("http://robot.example:8000@evil/", False),
        ("http://evil@robot.example:8000/", False),
        ("http://robot.example:8000.evil/", False),
        ("http://robot.example.evil:8000/", False),
        ("http://evilrobot.example:8000/", False),
        ("http://robot.example:8000\\@evil/", False),
        ("http://evil\\@robot.example:8000/", False),
        ("http:\\\\robot.example:8000/", False),
        ("http:/robot.example:8000/", False),
        ("http:///robot.example:8000/", False),
        ("//robot.example:8000/", False),
        ("http://robot%2eexample:8000/", False),
        ("http://%72obot.example:8000/", False),
        ("http://robot.example :8000/", False),
        ("http://robot.example:8000:9/", False),
        ("http://robot.example:99999/", False),
        ("http://robot.example:-1/", False),
        ("http://[robot.example]:8000/", False),
        ("http://[::1/", False),
        ("ftp://robot.example:8000/", False),
        ("file:///etc/passwd", False),
        ("data:application/json,{}", False),
        ("javascript:alert(1)", False),
        ("urn:robot", False),
        ("", False),
    ],
)
def test_a_server_is_scheme_host_and_port(url, trusted):
    assert Trust.of(NAMED).trusts(url) is trusted
    assert is_same(url, NAMED) is (trusted or "evil@robot" in url)


@pytest.mark.parametrize(
    ("named", "url", "trusted"),
    [
        ("http://robot/", "http://robot:80/x", True),
        ("https://robot:443/", "https://robot/x", True),
        ("http://robot/", "http://robot:443/", False),
        ("http://127.0.0.1/", "http://localhost/", False),
        ("http://127.0.0.1/", "http://127.1/", False),
        ("http://127.0.0.1/", "http://2130706433/", False),
        ("http://127.0.0.1/", "http://0x7f.0.0.1/", False),
        ("http://127.0.0.1/", "http://[::ffff:127.0.0.1]/", False),
        ("http://[::1]/", "http://[0:0:0:0:0:0:0:1]/", True),
        ("http://[FE80::1%25eth0]/", "http://[fe80::1%eth0]/", True),
        ("http://[fe80::1%25eth0]/", "http://[fe80::1%25eth1]/", False),
        ("http://[fe80::1%25eth0]/", "http://[fe80::1]/", False),
        ("http://bücher.example/", "http://xn--bcher-kva.example/", True),
        ("http://robot/", "http://rοbot/", False),  # noqa: RUF001 - a Greek letter
        ("http://user:pass@robot/", "http://robot/x", True),
        ("http://user:pass@robot/", "http://user:pass@robot/x", True),
        ("http://user:pass@robot/", "http://other@robot/x", False),
    ],
)
def test_forms_of_one_name(named, url, trusted):
    assert Trust.of(named).trusts(url) is trusted


@pytest.mark.parametrize(
    ("hosts", "url", "trusted"),
    [
        (["evil"], "https://evil:1/", True),
        (["EVIL."], "https://evil/", True),
        (["evil:8000"], "https://evil:8000/", True),
        (["evil:8000"], "https://evil:8001/", False),
        (["evil:443"], "https://evil/", True),
        (["[::1]:8000"], "https://[::1]:8000/", True),
        (["evil"], "https://evil.example/", False),
        (["evil"], "https://user@evil/", False),
        (["evil"], "http://evil/", False),  # what was named is https
    ],
)
def test_trusted_hosts(hosts, url, trusted):
    assert Trust.of("https://robot/", hosts=hosts).trusts(url) is trusted


def test_a_trusted_host_may_be_http_where_the_named_server_is():
    assert Trust.of("http://robot/", hosts=["evil"]).trusts("http://evil/")
    assert Trust.of("http://robot/", hosts=["evil"]).trusts("https://evil/")


@pytest.mark.parametrize("text", ["", "http://evil", "user@evil", "evil/x", "evil:x", "a b", "evil\\x", "evil?x"])
def test_what_is_no_trusted_host(text):
    with pytest.raises(ValueError, match=r"."):
        Trust.of(hosts=[text])


def test_a_request_goes_to_the_name_that_the_user_wrote():
    trust = Trust.of("http://me:secret@Straße.example:80/openapi.json")
    assert trust.place("http://strasse.example/x?y#z") == "http://Straße.example:80/x?y"
    assert at_server("http://Inside:1/x?wsdl", "http://inside:1", "https://front/") == "https://front/x?wsdl"
    assert at_server("http://inside:10/x", "http://inside:1", "https://front") == "http://inside:10/x"


@given(st.text(alphabet="robt.:/@\\%[]evil#?1\t\r\n ", max_size=20))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_whatever_a_description_writes_a_request_goes_to_the_user_s_server(tail):
    trust = Trust.of("http://robot:1/")
    for url in (f"http://{tail}", f"http://robot:1{tail}", tail):
        if trust.trusts(url):
            assert Origin.of(trust.place(url)) == ("http", "robot", 1)
            assert trust.place(url).startswith("http://robot:1/")


@pytest.fixture
def folder(tmp_path):
    inside = tmp_path / "api"
    inside.mkdir()
    for name in ("api/openapi.json", "api/part.json", "secret.json"):
        (tmp_path / name).write_text("{}")
    (inside / "link.json").symlink_to(tmp_path / "secret.json")
    (inside / "up").symlink_to(tmp_path)
    return inside


@pytest.mark.parametrize(
    "path",
    [
        "{0}/../secret.json", "{0}/link.json", "{0}/up/secret.json", "/etc/passwd", "file:///etc/passwd",
        "//host/share", "\\\\host\\share\\x.json", "ftp://host/x", "data:,x", "/dev/zero", "/proc/self/environ",
    ],
)  # fmt: skip
def test_a_description_reads_no_file_outside_its_folder(folder, path):
    with pytest.raises(ElsewhereError):
        Folder(str(folder / "openapi.json")).read(path.format(folder))


def test_what_a_description_may_read(folder):
    source = str(folder / "openapi.json")
    assert Folder(source).read(f"{folder}/part.json") == b"{}"
    assert Folder(source, anywhere=True).read(f"{folder}/../secret.json") == b"{}"
    assert Folder(source, (str(folder.parent / "secret.json"),)).read(str(folder.parent / "secret.json")) == b"{}"
    with pytest.raises(ElsewhereError):
        Folder("http://robot/openapi.json", anywhere=True).read(f"{folder}/part.json")
    with pytest.raises(ValueError, match="no file"):
        Folder(source, anywhere=True).read("/dev/zero")


@pytest.mark.parametrize("url", ["ftp://a/b", "http:///x", "http://a:0/", "http://[/", "http://a:99999/", "a", ""])
def test_what_is_no_http_url(url):
    assert not is_http(url)


def test_credentials_are_no_part_of_the_authority():
    assert split("http://me:secret@robot:1/a?b") == ("http://robot:1", "/a?b")

"""Who is let in, and where clients are told that the robot is: hosts, origins, tokens with scopes, TLS, proxies."""

import ssl
from ipaddress import ip_network
from pathlib import Path

import httpx
import pytest
from lxml import etree
from web_certificate import pair
from web_messages import delivery_envelope, delivery_path, twist
from web_robot import eventually, problem, running_robot, usage_error

from conformance.contract.pack import Contract
from proof.selftest.certifying import Job, run_job
from proof.table1.selftest import REFERENCE
from reference_robot.webservices.http.access import Admission, Authorization
from reference_robot.webservices.http.hosts import Address, AllowedHosts, TrustedProxies, is_loopback, take_forwarded
from reference_robot.webservices.http.messages import Request
from reference_robot.webservices.representation.problems import Problem

GOAL = "/robot/navigation/action/goal/"
SUBSCRIBERS = "/turtlesim_subscriber_ws"
PUBLIC = "https://out.example/r2"


class Unscoped:
    def needed(self, request: Request) -> None:
        raise AssertionError(f"nobody asks for a token, but {request} did")


def admitted(admission: Admission, method: str = "GET", **headers: str) -> int:
    """Return the status by which a request is refused, 0 where it is let in."""
    fields = {name.encode(): value.encode() for name, value in headers.items()}
    try:
        admission.check(Request(method, b"/", fields, keep_alive=True), Unscoped())
    except Problem as problem:
        return problem.status
    return 0


OURS = ("localhost", "LOCALHOST.:7003", "robot.localhost", "127.0.0.1", "127.0.0.1:7003", "[::1]:7003", "[fe80::1]")
OURS += ("192.0.2.7:80", "Robot", "robot:81", "", "a.example.")
STRANGE = ("evil.test", "robot.evil.test", "localhost.evil.test", "evillocalhost", "example", "127.0.0.1.evil.test")
STRANGE += ("0x7f000001", "2130706433", "robot@evil.test", "é", "evil.test#localhost", "robot evil.test", "[::1")
STRANGE += ("robot:80:90", "127.1")


@pytest.mark.parametrize(
    ("host", "is_allowed"), [*((host, True) for host in OURS), *((host, False) for host in STRANGE)]
)
def test_only_the_robot_s_own_names_and_addresses_are_answered(host, is_allowed):
    admission = Admission(Authorization(None), AllowedHosts(["robot", ".example"]))
    assert admitted(admission, host=host) == (0 if is_allowed else 421)
    assert admitted(Admission(Authorization(None), AllowedHosts(["*"])), host=host) == 0


@pytest.mark.parametrize(
    ("origin", "status"),
    [
        ("http://robot:7003", 0),
        ("https://ROBOT:7003", 0),
        ("https://public.example", 0),
        ("http://robot", 403),
        ("http://robot:8080", 403),
        ("http://evil.test", 403),
        ("http://public.example", 403),
        ("null", 403),
        ("", 403),
    ],
)
def test_pages_of_other_origins_command_nothing_and_may_read_what_browsers_let_them(origin, status):
    admission = Admission(Authorization(None), AllowedHosts(["robot"]), ["https://public.example"])
    for method in ("PUT", "POST", "DELETE", "PATCH"):
        assert admitted(admission, method, host="robot:7003", origin=origin) == status
        assert admitted(admission, method, host="robot:7003") == 0
    assert admitted(admission, "GET", host="robot:7003", origin=origin) == 0
    assert admitted(admission, "PUT", origin=origin) == (0 if origin == "https://public.example" else 403)


def test_an_absolute_target_says_which_host_is_asked_for():
    asked = [Request("GET", target, {b"host": b"evil.test"}, keep_alive=True) for target in (b"http://[::1]:80/", b"/")]
    assert [request.authority for request in asked] == [b"[::1]:80", b"evil.test"]


def test_a_client_is_told_the_public_address_or_the_one_by_which_it_came():
    asked = Request("GET", b"/", {b"host": b"robot:8080"}, keep_alive=True)
    nameless = Request("GET", b"/", {}, keep_alive=True)
    proxied = Request("GET", b"/", {b"host": b"robot"}, keep_alive=True)
    proxied.scheme = "https"
    address, public = Address("http://[::1]:7003"), Address("http://[::1]:7003", PUBLIC)
    told = [address(request) for request in (asked, nameless, proxied)]
    assert told == ["http://robot:8080", "http://[::1]:7003", "https://robot"]
    assert (address.location(GOAL), public.location(GOAL)) == (GOAL.encode(), (PUBLIC + GOAL).encode())
    assert public(asked) == PUBLIC


def test_the_word_of_proxies_that_are_trusted_is_taken():
    proxies = TrustedProxies([ip_network("10.0.0.0/8"), ip_network("::1")])
    peers = [("10.1.2.3", 5), ("::ffff:10.1.2.3", 5, 0, 0), ("::1", 5, 0, 0), ("11.0.0.1", 5), ("fe80::1%lo", 5), None]
    assert [proxies.include(peer) for peer in peers] == [True, True, True, False, False, False]
    assert not TrustedProxies().include(("127.0.0.1", 5))
    told = {b"host": b"inner", b"x-forwarded-host": b"spoofed, outer:8", b"x-forwarded-proto": b"http,HTTPS"}
    request = Request("GET", b"/", told, keep_alive=True)
    take_forwarded(request)
    assert (request.authority, request.scheme) == (b"outer:8", "https")
    request = Request("GET", b"/", {b"host": b"inner", b"x-forwarded-proto": b"gopher"}, keep_alive=True)
    take_forwarded(request)
    assert (request.authority, request.scheme) == (b"inner", "")


@pytest.mark.parametrize(
    ("host", "is_it"), [("localhost", True), ("::1", True), ("127.8.9.1", True), ("192.0.2.1", False)]
)
def test_loopback_is_what_other_machines_do_not_reach(host, is_it):
    assert is_loopback(host) == is_it


def test_what_cannot_be_listened_with_is_named(tmp_path):
    certificate, key = pair(tmp_path, "robot")
    _, another = pair(tmp_path, "another")
    _, locked = pair(tmp_path, "locked", "-passout", "pass:word")
    for options, said in {
        ("--host=0.0.0.0",): "--insecure",
        (f"--tls-cert={certificate}",): "give both --tls-cert and --tls-key",
        (f"--tls-cert={certificate}", f"--tls-key={another}"): f"{another} is not the key of --tls-cert {certificate}",
        (f"--tls-cert={key}", f"--tls-key={key}"): f"--tls-cert {key} holds no certificate in PEM",
        (f"--tls-cert={certificate}", f"--tls-key={certificate}"): f"--tls-key {certificate} holds no private key",
        (f"--tls-cert={certificate}", f"--tls-key={locked}"): f"--tls-key {locked} is encrypted",
        (f"--tls-cert={tmp_path}", f"--tls-key={key}"): "--tls-cert",
        ("--allowed-host=http://robot",): "--allowed-host 'http://robot'",
        ("--allowed-host=robot:80",): "without scheme and port",
        ("--public-url=robot.example",): "--public-url 'robot.example'",
        ("--public-url=soap=https://a/?x",): "without query",
        ("--public-url=http://a:b",): "--public-url 'http://a:b'",
        ("--public-url=http://a", "--public-url=rest=http://b"): "rest has http://a already",
        ("--trusted-proxy=proxy",): "--trusted-proxy 'proxy'",
        ("--trusted-proxy=10.0.0.1/8",): "host bits",
    }.items():
        assert said in usage_error(*options), options


TOKENS = "# for the tests\nall\nlook read\ndrive move read\norder deliver\n"


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}


def test_https_tokens_with_scopes_and_the_public_address(domain_id, tmp_path):
    """One robot with everything on, as it stands behind a proxy and in front of a network."""
    certificate, key = pair(tmp_path, "robot")
    tokens = tmp_path / "tokens"
    tokens.write_text(TOKENS)
    options = [f"--tls-cert={certificate}", f"--tls-key={key}", f"--token-file={tokens}", "--time-scale=20"]
    options += ["--trusted-proxy=127.0.0.1", "--allowed-host=proxy.example"]
    options += ["--public-url=rest=https://out.example/r2/"]
    trusted = ssl.create_default_context(cafile=str(certificate))
    with running_robot(domain_id, *options, verify=trusted) as served:
        assert served.rest.startswith("https://127.0.0.1:")
        assert served.publishers.startswith("https://127.0.0.1:")
        get, put = served.client.get, served.client.put
        pose = served.rest + "/robot/pose/"
        eventually(lambda: get(pose, headers=bearer("look")).status_code == 200)

        # Scopes: what each token may do, over both interfaces.
        deliver = (served.publishers, delivery_envelope())
        look = (served.subscribers, envelope("GetPose"))
        asked = {
            "read": [("GET", pose, None), ("HEAD", served.rest + GOAL, None), ("POST", *look)],
            "move": [("PUT", served.rest + "/robot/velocity/", twist(x=0.1)), ("DELETE", served.rest + GOAL, None)],
            "deliver": [("PUT", served.rest + delivery_path(), None), ("POST", *deliver)],
        }
        good_for = {"all": set(asked), "look": {"read"}, "drive": {"read", "move"}, "order": {"deliver"}}
        for token, scopes in good_for.items():
            for scope, requests in asked.items():
                for method, url, body in requests:
                    named = {"json": body} if method == "PUT" else {"content": body}
                    media = {"Content-Type": "text/xml"} if method == "POST" else {}
                    answer = served.client.request(method, url, headers=bearer(token) | media, **named)
                    assert (answer.status_code == 403) == (scope not in scopes), (token, method, url)
                    assert answer.status_code != 401
                    if answer.status_code == 403:
                        challenge = f'Bearer realm="robot", error="insufficient_scope", scope="{scope}"'
                        assert answer.headers["WWW-Authenticate"] == challenge
                        assert method == "HEAD" or scope in answer.json()["detail"]
            assert served.client.options(pose, headers=bearer(token)).status_code == 204

        # Hosts and origins: refused before the token is looked at, or in spite of it.
        assert "--allowed-host" in problem(get(pose, headers={"Host": "evil.test"}), 421)
        forged = put(served.rest + delivery_path(), headers=bearer("all") | {"Origin": "https://evil.test"})
        assert forged.status_code == 403

        # Where clients are told that the robot is.
        proxied = bearer("all") | {"X-Forwarded-Host": "proxy.example", "X-Forwarded-Proto": "http"}
        for headers, soap in ((bearer("all"), served.subscribers), (proxied, "http://proxy.example" + SUBSCRIBERS)):
            assert get(served.rest + "/openapi.json", headers=headers).json()["servers"] == [{"url": PUBLIC}]
            wadl = etree.fromstring(get(served.rest + "/application.wadl", headers=headers).content)
            assert wadl.find("{*}resources").get("base") == PUBLIC + "/"
            wsdl = etree.fromstring(get(served.subscribers + "?wsdl", headers=headers).content)
            assert wsdl.find(".//{*}address").get("location") == soap

        assert_only_tls_from_1_2(served.rest, certificate)
        assert_certified_over_https(served, certificate)


def envelope(operation: str) -> str:
    return (
        '<s:Envelope xmlns:s="http://schemas.xmlsoap.org/soap/envelope/"><s:Body>'
        f'<t:{operation} xmlns:t="http://soap.turtlebot.mybot.org/"/></s:Body></s:Envelope>'
    )


def assert_only_tls_from_1_2(rest: str, certificate: Path) -> None:
    old = ssl.create_default_context(cafile=str(certificate))
    with pytest.warns(DeprecationWarning, match="TLSv1_1"):
        old.minimum_version = old.maximum_version = ssl.TLSVersion.TLSv1_1
    old.set_ciphers("ALL:@SECLEVEL=0")
    for verify in (old, True):  # one speaks too old a TLS, one does not know the authority
        with pytest.raises(httpx.ConnectError):
            httpx.get(rest, verify=verify, timeout=60)
    with pytest.raises(httpx.RemoteProtocolError):
        httpx.get(rest.replace("https", "http"), timeout=60)


def assert_certified_over_https(served, certificate: Path) -> None:
    """Have the suite judge what depends on TLS, tokens and addresses: raw sockets, zeep, a WSDL's own address."""
    asked = ("http/authentication", "web-server/pipelining", "describe/wsdl-address", "soap-subscribers/interop")
    services = [f"{url}?wsdl" for url in (served.publishers, served.subscribers)]
    named = {
        "requirements": asked,
        "secrets": {"token_file": TOKENS.split()[-5]},
        "endpoints": {"ca_file": str(certificate)},
    }
    outcome = run_job(Job(Contract.load().directory, REFERENCE.statement, served.rest, *services, **named))
    assert outcome.verdicts == dict.fromkeys(asked, "pass"), outcome.reasons

"""No secret of a run is in what it writes, however the device repeats it, nor in a list of processes."""

import gzip
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from echoing_device import ENCODINGS, EchoingService, echoing_device, leaks
from processes import ended
from small_device import certified
from soap_devices import serving

from conformance.commandline.secrecy import SECRETS
from conformance.scenarios.stored import TRACES_NAME

# What each run sends as proof of who it is: the file that has it, and the part of it that is secret.
_TOKEN = "tok3n/of+this&run-93jd82hd"  # noqa: S105 - of no device
_QUERY, _MORE, _COOKIE = "k3y-in query&hdr", "h3ad er-value\"1'", "c00kie-0f-mine"
_BASIC, _DIGEST, _WSSE = "pa55 wörd/43", "d1gest pass&wörd", "wsse-pa55 word"
_LOGIN, _GIVEN = "l0gin pass/word", "g1ven-by-the-device-8842"
_SESSION = "5e55ion-0f-th1s-run"


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """Write each credential to a file of its own; return the folder."""
    folder = tmp_path / "kept"
    folder.mkdir()
    for name, text in {
        "token": _TOKEN,
        "key": _QUERY,
        "headers": f"X-More: {_MORE}\nCookie: id={_COOKIE}; theme=dark\n",
        "cookie": _COOKIE,
        "basic": f"operator:{_BASIC}",
        "digest": f"operator:{_DIGEST}",
        "wsse": f"operator:{_WSSE}",
        "login": json.dumps({"user": "operator", "password": _LOGIN}),
    }.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


@pytest.fixture
def device() -> Iterator[str]:
    with echoing_device() as url:
        yield url


def _options(kept: Path) -> list[object]:
    return ["--token-file", kept / "token", "--api-key", "query key", "--api-key-file", kept / "key"]


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("secret", [_TOKEN, _MORE, _BASIC])
def test_the_search_finds_each_form(tmp_path, encoding, secret):
    written = ENCODINGS[encoding](f"before {secret} after")
    (tmp_path / "result.json").write_text(json.dumps([{"body": written}]), encoding="utf-8")
    (tmp_path / "traces.json.gz").write_bytes(gzip.compress(json.dumps(written).encode()))
    assert leaks(tmp_path, ["no-such-secret"], written) == []
    found = {line.partition(":")[0] for line in leaks(tmp_path, [secret], written)}
    assert found == {"result.json", "traces.json.gz", "terminal"}
    SECRETS.keep(secret, "$ROAAS_TOKEN")
    assert leaks(tmp_path / "none", [secret], SECRETS.masked(written)) == []


def test_certify_and_replay_of_a_rest_api(tmp_path, kept, device):
    out, secrets = tmp_path / "out", [_TOKEN, _QUERY, _MORE, _COOKIE, _SESSION]
    more = ["--headers-file", kept / "headers", "--call", "POST /wrong", "--never", "GET /tiring"]
    done = certified(f"{device}/openapi.json", out, *_options(kept), *more)
    assert leaks(out, secrets, done.text) == []
    failures = done.requirement("description/body-schema")["failures"]
    assert "$ROAAS_TOKEN" in json.dumps(failures), "the device's response shows that it was there"
    assert (out / TRACES_NAME).exists()
    again = ended(sys.executable, "-m", "roaas", "replay", out, "--token-file", kept / "token", "--token-for", device)
    assert again.returncode == 1, again.stdout + again.stderr
    assert "still there: description/body-schema" in again.stdout
    shown = ended(sys.executable, "-m", "roaas", "report", out)
    assert leaks(out, secrets, again.stdout, again.stderr, shown.stdout, shown.stderr) == []


def test_a_fleet_s_member_with_digest_authentication_and_a_login(tmp_path, kept):
    with echoing_device("operator", _DIGEST, _GIVEN) as url:
        (tmp_path / "robot.toml").write_text(
            f'[api]\nopenapi = "{url}/openapi.json"\n[endpoints]\nrest = "{url}"\n'
            f'digest_file = "{kept}/digest"\n[auth]\nlogin = "POST /login"\ntoken = "/access_token"\n'
            f'body_file = "{kept}/login"\nsend_as = "header X-Lease"\n[calls]\nallow = ["POST /wrong"]\n',
            encoding="utf-8",
        )
        (tmp_path / "fleet.toml").write_text('[[robot]]\nstatement = "robot.toml"\n', encoding="utf-8")
        options = ("--select", "robustness/no-server-error", "--effort", "quick", "--out", tmp_path / "out")
        done = ended(sys.executable, "-m", "roaas", "certify", "--fleet", tmp_path / "fleet.toml", *options)
    assert done.returncode == 1, done.stdout + done.stderr
    (log,) = (tmp_path / "out").rglob("certify.log")
    assert "robustness/no-server-error" in log.read_text(encoding="utf-8")
    secrets = [_DIGEST, _LOGIN, _GIVEN, _GIVEN[::-1], _SESSION]
    assert leaks(tmp_path / "out", secrets, done.stdout, done.stderr) == []


def test_certify_of_a_soap_service(tmp_path, kept):
    credentials = ["--basic-file", kept / "basic", "--username-token-file", kept / "wsse", "--api-key", "cookie sid"]
    with serving(EchoingService()) as url:
        done = certified(f"{url}/scale.wsdl", tmp_path / "out", *credentials, "--api-key-file", kept / "cookie")
    assert "$ROAAS_BASIC" in json.dumps(done.result["requirements"])
    assert leaks(tmp_path / "out", [_BASIC, _WSSE, _COOKIE], done.text) == []


def test_what_is_too_short_to_mask_is_said(tmp_path, kept, device):
    (kept / "token").write_text("admin", encoding="utf-8")
    done = certified(f"{device}/openapi.json", tmp_path / "out", "--token-file", kept / "token", "--class", "http")
    told = [note for note in done.result["notes"] if "$ROAAS_TOKEN" in note]
    assert [note.partition(":")[0] for note in told] == [
        "The secret behind $ROAAS_TOKEN is a short word or number, as other texts have it"
    ]

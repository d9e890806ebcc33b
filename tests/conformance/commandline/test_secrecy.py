"""Every form of a secret is masked, and nothing else."""

import base64
import gzip
import html
import json
import quopri
from urllib.parse import quote, quote_plus

import pytest
from hypothesis import given
from hypothesis import strategies as st

from conformance.commandline.secrecy import Secrets

_PLAIN = "s3cr&t wörd/42-Äx"
_TOKEN = "eyJhbGciOi.9f8sd7f-Q_x"  # noqa: S105 - of no device


def _each(text, write, only=None):
    return "".join(write(char) if only is None or number % only == 0 else char for number, char in enumerate(text))


def _percent(text, only=None):
    return _each(text, lambda char: "".join(f"%{octet:02X}" for octet in char.encode()), only)


_FORMS = {
    "as it is": lambda s: s,
    "lower": str.lower,
    "upper": str.upper,
    "swapped case": str.swapcase,
    "percent": lambda s: quote(s, safe=""),
    "percent, plus": quote_plus,
    "percent, all": _percent,
    "percent, lower": lambda s: _percent(s).lower(),
    "percent, some": lambda s: _percent(s, 3),
    "percent, twice": lambda s: quote(_percent(s, 2)),
    "percent, three times": lambda s: quote(quote(_percent(s, 2))),
    "json": json.dumps,
    "json twice": lambda s: json.dumps(json.dumps(s)),
    "json, all": lambda s: _each(s, lambda char: f"\\u{ord(char):04x}"),
    "json, some upper": lambda s: _each(s, lambda char: f"\\u{ord(char):04X}", 2),
    "json of that": lambda s: json.dumps(_each(s, lambda char: f"\\u{ord(char):04x}", 2)),
    "json, solidus": lambda s: s.replace("/", "\\/"),
    "hex escapes": lambda s: _each(s, lambda char: f"\\x{ord(char):02x}"),
    "bytes": lambda s: repr(s.encode()),
    "html": html.escape,
    "html twice": lambda s: html.escape(html.escape(s)),
    "decimal entities": lambda s: _each(s, lambda char: f"&#{ord(char)};"),
    "padded entities": lambda s: _each(s, lambda char: f"&#x{ord(char):06X};", 2),
    "entities of percent": lambda s: html.escape(_percent(s, 2)),
    "quoted-printable": lambda s: quopri.encodestring(s.encode(), quotetabs=True).decode(),
    "quoted-printable, all": lambda s: "".join(f"={octet:02X}" for octet in s.encode()),
    "hex": lambda s: s.encode().hex(),
    "hex upper": lambda s: s.encode().hex().upper(),
    "hex with colons": lambda s: s.encode().hex(":"),
    "hex with spaces": lambda s: s.encode().hex(" ").upper(),
    "hex of C": lambda s: ", ".join(f"0x{octet:02X}" for octet in s.encode()),
    "a list of bytes": lambda s: str(list(s.encode())),
    "a list of bytes in json": lambda s: json.dumps(list(s.encode()), indent=2),
    "json of a buffer": lambda s: json.dumps({"data": list(s.encode())}, separators=(",", ":")),
    "braces": lambda s: _each(s, lambda char: f"\\u{{{ord(char):x}}}"),
    "long escapes": lambda s: _each(s, lambda char: f"\\U{ord(char):08x}"),
    "javascript's escape": lambda s: _each(s, lambda char: f"%u{ord(char):04X}"),
    "utf-16": lambda s: s.encode("utf-16-le").decode("latin-1") if s.isascii() else s,
    "utf-16 in json": lambda s: json.dumps("\0".join(s)),
    "two lines": lambda s: f"{s[:9]}\n{s[9:]}",
    "two lines in json": lambda s: json.dumps(f"{s[:9]}\r\n  {s[9:]}"),
    "mime": lambda s: base64.encodebytes(b"#" * 50 + s.encode() + b"#" * 20).decode(),
    "latin-1 header": lambda s: s.encode().decode("latin-1"),
    "cut": lambda s: f"{s[:-3]}…",
    "cut after four": lambda s: f"{s[:4]}...",
    "cut in json": lambda s: json.dumps(f"{s[:7]}…"),
    "cut in quotes": lambda s: f"`{s[:-2]}`",
}
_FORMS |= {
    f"base64 {before} {name}": lambda s, before=before, write=write, code=code: write(
        b"#" * before + s.encode(code) + b"##"
    ).decode()
    for before in range(5)
    for code in ("utf-8", "utf-16-le")
    for name, write in (("std", base64.b64encode), ("url-safe", base64.urlsafe_b64encode))
}


@pytest.mark.parametrize("secret", [_PLAIN, _TOKEN])
@pytest.mark.parametrize("form", _FORMS)
def test_every_form_is_masked_in_text_and_in_json(form, secret):
    secrets = Secrets()
    secrets.keep(secret, "$ROAAS_TOKEN")
    around = ("", "") if "base64" in form or form == "mime" else ("before, ", " and after")
    text = _FORMS[form](secret).join(around)
    for shown in (secrets.masked(text), secrets.masked_json({"a": [text]})["a"][0]):
        assert shown.count("$ROAAS_TOKEN") == 1
        # Beside what is around it, no more than quotation marks, and characters of base64 that others decide as well.
        assert len(shown) <= len("$ROAAS_TOKEN") + len("".join(around)) + (110 if form == "mime" else 16)
    assert secrets.masked(secrets.masked(text)) == secrets.masked(text)


def test_what_is_around_it_stays():
    secrets = Secrets()
    secrets.keep(_TOKEN, "$ROAAS_TOKEN")
    text = json.dumps({"a": f"\n{_TOKEN}\\u{_TOKEN}", "b\u00e9": [1, None, "%41 &amp; =41 \\u0041"]})
    assert json.loads(secrets.masked(text))["b\u00e9"] == [1, None, "%41 &amp; =41 \\u0041"]
    assert secrets.masked("eyJhbGciOi.another") == "eyJhbGciOi.another"


@pytest.mark.parametrize("secret", ["abc", "x1-4", "admin", "123456", "conformant", "requirements", "Robustness"])
def test_what_is_too_short_or_a_word_is_told_and_not_masked(secret):
    secrets = Secrets()
    secrets.keep(secret, "$ROAAS_BASIC")
    assert secrets.masked(f'{{"{secret}": "{secret}"}}') == f'{{"{secret}": "{secret}"}}'
    (note,) = secrets.notes
    assert "$ROAAS_BASIC" in note
    assert secret not in note


def test_a_device_that_gives_ever_new_secrets_slows_nothing_down():
    secrets = Secrets()
    secrets.keep(_TOKEN, "$ROAAS_TOKEN")
    for number in range(1000):
        secrets.keep(f"given-by-the-device-{number}", "$ROAAS_LOGIN")
    assert secrets.masked(f"{_TOKEN}, given-by-the-device-7") == "$ROAAS_TOKEN, $ROAAS_LOGIN"
    assert "more than 100" in secrets.notes[0]


def test_bytes_are_masked_also_where_they_are_compressed():
    secrets = Secrets()
    secrets.keep(_PLAIN, "$ROAAS_TOKEN")
    body = json.dumps({"you sent": _PLAIN}).encode()
    assert gzip.decompress(secrets.masked_bytes(gzip.compress(body))) == b'{"you sent": "$ROAAS_TOKEN"}'
    assert secrets.masked_bytes(_PLAIN.encode()) == b"$ROAAS_TOKEN"
    assert secrets.masked_bytes(gzip.compress(b"a")[:9]) == gzip.compress(b"a")[:9]
    assert secrets.masked_json({"a": (b"\xff" + _PLAIN.encode(), 1)}) == {"a": [b"\xff$ROAAS_TOKEN", 1]}


def test_cookies_that_a_device_gives_and_passwords_in_urls_are_masked():
    secrets = Secrets()
    secrets.keep_userinfo("certify http://me:op%40n-sesame@robot/ --out x")
    assert secrets.masked("op@n-sesame, op%40n-sesame") == "$ROAAS_URL_PASSWORD, $ROAAS_URL_PASSWORD"
    headers = {"Set-Cookie": ["id=47-11; Path=/", "b=9"], "x": "Set-Cookie: id=47-11; Path=/"}
    assert secrets.masked_json(headers) == {
        "Set-Cookie": ["id=$ROAAS_SET_COOKIE; Path=/", "b=$ROAAS_SET_COOKIE"],
        "x": "Set-Cookie: id=$ROAAS_SET_COOKIE; Path=/",
    }
    assert secrets.masked_json([["set-cookie", "id=4711"]]) == [["set-cookie", "id=$ROAAS_SET_COOKIE"]]


def test_digests_of_a_password_are_masked():
    secrets = Secrets()
    secrets.keep(_TOKEN, "$ROAAS_TOKEN")
    sent = 'Digest username="op", nc=1, response="6629fae49393a05397450978507c4ef1", qop=auth'
    shown = sent.replace("6629fae49393a05397450978507c4ef1", "$ROAAS_DIGEST")
    assert secrets.masked(sent) == shown
    assert secrets.masked(json.dumps(json.dumps(sent))) == json.dumps(json.dumps(shown))
    block = '<w:Password Type="http://x#PasswordDigest">{}</w:Password>'
    assert secrets.masked(block.format("tuDjA9DfcWZbSsPtoZz7EOmVOEo=")) == block.format("$WSSE_DIGEST")


@given(st.text('\\u%&#;=0123456789abcdef\n"', max_size=400))
def test_hostile_text_is_neither_slow_nor_changed(text):
    secrets = Secrets()
    secrets.keep("zz-secret-of-mine", "$ROAAS_TOKEN")
    assert secrets.masked(text) == text


@pytest.mark.parametrize("text", ["\\" * 200_000, "%25" * 100_000, "&amp;" * 50_000, "=\n" * 100_000, "…x" * 100_000])
def test_a_bomb_of_escapes_takes_no_time(text):
    secrets = Secrets()
    secrets.keep("zz-secret-of-mine", "$ROAAS_TOKEN")
    assert secrets.masked(text) == text


@pytest.mark.parametrize(
    ("name", "text", "shown"),
    [
        ("conveyor", "conveyor 1.4.0", "conveyor 1.4.0"),
        ("conveyor", "Bearer conveyor-belt-7 of conveyor", "Bearer $T of conveyor"),
        ("conveyor", "conveyor-belt", "$T"),
        ("conveyor-belt-7", "conveyor-belt-7", "$T"),
        ("belt", "conveyor", "$T"),
    ],
)
def test_a_name_with_which_a_secret_begins_is_shown(name, text, shown):
    secrets = Secrets()
    secrets.spare(name)
    secrets.keep("conveyor-belt-7", "$T")
    assert secrets.masked(text) == shown

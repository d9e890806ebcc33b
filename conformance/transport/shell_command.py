"""Shell commands that send a request again: curl, or Python where curl would change it.

A command is one line, so that it survives terminals, tables and pages. Variables of credentials (``$ROAAS_TOKEN``) are
expanded wherever they stand, in base64 too.
"""

import base64
import re
import shlex
import zlib
from collections.abc import Sequence
from urllib.parse import urlsplit

from conformance.transport.credentials import is_shown, quoted

_PLAIN_LIMIT = 4000
# Placeholder for a digest, which curl computes itself.
_DIGEST = "Digest $ROAAS_DIGEST"
# Fields that curl writes itself.
_OF_CURL = frozenset({"content-length", "connection", "user-agent", "host"})
# Characters that curl sends unchanged: it refuses or changes all others.
_TARGET = re.compile(r"[\x21\x22\x24-\x7e]*")
_NAME = re.compile(r"[!#$%&'*+.^_`|~0-9A-Za-z-]+")
_FIELD = re.compile(r"[!-9;-~]+")
_VALUE = re.compile(r"[\x20-\x7e]*")
_EXPECTED = 1024  # curl announces longer bodies by Expect: 100-continue
_REVEALED = (
    r'o=re.sub(rb"\$(ROAAS_[A-Z0-9_]+)",lambda m:os.environb.get(m[1],m[0]),zlib.decompress(base64.b64decode("{}")))'
)
# Python code that reads until the device closes the connection or is silent for three seconds.
_TALK = (
    "s=socket.create_connection(({host!r},{port}),10){tls};s.sendall(o);"
    '[sys.stdout.buffer.write(d) for d in iter(lambda:s.recv(65536) if getattr(s,"pending",int)() '
    'or select.select([s],[],[],3)[0] else b"",b"")]'
)


def shell_command(method: str, url: str, headers: Sequence[tuple[str, str]], body: bytes, query: str) -> str:
    """Return a command that sends a request.

    Args:
        method: HTTP method.
        url: absolute URL with the request target as sent.
        headers: (name, value) pairs with variables in place of credentials.
        body: request body.
        query: what credentials add to the URL, with variables in their place.
    """
    if not _curl_can(method, url, headers, body):
        target = f"/{url.split('//', 1)[-1].partition('/')[2]}{query}"
        lines = [f"{method} {target} HTTP/1.1", *(f"{name}: {value}" for name, value in headers), "Connection: close"]
        head = "\r\n".join(lines).encode() + b"\r\n\r\n"
        return bytes_command(url, head + body)
    words = ["curl", "-i", "--path-as-is", "-g"]
    if method == "HEAD":
        words.append("-I")
    elif method != "GET" or body:
        words += ["-X", method]
    names = {name.lower() for name, _ in headers}
    # curl sends no Content-Length without a body, and takes Host from the URL.
    own = {("content-length", value) for name, value in headers if name.lower() == "content-length" and not body}
    own |= {("host", value) for name, value in headers if name.lower() == "host" and value != urlsplit(url).netloc}
    for name, value in headers:
        if name.lower() in _OF_CURL and (name.lower(), value) not in own:
            continue
        if value == _DIGEST:
            words += ["--digest", "-u", _DIGEST.split()[1]]
            continue
        words += ["-H", f"{name}: {value}" if value.strip() else f"{name};"]
    added = {"accept": True, "content-type": bool(body), "expect": len(body) > _EXPECTED}
    for name in [name for name, adds in added.items() if adds and name not in names]:
        words += ["-H", f"{name.title()}:"]
    pipe = ""
    if body:
        pipe, data = _body_arguments(body)
        words += ["--data-binary", data]
    words.append(url + query)
    # The shell expands the variables of credentials.
    return pipe + " ".join(quoted(word) or shlex.quote(word) for word in words)


def bytes_command(url: str, octets: bytes) -> str:
    """Return a command that writes bytes to a socket and prints the response."""
    where = urlsplit(url)
    secure = where.scheme == "https"
    host, port = where.hostname or "", where.port or (443 if secure else 80)
    tls = f";s=ssl.create_default_context().wrap_socket(s,server_hostname={host!r})" if secure else ""
    talk = _TALK.format(host=host, port=port, tls=tls).replace("'", '"')
    return f"python3 -c '{_imports('select,socket,ssl,sys')}{_python(octets)};{talk}'"


def _curl_can(method: str, url: str, headers: Sequence[tuple[str, str]], body: bytes) -> bool:
    """Return whether curl sends a request unchanged."""
    names = [name.lower() for name, _ in headers]
    return (
        bool(_NAME.fullmatch(method) and _TARGET.fullmatch(url))
        and method != "CONNECT"
        and not (method == "HEAD" and body)
        and names.count("host") <= 1
        and names.count("content-length") <= 1
        and all(_FIELD.fullmatch(name) and _VALUE.fullmatch(value) for name, value in headers)
    )


def _body_arguments(body: bytes) -> tuple[str, str]:
    """Return the command whose output is piped to curl, or an empty text, and the value of ``--data-binary``."""
    if _is_plain(body):
        text = body.decode()
        if not {"\n", "\t"} & set(text):
            return "", text
        # printf turns the escapes into line ends and tabs.
        escaped = text.replace("\\", "\\\\").replace("\n", "\\n").replace("\t", "\\t")
        return f"printf %b {quoted(escaped) or shlex.quote(escaped)} | ", "@-"
    if is_shown(body.decode("latin-1")):
        return f"python3 -c '{_imports('sys')}{_python(body)};sys.stdout.buffer.write(o)' | ", "@-"
    packed = zlib.compressobj(9, zlib.DEFLATED, 31)
    short = packed.compress(body) + packed.flush()
    if len(short) < len(body):
        return f"echo {base64.b64encode(short).decode()} | base64 -d | gunzip | ", "@-"
    return f"echo {base64.b64encode(body).decode()} | base64 -d | ", "@-"


def _imports(more: str) -> str:
    return f"import base64,os,re,zlib,{more};"


def _python(octets: bytes) -> str:
    """Return a statement of Python that sets ``o`` to bytes, with the values of variables."""
    return _REVEALED.replace("{}", base64.b64encode(zlib.compress(octets, 9)).decode())


def _is_plain(body: bytes) -> bool:
    if len(body) > _PLAIN_LIMIT or body.startswith(b"@"):
        return False
    try:
        return all(char.isprintable() or char in "\n\t" for char in body.decode())
    except UnicodeDecodeError:
        return False

"""Fuzz the readers of untrusted input: only documented exceptions, within a time and a memory limit.

``python benchmarks/fuzz_readers.py --minutes 60 --out fuzz`` changes good documents at random, in their bytes and in
their structure, and gives them to each reader in a process of its own. An input that raises anything else, takes
longer than ``--seconds``, or needs more than ``--megabytes`` is written into the folder, with what happened beside it.
``--again FILE`` reads such an input once more, by the reader that its name begins with. Exit code 1: something found.
"""

import argparse
import copy
import json
import multiprocessing
import os
import random
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import yaml
from lxml import etree

from conformance.api.rest.samples import sample
from conformance.contract.document_text import parsed
from conformance.documents.compatibility import changes
from conformance.documents.description import DescriptionError, read_description
from conformance.documents.json_schema import Shape, UnresolvedError, modern
from conformance.documents.json_text import read_json
from conformance.documents.multipart import parts_of, root_of
from conformance.documents.openapi import read_operations
from conformance.documents.representation import UnreadableError, by_itself, parse_xml, parse_yaml
from conformance.documents.soap_services import WsdlError, read_services
from conformance.documents.wadl import read_wadl
from conformance.documents.xml import NotXmlError
from conformance.transport.raw import FramingError, parse
from reports.attestation.envelope import open_envelope, statement_in
from reports.errors import ReportError
from reports.reading import read_latency, read_result

ROOT = Path(__file__).parent.parent
PACK, DATA = ROOT / "conformance/packs/table1", ROOT / "tests/reports/data"
MULTIPART = 'multipart/related; boundary=b; start="<a>"; type="application/xop+xml"'
SMALL: dict[str, Any] = {
    "openapi": "3.1.0",
    "info": {"title": "a", "version": "1"},
    "servers": [{"url": "/{v}", "variables": {"v": {"default": "1"}}}],
    "paths": {
        "/a/{b}": {
            "parameters": [{"name": "b", "in": "path", "required": True, "schema": {"type": "string"}}],
            "post": {
                "requestBody": {"content": {"application/json": {"schema": {"$ref": "#/components/schemas/A"}}}},
                "responses": {
                    "200": {"description": "", "content": {"application/json": {"schema": {"type": "array"}}}}
                },
                "callbacks": {"c": {"{$request.body#/u}": {"$ref": "#/paths/~1a~1{b}"}}},
                "security": [{"k": []}],
            },
        }
    },
    "components": {
        "schemas": {
            "A": {
                "type": "object",
                "required": ["n"],
                "properties": {"n": {"type": "integer", "minimum": 1}, "a": {"$ref": "#/components/schemas/A"}},
                "patternProperties": {"^x-": {"type": "string", "pattern": "^(a|b){1,9}$", "maxLength": 9}},
                "oneOf": [{"const": {"n": 1}}, {"enum": [1, 2]}, {"not": {"allOf": [{"minItems": 2}]}}],
            }
        },
        "securitySchemes": {"k": {"type": "apiKey", "in": "header", "name": "X-Key"}},
    },
}
SWAGGER: dict[str, Any] = {
    "swagger": "2.0",
    "info": {"title": "a", "version": "1"},
    "basePath": "/v1",
    "paths": {
        "/a": {
            "post": {
                "consumes": ["application/json"],
                "parameters": [
                    {"in": "body", "name": "b", "schema": {"$ref": "#/definitions/A"}},
                    {
                        "in": "query",
                        "name": "q",
                        "type": "array",
                        "items": {"type": "integer"},
                        "collectionFormat": "csv",
                    },
                ],
                "responses": {"200": {"description": "", "schema": {"$ref": "#/definitions/A"}}},
            }
        }
    },
    "definitions": {"A": {"type": "object", "properties": {"a": {"$ref": "#/definitions/A"}}}},
}
OVERLAY = {
    "overlay": "1.0.0",
    "actions": [
        {"target": "$.paths.*[?@.security]", "update": {"x": [1]}},
        {"target": "$..parameters[0]", "remove": True},
        {"target": "$['info']", "update": {"title": "b"}},
    ],
}
RESPONSES = [
    b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nok",
    b"HTTP/1.1 100 C\r\n\r\nHTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n2;a=b\r\nok\r\n0\r\nX: y\r\n\r\n",
    b"HTTP/1.0 404 Not Found\r\nContent-Type: text/plain\r\nSet-Cookie: a=b\r\nSet-Cookie: c=d\r\n\r\nno",
]
PARTS = (
    b"--b\r\nContent-ID: <a>\r\nContent-Type: application/xop+xml\r\n\r\n"
    b'<a><i:Include xmlns:i="http://www.w3.org/2004/08/xop/include" href="cid:x"/></a>\r\n'
    b"--b\r\nContent-ID: <x>\r\n\r\nvalue\r\n--b--\r\n"
)
TOKENS = [
    b"{", b"[", b"}", b"]", b'"', b":", b",", b"\r\n", b"\n", b"\0", b"\xff", b"\xed\xa0\x80", b"&a ", b"*a", b"<<: *a",
    b"- ", b"? ", b"!!int ", b"0x", b"1e999", b"-0", b"NaN", b"9" * 400, b"$ref", b"#/", b"../", b"<", b">", b"</",
    b"<!DOCTYPE a [<!ENTITY b 'c'>]>", b"<![CDATA[", b"xmlns:", b"maxOccurs='99999999'", b"chunked", b"&lt;",
    b"HTTP/1.1 100 Continue\r\n\r\n", b"ffffffffffffffff\r\n", b"--b--", b"\xef\xbb\xbf", b"\xff\xfe",
]  # fmt: skip
ODD: list[Any] = [
    None, True, False, 0, -1, 0.5, 2**31 - 1, 10**30, 1e308, "", "#", "a" * 300, "\ud800", "null", [], {}, [[]],
    {"$ref": "#"}, {"$ref": "#/components/schemas/A"}, {"$ref": "b.json#/a"}, {"type": ["null", "string"]}, {"": {}},
    {"allOf": [{"$ref": "#/components/schemas/A"}] * 9}, {"pattern": "((a{99}){99}){99}"}, {"minItems": 10**9},
]  # fmt: skip


@dataclass(frozen=True)
class Reader:
    """One reader.

    Attributes:
        seeds: good documents.
        read: reads one.
        allowed: the exceptions that its documentation names.
        kind: how documents are changed beside their bytes: json, xml or nothing.
    """

    seeds: list[bytes]
    read: Callable[[bytes], object]
    allowed: tuple[type[Exception], ...] = ()
    kind: str = ""


def _description(octets: bytes) -> object:
    found = read_description("a.yaml", lambda source: octets if source == "a.yaml" else json.dumps(SMALL).encode())
    for operation in read_operations(found.document):
        for body in operation.bodies.values():
            sample(body.schema, whole=True)
    return found


def _schema(octets: bytes) -> object:
    schema = modern(parsed(octets))
    return Shape(schema).problem(json.loads(octets)) if isinstance(schema, dict) else None


def _difference(octets: bytes) -> object:
    found = read_description("a.yaml", lambda _: octets).document
    return changes(SMALL, found), changes(found, SMALL)


def _overlay(octets: bytes) -> object:
    return read_description("a.json", lambda name: octets if name == "o" else json.dumps(SMALL).encode(), ["o"])


def _file(read: Callable[[Path], object]) -> Callable[[bytes], object]:
    def of_octets(octets: bytes) -> object:
        with tempfile.NamedTemporaryFile(suffix=".json") as file:
            Path(file.name).write_bytes(octets)
            return read(Path(file.name))

    return of_octets


def _refused(place: str) -> bytes:
    raise OSError(f"{place} is not there")


def _texts(*documents: object) -> list[bytes]:
    return [json.dumps(one).encode() for one in documents]


def _files(*paths: Path) -> list[bytes]:
    return [path.read_bytes() for path in paths]


def readers() -> dict[str, Reader]:
    """Return the readers by name."""
    yaml_of_robot = _files(PACK / "openapi.yaml")
    wsdls = _files(*PACK.glob("*.wsdl"), ROOT / "tests/conformance/api/data/library-contract/lending.wsdl")
    plain = (DescriptionError,)
    malformed = (
        *plain,
        UnresolvedError,
        AttributeError,
        TypeError,
        KeyError,
        RecursionError,
    )  # of changes(): the command words them
    envelope = {"payloadType": "application/vnd.in-toto+json", "payload": "e30=", "signatures": [{"sig": "AA=="}]}
    return {
        "text": Reader([*yaml_of_robot, *_texts(SMALL)], parsed, (ValueError,)),
        "openapi": Reader(_texts(SMALL), _description, plain, "json"),
        "openapi-yaml": Reader([yaml.safe_dump(SMALL).encode(), *yaml_of_robot], _description, plain),
        "swagger": Reader(_texts(SWAGGER), _description, plain, "json"),
        "difference": Reader(_texts(SMALL, SWAGGER), _difference, malformed, "json"),
        "overlay": Reader(_texts(OVERLAY), _overlay, plain, "json"),
        "schema": Reader(_texts(SMALL["components"]["schemas"]["A"]), _schema, (ValueError, UnresolvedError), "json"),
        "json": Reader(_texts(SMALL), read_json, (), "json"),
        "yaml-body": Reader(
            [yaml.safe_dump(SMALL).encode()], lambda o: (parse_yaml(o), by_itself(o)), (UnreadableError,)
        ),
        "xml-body": Reader(_files(PACK / "robot.wadl"), parse_xml, (UnreadableError,), "xml"),
        "wadl": Reader(_files(PACK / "robot.wadl"), read_wadl, (UnreadableError,), "xml"),
        "wsdl": Reader(wsdls, lambda o: read_services(o, "a.wsdl", _refused), (WsdlError,), "xml"),
        "multipart": Reader([PARTS], lambda o: (parts_of(MULTIPART, o), root_of(MULTIPART, o)), (NotXmlError,)),
        "response": Reader(RESPONSES, lambda o: parse(o, "GET", closed=True), (FramingError,)),
        "result": Reader(_files(DATA / "result-example.json"), _file(read_result), (ReportError,), "json"),
        "latency": Reader(_files(DATA / "latency-example.json"), _file(read_latency), (ReportError,), "json"),
        "envelope": Reader(_texts(envelope), lambda o: statement_in(open_envelope(o)), (ReportError,), "json"),
    }


def changed_bytes(octets: bytes, others: list[bytes], rng: random.Random) -> bytes:
    """Return a text with a few changes of its bytes."""
    text = bytearray(octets)
    for _ in range(rng.choice((1, 1, 2, 5))):
        begin = rng.randrange(len(text) + 1)
        end = min(len(text), begin + rng.choice((0, 1, 1, 4, 40, 1000)))
        piece = bytes(text[begin:end])
        other = rng.choice(others)
        cut = rng.randrange(len(other) + 1)
        text[begin:end] = rng.choice(
            (
                b"",
                rng.choice(TOKENS),
                rng.choice(TOKENS) * rng.choice((2, 100, 20_000)),
                piece * rng.choice((2, 10, 1000)),
                bytes(rng.randrange(256) for _ in piece),
                other[cut : cut + rng.choice((1, 30, 3000))],
            )
        )
    return bytes(text[: 1 << 22])


def changed_json(octets: bytes, rng: random.Random) -> bytes:
    """Return a JSON text with a few values replaced, removed, repeated or nested."""
    document = json.loads(octets)
    for _ in range(rng.choice((1, 1, 2, 4))):
        holders = [one for one in _all(document) if isinstance(one, dict | list) and one]
        if not holders:
            break
        holder = rng.choice(holders)
        key: Any = rng.choice(list(holder)) if isinstance(holder, dict) else rng.randrange(len(holder))
        match rng.randrange(6):
            case 0:
                del holder[key]
            case 1:
                holder[key] = copy.deepcopy(rng.choice(list(_all(document))))
            case 2:
                for _ in range(rng.choice((1, 50, 150))):
                    holder[key] = [holder[key]] if rng.random() < 0.5 else {"a": holder[key]}  # noqa: PLR2004 - half
            case 3 if isinstance(holder, list):
                holder *= rng.choice((2, 30))
            case 4 if isinstance(holder, dict):
                holder[rng.choice(("", "$ref", "x-a", "type", "\ud800", "a" * 500))] = holder[key]
            case _:
                holder[key] = copy.deepcopy(rng.choice(ODD))
    return json.dumps(document).encode("utf-8", "surrogatepass")[: 1 << 22]


def _all(value: Any) -> list[Any]:
    found, waiting = [], [value]
    while waiting and len(found) < 20_000:  # noqa: PLR2004 - enough to choose from
        part = waiting.pop()
        found.append(part)
        waiting += part.values() if isinstance(part, dict) else part if isinstance(part, list) else ()
    return found


def changed_xml(octets: bytes, rng: random.Random) -> bytes:
    """Return an XML document with a few elements and attributes changed."""
    root = etree.fromstring(octets)
    for _ in range(rng.choice((1, 1, 2, 4))):
        every = list(root.iter(etree.Element))
        element, other = rng.choice(every), rng.choice(every)
        match rng.randrange(6):
            case 0 if element.getparent() is not None:
                element.getparent().remove(element)
            case 1:
                element.append(copy.deepcopy(other))
            case 2 if element.attrib:
                element.set(
                    rng.choice(list(element.attrib)), rng.choice(("", "0", "-1", "99999999", "unbounded", "tns:a"))
                )
            case 3 if element.attrib:
                del element.attrib[rng.choice(list(element.attrib))]
            case 4:
                element.tag = other.tag
            case _:
                element.attrib.update(dict(other.attrib))
    return etree.tostring(root)[: 1 << 22]


def changed(reader: Reader, rng: random.Random) -> bytes:
    """Return a changed document of a reader."""
    octets = rng.choice(reader.seeds)
    if reader.kind and rng.random() < 0.8:  # noqa: PLR2004 - four of five
        octets = changed_json(octets, rng) if reader.kind == "json" else changed_xml(octets, rng)
    return octets if reader.kind and rng.random() < 0.7 else changed_bytes(octets, reader.seeds, rng)  # noqa: PLR2004


def _work(name: str, seed: int, pipe: Connection) -> None:
    """Read changed documents; send each before it is read, and what went wrong afterwards."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    reader, rng = readers()[name], random.Random(seed)  # noqa: S311 - no secret
    while True:
        octets = changed(reader, rng)
        pipe.send((octets, None))
        try:
            reader.read(octets)
        except reader.allowed:
            pass
        except BaseException:  # noqa: BLE001 - that is what is looked for
            pipe.send((octets, traceback.format_exc()))


@dataclass
class Watched:
    """One reader's process, and the input that it reads."""

    name: str
    options: argparse.Namespace
    count: int = 0
    findings: int = 0
    seed: int = 0
    seen: set[str] = field(default_factory=set)

    def run(self, until: float) -> None:
        """Watch processes until a moment, each until it is too slow or too large."""
        while time.monotonic() < until:
            ours, theirs = multiprocessing.Pipe(duplex=False)
            context = multiprocessing.get_context("fork")
            process = context.Process(
                target=_work, args=(self.name, self.options.seed + self.seed, theirs), daemon=True
            )
            self.seed += 1
            process.start()
            theirs.close()
            try:
                self._watch(process.pid or 0, ours, until)
            finally:
                process.kill()
                process.join()

    def _watch(self, pid: int, pipe: Connection, until: float) -> None:
        octets, began = b"", time.monotonic()
        while time.monotonic() < until:
            if pipe.poll(0.5):
                try:
                    octets, problem = pipe.recv()
                except EOFError:
                    return self._found(octets, "the process ended: a crash of a library")
                began = time.monotonic()
                self.count += problem is None
                if problem:
                    self._found(octets, problem)
            elif time.monotonic() - began > self.options.seconds:
                return self._found(octets, f"it takes longer than {self.options.seconds:g} s")
            if self.count % 50 == 0 and (size := _megabytes(pid)) > self.options.megabytes:
                return self._found(octets, f"the process has {size} MB")
        return None

    def _found(self, octets: bytes, problem: str) -> None:
        last = problem.strip().splitlines()[-1][:80]
        place = [line for line in problem.splitlines() if line.lstrip().startswith("File")][-1:]
        if (kind := f"{last.split(':')[0]} {place}") in self.seen:
            return
        self.seen.add(kind)
        self.findings += 1
        path = Path(self.options.out) / f"{self.name}-{self.findings}.bin"
        path.write_bytes(octets)
        path.with_suffix(".txt").write_text(problem, encoding="utf-8")
        print(f"{path}: {last}", flush=True)


def _megabytes(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") >> 20
    except OSError:
        return 0


def main() -> int:
    """Fuzz all readers in turn."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--megabytes", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", default="fuzz")
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--again", type=Path)
    options = parser.parse_args()
    if options.again:
        print(readers()[options.again.name.rpartition("-")[0]].read(options.again.read_bytes()))
        return 0
    Path(options.out).mkdir(parents=True, exist_ok=True)
    names = options.only or list(readers())
    watched = [Watched(name, options) for name in names]
    rounds = max(1, int(options.minutes / 5))  # each reader has a turn every five minutes
    for _ in range(rounds):
        for one in watched:
            one.run(time.monotonic() + options.minutes * 60 / rounds / len(names))
    for one in watched:
        print(f"{one.name}: {one.count:,} inputs, {one.findings} findings")
    return int(any(one.findings for one in watched))


if __name__ == "__main__":
    sys.exit(main())

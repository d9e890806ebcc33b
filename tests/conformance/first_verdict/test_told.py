"""What a run found is told once and whole: every operation of every finding, in result, terminal and pages."""

from collections.abc import Mapping
from typing import Any

from aiohttp import web
from small_device import certified, constant, described, error, reading, small_device

_WAYS: Mapping[str, tuple[Any, Any]] = {
    "a": ({"type": "integer"}, "x"),
    "b": ({"type": "string"}, 1),
    "c": ({"type": "boolean"}, None),
    "d": ({"type": "array"}, {}),
    "e": ({"type": "object", "required": ["k"]}, {}),
    "f": ({"type": "number", "minimum": 5}, 1),
    "g": ({"type": "string", "enum": ["on"]}, "off"),
    "h": ({"type": "array", "minItems": 2}, [1]),
}
_OPEN = [f"/open-{letter}" for letter in "abcdefghijkl"]
_BROKEN = [f"/x{number}|`<b>" for number in range(20)]


async def _crash(_: web.Request) -> web.Response:
    return web.Response(status=500, text="Internal Server Error")


async def _locked(_: web.Request) -> web.Response:
    return error(401, "no token", **{"WWW-Authenticate": "Bearer"})


async def _unknown(_: web.Request) -> web.Response:
    return error(404, "no such unit")


def test_all_operations_are_named_once_in_result_terminal_pages_and_matrix(tmp_path):
    secured = {"security": [{"k": []}]}
    paths = {f"/{way}": reading(schema) for way, (schema, _) in _WAYS.items()}
    paths |= {path: reading({"type": "object"}, **secured) for path in (*_OPEN, "/locked")}
    paths |= {path: reading({}) for path in (*_BROKEN, "/units/{unit}")}
    paths["/units/{unit}"]["parameters"] = [
        {"name": "unit", "in": "path", "required": True, "schema": {"type": "string"}}
    ]
    routes = {f"/{way}": constant(value) for way, (_, value) in _WAYS.items()}
    routes |= {path: constant({}) for path in _OPEN} | {path: {"GET": _crash} for path in _BROKEN}
    routes |= {"/units/{unit}": {"GET": _unknown}, "/locked": {"GET": _locked}}
    scheme = {"securitySchemes": {"k": {"type": "http", "scheme": "bearer"}}}
    with small_device(described(paths, components=scheme), routes) as base:
        done = certified(f"{base}/openapi.json", tmp_path)
    assert done.exit_code == 1, done.text

    def of(requirement: str) -> list[list[str]]:
        failures = done.requirement(requirement)["failures"]
        return [sorted(one["operation"] for one in failure["operations"]) for failure in failures]

    assert sorted(of("description/body-schema")) == [[f"GET /{way}"] for way in sorted(_WAYS)]
    assert of("description/security") == [sorted(f"GET {path}" for path in _OPEN)]
    assert of("robustness/no-server-error") == [sorted(f"GET {path}" for path in _BROKEN)]
    matrix = {row["operation"]: row["findings"] for row in done.result["api"]["operations"]}
    listed: dict[str, list[int]] = {label: [] for label in matrix}
    for requirement in done.result["requirements"]:
        for failure in requirement["failures"]:
            for one in failure.get("operations", ()):
                listed[one["operation"]].append(failure["number"])
    assert matrix == {label: sorted(numbers) for label, numbers in listed.items()}
    assert all(numbers for label, numbers in matrix.items() if label not in {"GET /units/{unit}", "GET /locked"})
    assert "and 9 more." in done.text
    assert f"{len(_BROKEN) + 2} operations never answered 2xx" in done.text
    assert "credentials are given by --token-file, --basic-file or --api-key-file" in done.text
    assert '    "unit" = ["…"]' in done.text
    for way in _WAYS:
        assert f"GET /{way}" in done.text
    html, markdown = ((tmp_path / f"certificate.{kind}").read_text(encoding="utf-8") for kind in ("html", "md"))
    for path in (*_OPEN, *(f"/{way}" for way in _WAYS)):
        assert path in html
        assert path in markdown
    assert "`<b>" not in html
    assert "/x19|`&lt;b&gt;" in html

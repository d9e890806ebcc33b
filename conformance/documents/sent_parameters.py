"""The parameters of an OpenAPI 3 document that are sent, each by a name of its own."""

from __future__ import annotations

import re
from typing import Any, Final

from conformance.documents.json_schema import Schema, pointed
from conformance.documents.openapi import methods_of

# Other keywords of OpenAPI 3 describe these, so header parameters of these names are ignored (OpenAPI 3.1, 4.8.12.2).
_IGNORED: Final = frozenset({"accept", "content-type", "authorization"})
# By these a server takes another method or target than the request line's, or sees another end of the request: they
# would make a permitted GET a DELETE, and lead a credential to another host behind the same gateway.
_STEERING: Final = re.compile(
    r"x-(?:http-?)?(?:method|verb)(?:-?override)?|(?:http-?)?method-?override"
    r"|(?:x-)?(?:original|rewrite|forwarded)-?(?:url|uri|path|prefix|host|server)"
    r"|x-host|forwarded|host|content-length|transfer-encoding|te|trailer|connection|keep-alive|upgrade|expect"
    r"|proxy-(?:connection|authorization)",
    re.IGNORECASE,
)
_METHOD_IN_QUERY: Final = re.compile(r"_method|_?x?-?http-?method(?:-?override)?|x-method-override", re.IGNORECASE)
_FORM: Final = "application/x-www-form-urlencoded"


def with_sent(value: Any, document: Schema, ignored: frozenset[str] = _IGNORED) -> Any:
    """Return a part of an OpenAPI 3 document with the parameters that are sent, each by its own name.

    The specification ignores some header parameters. Those by which a request becomes another one are not sent either.
    A query string is written as the parameters in it.

    Args:
        value: the part.
        document: the document.
        ignored: names of header parameters that the specification ignores; Swagger 2.0 ignores none.
    """
    if isinstance(value, list):
        return [with_sent(item, document, ignored) for item in value]
    if not isinstance(value, dict):
        return value
    found = {key: with_sent(item, document, ignored) for key, item in value.items()}
    if isinstance(value.get("parameters"), list):
        found["parameters"] = [sent for one in found["parameters"] for sent in _sent(one, document, ignored)]
        if _unwritten(value["parameters"], document):
            found["x-roaas-never"] = True
    return found


def _unwritten(parameters: Any, document: Schema) -> str:
    """Return the media type of a required query string that the suite does not write; empty if it writes all."""
    for given in parameters if isinstance(parameters, list) else ():
        one = _followed(given, document)
        if isinstance(one, dict) and one.get("in") == "querystring" and one.get("required") is True:
            content = one.get("content")
            names = " or ".join(content) if isinstance(content, dict) else ""
            return "" if _in_query(one, document) else names or "not described"
    return ""


def not_called(document: Schema) -> tuple[str, ...]:
    """Return a remark for each operation that the suite cannot call."""
    return tuple(
        f"{method} {path} is not called: its query string is {unwritten}, which the suite does not write."
        for path, item in document["paths"].items()
        if isinstance(whole := _followed(item, document), dict)
        for method, one in methods_of(whole).items()
        if isinstance(one, dict) and (unwritten := _unwritten(one.get("parameters"), document))
    )


def _sent(given: Any, document: Schema, ignored: frozenset[str]) -> list[Any]:
    parameter = _followed(given, document)
    if not isinstance(parameter, dict):
        return [given]
    if parameter.get("in") == "querystring":
        return _in_query(parameter, document)
    name, where = str(parameter.get("name")).lower(), parameter.get("in")
    steers = {"header": _STEERING, "query": _METHOD_IN_QUERY}.get(str(where))
    # Many servers take _ and - for the same in the name of a field.
    same = name.replace("_", "-") if where == "header" else name
    is_left_out = (where == "header" and name in ignored) or (steers and steers.fullmatch(same))
    return [] if is_left_out else [given]


def _in_query(parameter: Schema, document: Schema) -> list[Schema]:
    """Return the query parameters that a query string consists of (OpenAPI 3.2, 4.12); none if it is no form."""
    content = parameter.get("content")
    media = _followed(content.get(_FORM), document) if isinstance(content, dict) else None
    schema = _followed(media.get("schema"), document) if isinstance(media, dict) else None
    properties = schema.get("properties") if isinstance(schema, dict) else None
    required = schema.get("required", ()) if isinstance(schema, dict) and parameter.get("required") is True else ()
    given = media.get("encoding") if isinstance(media, dict) else None
    encoding = given if isinstance(given, dict) else {}
    return [
        {
            "name": name,
            "in": "query",
            "required": name in required,
            "schema": part,
            **{key: one for key, one in encoding.get(name, {}).items() if key in {"style", "explode", "allowReserved"}},
        }
        for name, part in (properties.items() if isinstance(properties, dict) else ())
    ]


def _followed(given: Any, document: Schema) -> Any:
    return pointed(document, given["$ref"]) if isinstance(given, dict) and isinstance(given.get("$ref"), str) else given

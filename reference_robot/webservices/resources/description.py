"""/openapi.json and /application.wadl: the contract's files, with the address under which they were asked for."""

import json
from collections.abc import Callable
from typing import Any, Final

import yaml
from lxml import etree

from conformance.contract.files import CONTRACT_DIR
from reference_robot.webservices.http.messages import Request, Response, content
from reference_robot.webservices.resources.resource import Resource

_WADL_NAMESPACE: Final = "{http://wadl.dev.java.net/2009/02}"


class OpenApi(Resource):
    """The OpenAPI description, as JSON."""

    path = "/openapi.json"

    def __init__(self, address: Callable[[Request], str]) -> None:
        self._address = address
        document: Any = yaml.safe_load((CONTRACT_DIR / "openapi.yaml").read_text(encoding="utf-8"))
        self._document: dict[str, Any] = document

    def get(self, request: Request) -> Response:
        """Return the description with this robot as its server."""
        document = self._document | {"servers": [{"url": self._address(request)}]}
        return content(200, "application/json", json.dumps(document, default=str).encode())


class Wadl(Resource):
    """The WADL description."""

    path = "/application.wadl"

    def __init__(self, address: Callable[[Request], str]) -> None:
        self._address = address
        self._document = etree.parse(CONTRACT_DIR / "robot.wadl")

    def get(self, request: Request) -> Response:
        """Return the description with this robot as its base."""
        for resources in self._document.iter(f"{_WADL_NAMESPACE}resources"):
            resources.set("base", self._address(request) + "/")
        body = etree.tostring(self._document, encoding="utf-8", xml_declaration=True)
        return content(200, "application/vnd.sun.wadl+xml", body)

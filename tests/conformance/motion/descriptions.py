"""Parts of the OpenAPI descriptions of the simulated devices."""

from typing import Any


def content(schema: dict[str, Any]) -> dict[str, Any]:
    """Return a request body in JSON."""
    return {"required": True, "content": {"application/json": {"schema": schema}}}


def answered(schema: dict[str, Any]) -> dict[str, Any]:
    """Return a response in JSON."""
    return {"description": "", "content": {"application/json": {"schema": schema}}}


def problem() -> dict[str, Any]:
    """Return a response that says what is wrong."""
    return answered({"type": "object", "properties": {"detail": {"type": "string"}}, "required": ["detail"]})


def described(title: str, paths: dict[str, Any]) -> dict[str, Any]:
    """Return a description."""
    return {"openapi": "3.1.0", "info": {"title": title, "version": "1"}, "paths": paths}

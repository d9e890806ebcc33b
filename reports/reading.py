"""Read result files: JSON that is validated by its public JSON Schema before a page shows its content."""

import json
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema_rs
from jsonschema import Draft202012Validator
from jsonschema.exceptions import ValidationError, best_match

from reports.errors import ResultFormatError, ResultGarbledError, ResultInvalidError, ResultUnreadableError
from reports.given_files import parsed, read_octets
from reports.pages.untrusted import excerpt

SCHEMA_DIR = Path(__file__).parent / "schemas"
RESULT_FORMAT = "roaas-result/1"
LATENCY_FORMAT = "roaas-latency/1"
FLEET_FORMAT = "roaas-fleet/1"
SCHEMA_FILES = {
    RESULT_FORMAT: SCHEMA_DIR / "roaas-result-1.schema.json",
    LATENCY_FORMAT: SCHEMA_DIR / "roaas-latency-1.schema.json",
    FLEET_FORMAT: SCHEMA_DIR / "roaas-fleet-1.schema.json",
}
RESULT_NAME = "result.json"
LATENCY_NAME = "latency.json"
FLEET_NAME = "fleet.json"


def _schema(result_format: str) -> dict[str, Any]:
    schema: dict[str, Any] = json.loads(SCHEMA_FILES[result_format].read_text(encoding="utf-8"))
    return schema


@cache
def validator(result_format: str) -> Draft202012Validator:
    """Return the JSON Schema validator of a result format, cached because building it takes longer than using it."""
    return Draft202012Validator(_schema(result_format))


@cache
def _quick_validator(result_format: str) -> jsonschema_rs.Validator:
    """Return a JSON Schema validator that is a hundred times faster than `validator`, with poorer error messages."""
    return jsonschema_rs.validator_for(_schema(result_format))


def read_result(path: Path) -> dict[str, Any]:
    """Read and validate a conformance result file; raise a `ReportError` subclass if the file is not a valid result."""
    return _read(path, RESULT_FORMAT)


def read_latency(path: Path) -> dict[str, Any]:
    """Read and validate a latency result file; raise a `ReportError` subclass if the file is not a valid result."""
    return _read(path, LATENCY_FORMAT)


def read_fleet(path: Path) -> dict[str, Any]:
    """Read and validate a fleet's result file; raise a `ReportError` subclass if the file is not a valid result."""
    return _read(path, FLEET_FORMAT)


def _read(path: Path, expected: str) -> dict[str, Any]:
    document = _parse(path, _text(path))
    if not isinstance(document, dict):
        raise ResultInvalidError(f"{path}: at $: expected an object, found {_excerpt(document)}")
    found = document.get("format")
    if found != expected:
        raise ResultFormatError(f"{path}: at $.format: expected {expected!r}, found {_excerpt(found)}")
    # msgspec accepts no lone surrogate, which JSON may contain.
    with suppress(UnicodeEncodeError):
        if _quick_validator(expected).is_valid(document):
            return document
    error = best_match(validator(expected).iter_errors(document))
    if error is not None:
        raise ResultInvalidError(f"{path}: {_where(error)}")
    return document


def _text(path: Path) -> str:
    octets = read_octets(path, root=path.parent)
    try:
        return octets.decode("utf-8")
    except UnicodeDecodeError as error:
        octet = error.object[error.start]
        raise ResultUnreadableError(f"{path}: byte {error.start} (0x{octet:02x}) is not UTF-8") from error


def _parse(path: Path, text: str) -> Any:
    try:
        return parsed(text)
    except json.JSONDecodeError as error:
        near = excerpt(text[max(0, error.pos - 20) : error.pos + 20], 60)
        raise ResultGarbledError(
            f"{path}: line {error.lineno}, column {error.colno}: {error.msg}, near {near!r}"
        ) from error
    except ValueError as error:  # NaN and Infinity, and integers of thousands of digits
        raise ResultGarbledError(f"{path}: {error}") from error
    except RecursionError as error:
        raise ResultGarbledError(f"{path}: nested too deeply for a result") from error


def _where(error: ValidationError) -> str:
    return f"at {error.json_path}: {excerpt(error.message, 300)} (value: {_excerpt(error.instance)})"


def _excerpt(value: object) -> str:
    return excerpt(json.dumps(value, ensure_ascii=False, default=repr), 120)

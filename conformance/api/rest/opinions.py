"""What Schemathesis's own checks say of a response to one of its cases."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import requests
from schemathesis import checks
from schemathesis.core.failures import Failure, FailureGroup
from schemathesis.core.transport import Response as ThesisResponse

from conformance.transport.exchange import Exchange

# Those that need one response alone; the survey makes sequences by itself.
_NAMES = (
    "status_code_conformance",
    "content_type_conformance",
    "response_headers_conformance",
    "response_schema_conformance",
    "negative_data_rejection",
    "positive_data_acceptance",
    "missing_required_header",
)


@dataclass(frozen=True)
class Opinion:
    """One failure that Schemathesis sees.

    Attributes:
        code: its code, such as ``ST108`` (`st explain ST108` explains it).
        text: what is wrong, on one line.
    """

    code: str
    text: str


def opinions(case: Any, exchange: Exchange) -> tuple[Opinion, ...]:
    """Return what Schemathesis's checks find wrong with the response to a case; empty if nothing."""
    chosen = [check for check in checks.CHECKS.get_all() if check.__name__ in _NAMES]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            case.validate_response(_response(exchange), checks=chosen)
    except FailureGroup as group:
        return tuple(_opinion(one) for one in group.exceptions if isinstance(one, Failure))
    except Failure as failure:
        return (_opinion(failure),)
    except Exception:  # noqa: BLE001 - a schema or response that its checks cannot read has no second opinion
        return ()
    return ()


def _opinion(failure: Failure) -> Opinion:
    text = " ".join(f"{failure.title}: {failure.message}".split())
    return Opinion(failure.code, text[:300])


def _response(exchange: Exchange) -> ThesisResponse:
    answer, request = exchange.response, exchange.request
    headers: dict[str, list[str]] = {}
    for name, value in answer.headers:
        headers.setdefault(name.lower(), []).append(value)
    sent = requests.Request(
        request.method, request.url, headers=dict(request.headers), data=request.body or None
    ).prepare()
    return ThesisResponse(answer.status, headers, answer.body, sent, answer.elapsed_ms / 1000, verify=True)

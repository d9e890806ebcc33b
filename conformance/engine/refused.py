"""Notice that the device refuses the run's credentials: from the start, or from some moment on."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final

from conformance.api.rest.interface import RestInterface
from conformance.api.rest.statuses import REFUSALS
from conformance.contract.pack import Contract
from conformance.documents.openapi import matching, operations_of
from conformance.documents.wsdl_pack import services_of
from conformance.scenarios.scenario import NotPossibleError
from conformance.transport.credentials import is_shown
from conformance.transport.exchange import Exchange, Listener, NoAnswerError, Request
from conformance.verdict.finding import Finding, count_of
from conformance.verdict.run import Run

# Codes of a SOAP fault for wrong credentials (WS-Security 12, ONVIF Core 5.11.2.2).
_FAULT: Final = re.compile(rb"FailedAuthentication|FailedCheck|InvalidSecurityToken|NotAuthorized")
_EXPIRED: Final = frozenset({401, 403, 407})
_ERRORS: Final = 400
_SERVER_ERRORS: Final = 500
_SHOWN_CHALLENGE: Final = 200


def is_refused(exchange: Exchange) -> bool:
    """Return whether a device refused a request because of its sender."""
    answer = exchange.response
    is_fault = answer.status >= _ERRORS and "xml" in answer.media_type and bool(_FAULT.search(answer.body))
    return answer.status in REFUSALS or is_fault


def _carries_credentials(request: Request) -> bool:
    return any(is_shown(text) for text in (*(value for _, value in request.headers), request.query))


def _speaks_soap(contract: Contract) -> bool:
    return bool(contract.publishers_path or contract.subscribers_path or services_of(contract))


@lru_cache(maxsize=8)
def _declares_security(contract: Contract) -> bool:
    return any(operation.security for operation in operations_of(contract))


@dataclass
class RefusalListener(Listener):
    """Counts refusals of the requests that carry the run's credentials, and ends the run when these expire.

    Attributes:
        run: is aborted when credentials expire.
        has_credentials: whether the run has any.
        rest: returns the device's REST interface, if it has one.
        accepted: number of requests for what demands credentials that were answered 2xx or 3xx.
        expired: whether the device has begun to refuse them.
        open: number of such requests for what demands none.
        other: number of such requests that were refused for another reason, or failed.
        refused: number of refusals by status.
        challenge: the first WWW-Authenticate of a refusal.
    """

    run: Run
    has_credentials: bool
    rest: Callable[[], RestInterface | None]
    accepted: int = 0
    open: int = 0
    other: int = 0
    refused: Counter[int] = field(default_factory=Counter)
    challenge: str = ""
    expired: bool = False
    _usual: Request | None = None
    _looks: bool = False

    def on_response(self, exchange: Exchange) -> None:
        """Count a response.

        Raises:
            NotPossibleError: the device has begun to refuse the credentials, which ends the running check.
        """
        request, answer = exchange.request, exchange.response
        if self._looks or (self.has_credentials and not _carries_credentials(request)):
            return
        demands = self._demands(request)
        if demands is None:
            return
        if not is_refused(exchange):
            is_accepted = answer.status < _ERRORS
            self.accepted += is_accepted and demands
            self.other += not is_accepted and demands
            self.open += is_accepted and not demands
            if demands and request.method == "GET" and answer.ok and self._usual is None:
                self._usual = request
            return
        if demands or not self.open:
            self.refused[answer.status] += 1
            self.challenge = self.challenge or (answer.header("www-authenticate") or "")[:_SHOWN_CHALLENGE]
        if demands and self.accepted and answer.status in _EXPIRED and self._is_refused_now():
            self.expired = True
            self.run.aborted = self.text
            if self.run.judge.check_name:
                raise NotPossibleError(self.run.aborted)

    def _demands(self, request: Request) -> bool | None:
        """Return whether a request's operation demands credentials; None if unknown."""
        contract, rest = self.run.contract, self.rest()
        if request.method == "POST" and "xml" in request.media_type and _speaks_soap(contract):
            return True
        if rest is None or not request.url.startswith(rest.client.base_url):
            return None
        method = "GET" if request.method == "HEAD" else request.method
        operation = matching(contract, method, request.url[len(rest.client.base_url) :].partition("?")[0])
        if operation is None:
            return None
        return all(operation.security) if operation.security else not _declares_security(contract)

    def _is_refused_now(self) -> bool:
        """Send a request that the device has accepted before; return whether it is refused now."""
        rest, usual = self.rest(), self._usual
        if rest is None or usual is None or self.expired:
            return False
        self._looks = True
        try:
            headers = [(name, value) for name, value in usual.headers if name == "Accept"]
            target = usual.url[len(rest.client.base_url) :]
            return rest.client.send("GET", target, headers=headers, fresh=True).response.status in _EXPIRED
        except NoAnswerError:
            return False
        finally:
            self._looks = False

    def withdraw(self) -> None:
        """Withdraw findings caused by the refusals, which show no fault of the device.

        Where nothing was accepted, those stay that need no credentials: crashes, and faults of the description itself.
        """
        for evidence in self.run.judge.evidence.values():
            evidence.findings = {key: one for key, one in evidence.findings.items() if self._stands(one)}

    def _stands(self, finding: Finding) -> bool:
        shown = finding.exchange
        if isinstance(shown, Exchange) and is_refused(shown):
            return False
        if self.expired or shown is None or finding.requirement.startswith("robustness/"):
            return True
        return isinstance(shown, Exchange) and shown.response.status >= _SERVER_ERRORS

    @property
    def text(self) -> str:
        """Return how the device refused the run's credentials, and what to do; empty if it accepted them."""
        # 403 and 423 may concern one request only, as from a firewall; 401 and 407 never do.
        is_clear = bool(self.refused.keys() & {401, 407}) or self.refused.total() > self.other
        if not is_clear or (self.accepted and not self.expired) or (self.open and not self.has_credentials):
            return ""
        statuses = " or ".join(str(status) for status, _ in self.refused.most_common())
        challenge = f" (WWW-Authenticate: {self.challenge})" if self.challenge else ""
        if self.expired:
            return (
                f"The device accepted the credentials of {count_of(self.accepted, 'request')} and then answered "
                f"{statuses}{challenge}: what came after was not judged. Give credentials that last as long as the run."
            )
        advice = (
            "Check that the credentials are right and have not expired, and that they may do this."
            if self.has_credentials
            else "Give the device's credentials: --token-file, --basic-file, --api-key with --api-key-file, or"
            " --headers-file for any other header, such as a lease."
        )
        count = self.refused.total()
        what = "the only request" if count == 1 else f"each of {count} requests"
        return (
            f"The device answered {statuses}{challenge} to {what} for what demands credentials: only what needs none "
            f"was judged. {advice}"
        )

"""Requests that a run may send to a device: all with --allow-motion, otherwise only those that cannot move it.

This is the only place of that rule. ``Connection.permit`` holds it, and every request passes it, raw bytes included.
"""

import re
from collections.abc import Iterable
from urllib.parse import unquote, urlsplit

from conformance.api.call_rules import CallRules, Reason
from conformance.contract.classes import Prerequisite
from conformance.documents.openapi import Operation, is_normal, matching
from conformance.statement.motion_calls import covers
from conformance.transport.client import HttpClient
from conformance.transport.exchange import SAFE_METHODS
from conformance.transport.reach import at_server
from conformance.verdict.run import Run

_SLASHES = re.compile("/{2,}")
NO_MOTION = "it may move the robot, and --allow-motion was not given"


class Permission:
    """The rules on which requests one run may send.

    Args:
        run: says whether the robot may be moved.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._reading: set[str] = set()

    def may_post_to(self, url: str) -> None:
        """Allow POST to a URL: that of a SOAP service whose operations only read."""
        self._reading.add(_place(url))

    def may_call_ports(self, base_url: str) -> None:
        """Allow POST to the ports of a device that is judged by its WSDL.

        Args:
            base_url: scheme and host of the device, whatever the WSDL says.
        """
        # xmlschema and lxml take a third of a second, which other devices need not pay.
        from conformance.documents.wsdl_pack import services_of  # noqa: PLC0415

        found = services_of(self._run.contract)
        for port in found.ports if found else ():
            self.may_post_to(at_server(port.url, found.base, base_url) if found else port.url)

    def forbid_post_to(self, url: str) -> None:
        """Withdraw may_post_to(): a service whose operations act has the same URL."""
        self._reading.discard(_place(url))

    def refusal(self, method: str, url: str) -> str:
        """Return an empty text if a request may be sent, else why not.

        Args:
            method: HTTP method.
            url: absolute URL with the request target as sent.

        Raises:
            TimeIsOverError: the time of the run is over.
        """
        self._run.limit.check()
        if not self._run.contract.is_claimed:
            # A SOAP message is always a POST: its scenario has decided by the same rules which operation it is for.
            posts = method == "POST" and _place(url) in self._reading
            return "" if posts else self._refused_call(method, url)
        if self._run.allow_motion:
            return ""
        moves = self._moves(method, url)
        if moves is False or (moves is None and method in SAFE_METHODS):
            return ""
        if method == "POST" and _place(url) in self._reading:
            return ""
        return f"{method} {urlsplit(url).path[:200]} was not sent: {NO_MOTION}"

    def _refused_call(self, method: str, url: str) -> str:
        """Return why a request is not sent to a device that claims no contract; empty if it may be sent."""
        base = (self._run.statement.endpoints.rest or "").rstrip("/")
        sent = _place(url).removeprefix(base)
        path = _SLASHES.sub("/", unquote(sent)) or "/"
        rules = CallRules.of(self._run)
        declared = matching(self._run.contract, method, path)
        if declared is None and is_normal(path) and is_normal(sent):
            # A value with a slash, written as %2F, is another path only for a server that decodes it and serves that
            # path.
            declared = matching(self._run.contract, method, sent)
        if declared is None and method in SAFE_METHODS:
            return ""  # the request changes nothing, whatever the server serves at its path
        reason = rules.decide(declared or Operation(path, method, path))
        mapped = declared is not None and any(
            covers(call, f"{method} {path}") or covers(call, f"{method} {sent}") for call in self._run.mapped_calls
        )
        if mapped and reason not in {Reason.NEVER, Reason.EXCLUDED}:
            return ""
        if declared is not None and (reason.may or (declared.stop and not declared.never)):
            return ""
        if reason is Reason.ALLOWED:
            return ""
        return f"{method} {path[:200]} was not sent: {reason}"

    def _moves(self, method: str, url: str) -> bool | None:
        """Return whether the contract pack says that a request's operation moves (x-roaas-motion); None if unknown."""
        base = (self._run.statement.endpoints.rest or "").rstrip("/")
        path = _place(url).removeprefix(base)
        if not base or not _place(url).startswith(f"{base}/") or not is_normal(path):
            return None
        operation = matching(self._run.contract, method, path)
        return None if operation is None else operation.motion


def permitted_methods(run: Run, client: HttpClient, methods: Iterable[str], path: str, *ids: str) -> list[str]:
    """Return the methods that this run may send to a path.

    If there are others, the requirements that need motion are not tested: they do not pass on half of the evidence.

    Args:
        run: the data of the run.
        client: the client of the interface.
        methods: the methods that a check would send.
        path: request target below the base URL.
        ids: the requirements that the check judges.
    """
    refusals = {method: client.refusal(method, path) for method in methods}
    # A device that claims no contract is judged by the operations that may be called.
    reason = next(filter(None, refusals.values()), "") if run.contract.is_claimed else ""
    for id_ in ids if reason else ():
        requirement = run.contract.ledger.get(id_)
        if requirement is not None and Prerequisite.MOTION in requirement.needs:
            run.judge.skip(id_, reason)
    return [method for method, refused in refusals.items() if not refused]


def _place(url: str) -> str:
    """Return a URL without its query."""
    return url.partition("?")[0]

"""Which SOAP services a check may ask in this run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from conformance.engine.session import Session
    from conformance.soap.service import SoapService
    from conformance.verdict.effort import Effort

_NO_MOTION = "the publishers service moves the robot, and --allow-motion was not given"


def askable(roaas: Session, *ids: str) -> list[SoapService]:
    """The services that may be asked, the one that only reads first.

    What was not allowed or does not answer is put down against the requirements that need it, so that they are not
    passed on half of the evidence.

    Args:
        roaas: the run.
        ids: the requirements that are judged.

    Raises:
        pytest.skip.Exception: none may be asked.
    """
    found: list[SoapService] = []
    reasons: list[str] = []
    if roaas.subscribers is not None:
        _add(roaas, roaas.subscribers, found, reasons)
    if roaas.publishers is not None and roaas.allow_motion:
        _add(roaas, roaas.publishers, found, reasons)
    elif roaas.publishers is not None:
        reasons.append(_NO_MOTION)
    if not found:
        pytest.skip("; ".join(reasons) or "no SOAP service has an address")
    for id_ in ids:
        requirement = roaas.contract.ledger.get(id_)
        for reason in reasons:
            if requirement is not None and (reason != _NO_MOTION or "motion" in requirement.needs):
                roaas.judge.skip(id_, reason)
    return found


def _add(roaas: Session, service: SoapService, found: list[SoapService], reasons: list[str]) -> None:
    if service.name in roaas.unreachable:
        reasons.append(f"the robot's {service.name} interface does not answer: {roaas.unreachable[service.name]}")
    elif service.contract_wsdl_path is None:
        reasons.append(f"the contract describes no {service.name} service")
    else:
        found.append(service)


def rounds(effort: Effort, standard: int) -> int:
    """How often to repeat what one time shows already, for the sake of failures that come now and then."""
    return max(1, round(standard * effort.factor))

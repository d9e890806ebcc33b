"""Import once all that a certification needs: processes forked from here start in milliseconds."""

import contextlib
import importlib
import os
import pkgutil

import conformance.engine.certification
import conformance.engine.robot_from_options
import conformance.engine.robot_under_test
import conformance.rules
from conformance.contract.locating import ContractError
from conformance.contract.pack import DEFAULT_PACK, Contract
from conformance.documents.openapi import operations_of
from proof.selftest.certifying import PACK_VARIABLE

__all__ = ["conformance"]


def _import_all(package: str) -> None:
    """Import every module of a package."""
    for module in pkgutil.walk_packages(importlib.import_module(package).__path__, f"{package}."):
        importlib.import_module(module.name)


_import_all("conformance.rules")
# The certification itself reports a pack that cannot be used.
with contextlib.suppress(ContractError):
    _contract = Contract.load(os.environ.get(PACK_VARIABLE, DEFAULT_PACK))
    operations_of(_contract)
    if _contract.plugin is not None and _contract.plugin.__package__:
        _import_all(f"{_contract.plugin.__package__}.rules")

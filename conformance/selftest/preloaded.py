"""What every certification needs, imported once: processes forked from there start in milliseconds."""

from __future__ import annotations

import importlib
import pkgutil

import conformance.certification
import conformance.checks
import conformance.session
import conformance.standalone

__all__ = ["conformance"]

for _module in pkgutil.iter_modules(conformance.checks.__path__, "conformance.checks."):
    importlib.import_module(_module.name)

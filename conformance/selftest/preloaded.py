"""What every certification needs, imported once: processes forked from there start in milliseconds."""

import importlib
import pkgutil

import conformance.engine.certification
import conformance.engine.pytest_run
import conformance.engine.robot_under_test
import conformance.rules

__all__ = ["conformance"]

for _module in pkgutil.walk_packages(conformance.rules.__path__, "conformance.rules."):
    importlib.import_module(_module.name)

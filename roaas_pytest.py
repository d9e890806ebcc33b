"""The pytest plugin for use in any project: ``pytest -p roaas_pytest --pyargs conformance --robot-rest URL``.

The plugin is loaded by ``-p`` and is not an entry point of pytest. An entry point would be loaded in every pytest run
of everybody who installed the suite, and its package `conformance` would hide a module of theirs with that name.
"""

from roaas import open_rooms

open_rooms()
pytest_plugins = ("conformance.engine.other_projects",)

"""The checks in a pytest project of one's own: ``pytest -p roaas_pytest --pyargs conformance --robot-rest URL``.

It is asked for by name. As an entry point of pytest's it would be loaded in every run of everybody who installed the
suite, and take the name `conformance` from their own modules.
"""

from roaas import open_rooms

open_rooms()
pytest_plugins = ("conformance.engine.plugin",)

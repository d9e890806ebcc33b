"""Vendors who sign."""

import pytest
from signed_results import Vendor, conformant

from reports.attestation.keys import generate


@pytest.fixture
def vendor(tmp_path):
    generate(tmp_path / "keys")
    return Vendor(tmp_path / "sent", tmp_path / "keys")


@pytest.fixture(scope="module")
def honest(tmp_path_factory):
    """A vendor whose certificate the default policy accepts."""
    folder = tmp_path_factory.mktemp("honest")
    generate(folder / "keys")
    honest = Vendor(folder / "sent", folder / "keys")
    done = honest.sign(conformant())
    assert done.exit_code == 0, done.output
    return honest

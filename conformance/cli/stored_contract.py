"""The contract by which a stored result was judged, as data: of the result's folder, nothing is executed."""

import tempfile
from pathlib import Path
from typing import Any

import click

from conformance.contract.described import copy_as_data
from conformance.contract.locating import ContractError, is_installed
from conformance.contract.pack import DEFAULT_PACK, Contract


def contract_of(document: dict[str, Any], pack: str | None, folder: Path) -> Contract | None:
    """Return the current version of the contract that judged, or None if it is not installed.

    That of a device's own description is in the folder of the result, of which nothing is executed: a result is data.

    Raises:
        click.UsageError: the pack named by the user cannot be used.
    """
    from conformance.documents.description_faults import without_unreadable  # noqa: PLC0415 - --help stays quick
    from conformance.target.describing import FOLDER  # noqa: PLC0415 - --help stays quick

    described, named = folder / FOLDER, pack or str(document.get("pack", {}).get("name", DEFAULT_PACK))
    try:
        # The result of a run that was killed does not name its description.
        if pack is None and ("api" in document or (described / "pack.toml").exists()):
            copy = click.get_current_context().with_resource(tempfile.TemporaryDirectory())
            named = str(copy_as_data(described, Path(copy), lambda found: without_unreadable(found)[0]))
        elif pack is None and not is_installed(named):
            return None
        contract = Contract.load(named)
    except ContractError as error:
        if pack:
            raise click.UsageError(str(error)) from error
        return None
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return contract if document["suite"]["contract"] == contract.label else None

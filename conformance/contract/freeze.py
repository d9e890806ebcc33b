"""``python -m conformance.contract.freeze NAME [PACK]``: freeze a pack's ledger as a requirement set."""

import sys
from pathlib import Path

from conformance.contract.pack import DEFAULT_PACK, Contract
from conformance.contract.requirement_sets import frozen_form, set_folder


def freeze(name: str, pack: str | Path = DEFAULT_PACK) -> None:
    """Write ``sets/NAME.toml`` of a pack from its ledger."""
    contract = Contract.load(pack)
    lines = [f"# The requirements of set {name}: level, and SHA-256 of the text. Frozen: written once, by freeze.py."]
    for id_, requirement in sorted(contract.ledger.items()):
        item = frozen_form(requirement)
        lines.append(f'requirements."{id_}" = {{ level = "{item.level}", text = "{item.text}" }}')
    set_folder(contract).mkdir(exist_ok=True)
    (set_folder(contract) / f"{name}.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    freeze(*sys.argv[1:])

"""``python -m conformance.contract.freeze NAME``: freeze the ledger as a set, at the end of a release."""

import sys

from conformance.contract.files import Contract
from conformance.contract.requirement_sets import SET_DIR, frozen


def freeze(name: str) -> None:
    """Write ``sets/NAME.toml`` from the ledger."""
    lines = [f"# The requirements of set {name}: level, and SHA-256 of the text. Frozen: written once, by freeze.py."]
    for id_, requirement in sorted(Contract.load().ledger.items()):
        item = frozen(requirement)
        lines.append(f'requirements."{id_}" = {{ level = "{item.level}", text = "{item.text}" }}')
    SET_DIR.mkdir(exist_ok=True)
    (SET_DIR / f"{name}.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    freeze(sys.argv[1])

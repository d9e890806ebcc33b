"""Vendors who sign results, and a registry that trusts their keys."""

import copy
import datetime as dt
import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from vendors import Door, change, make_conformant

from reports.attestation.keys import PRIVATE_NAME, PUBLIC_NAME, generate
from reports.attestation.signing import Notary
from reports.cli.registry import registry
from reports.rendering import render


@dataclass(frozen=True)
class Host:
    """Who hosts a registry.

    Attributes:
        folder: holds what vendors sent, the keys and the site.
        result: a conformant result, to be copied.
    """

    folder: Path
    result: dict[str, Any]

    @property
    def site(self) -> Path:
        return self.folder / "site"

    def sign(self, sent: str, days_ago: float = 1, vendor: str = "vendor", **changes: Any) -> Path:
        """Have a vendor sign a result; changes are at paths such as `statement__robot__version`."""
        result = copy.deepcopy(self.result)
        finished = dt.datetime.now(dt.UTC) - dt.timedelta(days=days_ago)
        result["started"] = result["finished"] = finished.strftime("%Y-%m-%dT%H:%M:%SZ")
        change(result, changes)
        return self.sign_as_it_is(sent, result, vendor)

    def sign_as_it_is(self, sent: str, result: dict[str, Any], vendor: str = "vendor") -> Path:
        folder = self.folder / "sent" / sent
        folder.mkdir(parents=True)
        (folder / "result.json").write_text(json.dumps(result))
        render(folder, Notary(self.folder / vendor / PRIVATE_NAME))
        return folder / "certificate.intoto.json"

    def build(self, *options: str, more: Iterable[Path] = (), door: type[Door] = Door) -> Result:
        words = [
            "build",
            str(self.folder / "sent"),
            *map(str, more),
            "--keys",
            str(self.folder / "keys"),
            "--out",
            str(self.site),
        ]
        return CliRunner().invoke(registry, [*words, *options], obj=door())

    def text(self) -> str:
        """Everything that the site says."""
        return "\n".join(path.read_text() for path in sorted(self.site.rglob("*")) if path.is_file())


@pytest.fixture
def host(tmp_path: Path, result: dict[str, Any]) -> Host:
    """A host who trusts one vendor, and not the stranger."""
    for name in ("vendor", "stranger"):
        generate(tmp_path / name)
    (tmp_path / "keys").mkdir()
    os.link(tmp_path / "vendor" / PUBLIC_NAME, tmp_path / "keys" / "acme.pem")
    make_conformant(result)
    result["statement"]["robot"] = {"name": "Courier 7", "vendor": "Example Robotics", "version": "2.4"}
    return Host(tmp_path, result)

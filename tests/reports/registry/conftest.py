"""Vendors who sign results, and a registry that trusts their keys."""

import copy
import datetime as dt
import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from reports.attestation.keys import PRIVATE_NAME, PUBLIC_NAME, generate
from reports.attestation.signing import Notary
from reports.cli.registry import registry
from reports.rendering import render

SUITE, SET = "sha256:" + "5" * 64, "sha256:" + "7" * 64


class Door:
    """The front door, with what the suite knows."""

    @staticmethod
    def known() -> dict[str, Any]:
        return {"suite": SUITE, "requirement_sets": {"1.1": SET}, "profiles": {"full": ("http", "safety")}}


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
        for path, value in changes.items():
            *parents, last = path.split("__")
            place = result
            for parent in parents:
                place = place[parent]
            place[last] = value
        return self.sign_as_it_is(sent, result, vendor)

    def sign_as_it_is(self, sent: str, result: dict[str, Any], vendor: str = "vendor") -> Path:
        folder = self.folder / "sent" / sent
        folder.mkdir(parents=True)
        (folder / "result.json").write_text(json.dumps(result))
        render(folder, Notary(self.folder / vendor / PRIVATE_NAME))
        return folder / "certificate.intoto.json"

    def build(self, *options: str) -> Result:
        words = ["build", str(self.folder / "sent"), "--keys", str(self.folder / "keys"), "--out", str(self.site)]
        return CliRunner().invoke(registry, [*words, *options], obj=Door())

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
    result |= {
        "verdict": "conformant",
        "suite": {"version": "1.1.0", "contract": "1.1", "digest": SUITE},
        "requirement_set": {"name": "1.1", "digest": SET},
        "baseline": None,
        "nonce": None,
        "classes": {"http": "pass", "safety": "pass", "describe": "not-claimed"},
        "class_reasons": {},
        "requirements": [requirement("http/a"), requirement("http/b"), requirement("safety/c", "SHOULD")],
        "effort": "standard",
    }
    result["statement"]["robot"] = {"name": "Courier 7", "vendor": "Example Robotics", "version": "2.4"}
    result["statement"]["motion_allowed"] = True
    return Host(tmp_path, result)


def requirement(id_: str, level: str = "MUST", verdict: str = "pass", **more: Any) -> dict[str, Any]:
    finding = {"message": "m", "expected": "e", "seen": 1, "request": None, "response": None}
    return {
        "id": id_, "class": id_.partition("/")[0], "level": level, "source": "s", "text": "It does.", "cases": 1,
        "verdict": verdict, "reason": "", "untestable": None, "checks": [],
        "failures": [finding] if verdict == "fail" else [], **more,
    }  # fmt: skip


@pytest.fixture
def make_requirement() -> Callable[..., dict[str, Any]]:
    return requirement

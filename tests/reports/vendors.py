"""What a vendor hands in: requirements, conformant results, and the suite that a relying party knows."""

from typing import Any

SUITE, SET = "sha256:" + "5" * 64, "sha256:" + "7" * 64
DIGESTS = {"statement": "sha256:" + "1" * 64, "contract": {"openapi.yaml": "sha256:" + "2" * 64}}


class Door:
    """The front door of an installation with this suite."""

    @staticmethod
    def is_installed(_pack) -> bool:
        """Return that it is."""
        return True

    @staticmethod
    def known(_pack=None) -> dict[str, Any]:
        """Return what the suite knows."""
        ledger = {
            id_: {
                "level": level,
                "text": "It does.",
                "classes": [id_.partition("/")[0]],
                "sets": ["1.2"],
                "decides": level == "MUST",
            }
            for id_, level in (("http/a", "MUST"), ("http/b", "MUST"), ("safety/c", "SHOULD"), ("describe/d", "MAY"))
        }
        return {
            "suite": SUITE,
            "requirement_sets": {"1.2": SET},
            "ledger": ledger,
            "contract": DIGESTS["contract"],
            "profiles": {"full": ("http", "safety")},
        }


def requirement(verdict: str = "pass", level: str = "MUST", id_: str = "http/x", **more: Any) -> dict[str, Any]:
    """Return a requirement as result.json has it."""
    finding = {"message": "m", "expected": "e", "seen": 1, "request": None, "response": None}
    return {
        "id": id_, "class": id_.partition("/")[0], "level": level, "source": "s", "text": "It does.", "cases": 1,
        "verdict": verdict, "reason": "why", "untestable": None, "checks": [],
        "failures": [finding] if verdict == "fail" else [], **more,
    }  # fmt: skip


def make_conformant(result: dict[str, Any]) -> None:
    """Turn a result into one that the default policy accepts."""
    passed = [requirement(id_="http/a"), requirement(id_="http/b"), requirement("pass", "SHOULD", "safety/c")]
    passed.append(requirement("not-claimed", "MAY", "describe/d"))
    result["statement"]["claims"] = ["http", "safety"]
    result |= {
        "verdict": "conformant",
        "suite": {"version": "1.1.0", "contract": "1.1", "digest": SUITE},
        "requirement_set": {"name": "1.2", "digest": SET},
        "digests": DIGESTS,
        "classes": {"http": "pass", "safety": "pass", "describe": "not-claimed"},
        "class_reasons": {},
        "requirements": passed,
        "effort": "standard",
    }
    del result["causes"]


def change(document: dict[str, Any], changes: dict[str, Any]) -> None:
    """Set values at paths such as `statement__robot__version`."""
    for path, value in changes.items():
        *parents, last = path.split("__")
        place = document
        for parent in parents:
            place = place[parent]
        place[last] = value

"""The optional dependencies: which extra of the distribution brings which Python module."""

from collections.abc import Iterable
from importlib.util import find_spec
from typing import Final

_ROS: Final = "rclpy"
_SOAP: Final = ("zeep", "xmlschema")
#: Modules that each extra of pyproject.toml installs. `roaas robot` names its own.
EXTRAS: Final = {
    "soap": _SOAP,
    "load": (*("locust", "hdrh", "matplotlib", "numpy", "httptools", "scipy", "websockets"), *_SOAP),
}


def lacking(extra: str, user: str) -> str | None:
    """Return the message to a user without the modules of an extra; None if all are installed.

    Args:
        extra: name of the extra.
        user: what needs it, the subject of the sentence, such as "'roaas load'".
    """
    missing = next((name for name in EXTRAS[extra] if find_spec(name) is None), None)
    return _missing_text(user, missing, extra) if missing else None


def lacking_soap(interfaces: Iterable[str], user: str = "judging a SOAP service") -> str | None:
    """Return the same for a device with these interfaces: all but `rest` are SOAP services."""
    return lacking("soap", user) if {*interfaces} - {"rest"} else None


def lacking_ros(user: str) -> str | None:
    """Return the same where ROS is needed, which PyPI has for Linux on x86-64, and every system's packages."""
    if find_spec(_ROS) is not None:
        return None
    return f"{_missing_text(user, _ROS, 'ros')} (Linux x86-64), or source the setup.bash of a ROS 2 that is there"


def missing_extra(module: str | None, user: str) -> str | None:
    """Return the message to a user about a module that could not be imported; None if no extra contains it."""
    top = (module or "").partition(".")[0]
    extra = next((extra for extra, modules in EXTRAS.items() if top in modules), None)
    return _missing_text(user, top, extra) if extra else None


def _missing_text(user: str, module: str, extra: str) -> str:
    return f"{user} needs the Python module {module!r}, which is not installed: pip install 'roaas[{extra}]'"

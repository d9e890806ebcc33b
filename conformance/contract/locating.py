"""Find a contract pack: by folder, by the name of a built-in pack, or by an installed package's entry point."""

import hashlib
import importlib.util
import sys
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType

from conformance.contract.toml_file import TomlFileError

#: Entry-point group of installed packs.
ENTRY_POINTS = "roaas.packs"
MANIFEST = "pack.toml"  # name of the manifest in a pack's folder
_SUITE = Path(__file__).parents[1]
_BUILT_IN = _SUITE / "packs"
#: Folder of the generic suite: classes, ledger and checks for any web API.
GENERIC_RULES = _SUITE / "rules"


class ContractError(TomlFileError):
    """Raised for a contract pack that cannot be used; the message names the file and the fault."""


def built_in_packs() -> tuple[str, ...]:
    """Return the names of the packs in the suite."""
    return tuple(sorted(path.parent.name for path in _BUILT_IN.glob(f"*/{MANIFEST}")))


def is_installed(name: str) -> bool:
    """Return whether a name is that of a built-in pack or of an installed package's."""
    return name in built_in_packs() or bool(entry_points(group=ENTRY_POINTS, name=name))


def folder_of(pack: Path | str) -> Path:
    """Return the folder of a pack; an installed pack comes before a folder of the same name (write ``./NAME``).

    Raises:
        ContractError: there is no such pack.
    """
    name = str(pack)
    if name in built_in_packs():
        return _BUILT_IN / name
    for entry in entry_points(group=ENTRY_POINTS, name=name):
        found = importlib.util.find_spec(entry.module)
        if found is not None and found.submodule_search_locations:
            return Path(next(iter(found.submodule_search_locations)))
    if Path(pack).is_dir():
        return Path(pack)
    installed = sorted(entry.name for entry in entry_points(group=ENTRY_POINTS))
    raise ContractError(
        f"{name} is neither a folder with openapi.yaml and/or *.wsdl in it, nor one of the contract packs "
        f"{', '.join([*built_in_packs(), *installed])}"
    )


def module_of(path: Path) -> ModuleType:
    """Import a module from its file, once per process."""
    where = path.resolve()
    name = f"roaas_pack_{where.parent.name}_{where.stem}_{hashlib.sha256(bytes(where)).hexdigest()[:8]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is no Python module")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module

"""All mutants of this pack: the rows of rows.toml, and the tables in this folder, a module for each subject."""

from functools import partial
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from proof.mutation import changes, fields, xml_trees
from proof.mutation.messages import unchanged
from proof.mutation.table import Mutant, read_rows

_MODULES = {module.name: import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__)}
_ALL = {name: value for module in _MODULES.values() for name, value in vars(module).items() if name[0] != "_"}
_OTHERS = {"partial": partial, "slice": slice, "unchanged": unchanged, "fields": fields, "xml_trees": xml_trees}
_COMMON = _ALL | vars(xml_trees) | vars(fields) | vars(changes) | _OTHERS
_WORDS = {name: _COMMON | vars(module) for name, module in _MODULES.items()}
MUTANTS: tuple[Mutant, ...] = (
    *read_rows(Path(__file__).parent / "rows.toml", _WORDS),
    *(mutant for module in _MODULES.values() for mutant in getattr(module, "MUTANTS", ())),
)

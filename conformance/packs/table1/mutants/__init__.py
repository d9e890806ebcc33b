"""All mutants of this pack: the rows of the tables in this folder, a module for each subject."""

from importlib import import_module
from pkgutil import iter_modules

from conformance.mutation.mutant import Mutant

_MODULES = [import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__)]
MUTANTS: tuple[Mutant, ...] = tuple(mutant for module in _MODULES for mutant in getattr(module, "MUTANTS", ()))

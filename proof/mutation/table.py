"""Mutants written by hand, in tables: each row has a name, a requirement that kills it, a fault and a change.

A mutant is a good device with one change between it and its clients.

A row ends with an operator that makes the change, or decorates the change if that is a function or a class::

    MUTANTS = Table()
    _mutant = MUTANTS.of_class("rest-resources", "rest")

    _mutant("goal-none-empty", "goal-none", "Without a goal, GET returns 204.").altered(GET, becomes(204), status(404))

    @_mutant("goal-lingers", "goal-ended", "GET goes on returning a goal that has ended.")
    class _Lingering: ...

Rows whose change is made of words alone are data: see read_rows().
"""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeVar

from proof.mutation.changes import Make, When, Where, altered, instead, rewritten, success, values
from proof.mutation.xml_trees import tree

if TYPE_CHECKING:
    from pathlib import Path

    from proof.mutation.messages import Change, IncompleteRequest, Request, Response

_Decorated = TypeVar("_Decorated", bound=Callable[..., Any])


@dataclass(frozen=True)
class Mutant:
    """One mutant.

    Attributes:
        name: its unique name.
        says: a sentence that says what is wrong with the device.
        catches: ids of the requirements of which each must fail (MUST) or warn (SHOULD).
        interface: "rest", "soap" or "both".
        make: returns a new instance of the change, for one run.
        incomplete_request: returns what handles requests that clients never complete, or None.
        probe: whether only a ROS probe can observe the fault.
        observer: whether only a ROS probe, or a device that shows what reached it, can observe the fault.
        token: the bearer token that the device requires, or an empty text.
        serial: whether the device reads the next request only after the previous one is complete.
        backwards: whether the device answers the second of two pipelined requests first.
        forgetful: whether the device answers only the first of pipelined requests.
    """

    name: str
    says: str
    catches: tuple[str, ...]
    interface: str
    make: Callable[[], Change]
    incomplete_request: Callable[[], IncompleteRequest] | None = None
    probe: bool = False
    observer: bool = False
    token: str = ""
    serial: bool = False
    backwards: bool = False
    forgetful: bool = False


class Table:
    """The mutants of one module, in the order of their rows."""

    def __init__(self) -> None:
        self._rows: list[Row] = []

    def of_class(self, class_: str, interface: str, **common: Any) -> Callable[..., Row]:
        """Return a function that adds a row: ``row(name, requirements, says, **settings)``.

        Requirements are one or several ids without the class; one of another class has its class before it. ``common``
        are attributes of Mutant that all these rows share.
        """

        def row(name: str, requirements: str | tuple[str, ...], says: str, **settings: Any) -> Row:
            names = (requirements,) if isinstance(requirements, str) else requirements
            kills = tuple(one if "/" in one else f"{class_}/{one}" for one in names)
            made = Row(name, says, kills, {"interface": interface, **common, **settings})
            self._rows.append(made)
            return made

        return row

    def __iter__(self) -> Iterator[Mutant]:
        """Yield the mutants.

        Raises:
            ValueError: a row has no change.
        """
        return (row.mutant() for row in self._rows)


class Row:
    """One row. Calling a method of it sets the change."""

    def __init__(self, name: str, says: str, kills: tuple[str, ...], settings: dict[str, Any]) -> None:
        self._parts = {"name": name, "says": says, "catches": kills, **settings}

    def mutant(self) -> Mutant:
        """Return the mutant.

        Raises:
            ValueError: the row has no change.
        """
        if "make" not in self._parts:
            raise ValueError(f"mutant {self._parts['name']} has no change")
        return Mutant(**self._parts)

    def made(self, make: Make) -> None:
        """Use ``make``, which returns the change for a run."""
        self._parts["make"] = make

    def __call__(self, change: _Decorated) -> _Decorated:
        """Decorate the change: a stateless function, or a class that is instantiated for each run."""
        self.made(change if isinstance(change, type) else lambda: change)
        return change

    def through(self, maker: Callable[[Any], Make]) -> Callable[[_Decorated], _Decorated]:
        """Decorate an edit; ``maker`` turns it into the change."""

        def decorate(edit: _Decorated) -> _Decorated:
            self.made(maker(edit))
            return edit

        return decorate

    def altered(self, where: Where, edit: Callable[[Response], object], when: When = success, *, nth: int = 1) -> None:
        """Edit every nth response to ``where`` that fulfils ``when``."""
        self.made(altered(where, edit, when, nth=nth))

    def json(self, where: Where, edit: Callable[[Any], Any], when: When = success, *, nth: int = 1) -> None:
        """Edit the JSON value of every nth response to ``where`` that fulfils ``when``."""
        self.altered(where, values(edit), when, nth=nth)

    def xml(self, where: Where, edit: Callable[[Any], object], when: When = success, *, nth: int = 1) -> None:
        """Edit the XML tree of every nth response to ``where`` that fulfils ``when``."""
        self.altered(where, tree(edit), when, nth=nth)

    def rewritten(self, where: Where, edit: Callable[[Request], object]) -> None:
        """Edit requests before they reach the device."""
        self.made(rewritten(where, edit))

    def instead(self, where: Where, response: Callable[[Request], Response]) -> None:
        """Answer requests in place of the device."""
        self.made(instead(where, response))


def read_rows(path: Path, words: Mapping[str, Mapping[str, Any]]) -> Iterator[Mutant]:
    """Yield the mutants of a TOML file, whose rows name where, which operator, when, and which requirements notice.

    ``goal-none-empty = ["goal-none", "Without a goal, GET returns 204.", "altered(GET, becomes(204), status(404))"]``
    in the table ``[module.interface.class]``; a fourth part has further attributes of Mutant.

    Args:
        path: the path of the file.
        words: what the changes may name, by module.

    Raises:
        KeyError: a change names something else.
        ValueError: a change is made of more than words, calls and literal values.
    """
    for module, interfaces in tomllib.loads(path.read_text(encoding="utf-8")).items():
        for interface, classes in interfaces.items():
            for class_, rows in classes.items():
                add = Table().of_class(class_, interface)
                for name, (requirements, says, change, *more) in rows.items():
                    named = requirements if isinstance(requirements, str) else tuple(requirements)
                    row = add(name, named, says, **(more[0] if more else {}))
                    row.made(_value(ast.parse(change, mode="eval").body, words[module]))
                    yield row.mutant()


def _value(node: ast.expr, words: Mapping[str, Any]) -> Any:
    """Return the value of an expression of words, calls and literal values."""
    found: Any
    match node:
        case ast.Name():
            found = words[node.id]
        case ast.Attribute(value=ast.Name(id=module)) if isinstance(words[module], ModuleType):
            found = getattr(words[module], node.attr)
        case ast.Call():
            named = {keyword.arg: _value(keyword.value, words) for keyword in node.keywords if keyword.arg}
            found = _value(node.func, words)(*(_value(expr, words) for expr in node.args), **named)
        case ast.Tuple() | ast.List():
            values = [_value(expr, words) for expr in node.elts]
            found = values if isinstance(node, ast.List) else tuple(values)
        case _:
            found = ast.literal_eval(node)
    return found

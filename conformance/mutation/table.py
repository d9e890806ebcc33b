"""A table of mutants: each row says what is wrong, which requirement kills it, and what is changed.

A row is short where an operator makes the change, and decorates the change where it is a function or a class::

    MUTANTS = Table()
    _mutant = MUTANTS.of_class("rest-resources", "rest")

    _mutant("goal-none-empty", "goal-none", "Without a goal, GET is 204.").altered(GET, becomes(204), status(404))

    @_mutant("goal-lingers", "goal-ended", "A goal that has ended is still shown.")
    class _Lingering: ...
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, TypeVar

from conformance.mutation.changes import Make, When, Where, altered, instead, rewritten, success, values
from conformance.mutation.messages import Request, Response
from conformance.mutation.mutant import Mutant
from conformance.mutation.xml_trees import tree

_Decorated = TypeVar("_Decorated", bound=Callable[..., Any])


class Table:
    """The mutants of a module, in the order of their rows."""

    def __init__(self) -> None:
        self._rows: list[Row] = []

    def of_class(self, class_: str, interface: str, **common: Any) -> Callable[..., Row]:
        """Return a maker of rows: ``row(name, requirements, says, **settings)``.

        The requirements are one or several, by their names in the class; one of another class is named with its class.
        ``common`` are settings (attributes of Mutant) of all these rows.
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
    """One row, complete when one of its methods is given the change."""

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
        """Take what makes the change for each run."""
        self._parts["make"] = make

    def __call__(self, change: _Decorated) -> _Decorated:
        """Decorate the change: a function without memory, or a class of which each run gets an instance."""
        self.made(change if isinstance(change, type) else lambda: change)
        return change

    def through(self, maker: Callable[[Any], Make]) -> Callable[[_Decorated], _Decorated]:
        """Decorate an edit, of which ``maker`` makes the change."""

        def decorate(edit: _Decorated) -> _Decorated:
            self.made(maker(edit))
            return edit

        return decorate

    def altered(self, where: Where, edit: Callable[[Response], object], when: When = success, *, nth: int = 1) -> None:
        """Alter responses: see changes.altered."""
        self.made(altered(where, edit, when, nth=nth))

    def json(self, where: Where, edit: Callable[[Any], Any], when: When = success, *, nth: int = 1) -> None:
        """Alter the value of JSON responses."""
        self.altered(where, values(edit), when, nth=nth)

    def xml(self, where: Where, edit: Callable[[Any], object], when: When = success, *, nth: int = 1) -> None:
        """Alter the tree of XML responses, SOAP's among them."""
        self.altered(where, tree(edit), when, nth=nth)

    def rewritten(self, where: Where, edit: Callable[[Request], object]) -> None:
        """Alter requests: see changes.rewritten."""
        self.made(rewritten(where, edit))

    def instead(self, where: Where, response: Callable[[Request], Response]) -> None:
        """Respond in place of the robot."""
        self.made(instead(where, response))

"""Which requirements a run is for, and whether it ends at the first finding."""

from dataclasses import dataclass
from typing import Final

#: Why a requirement outside the selection has no verdict.
UNSELECTED: Final = "it was not selected for this run"
#: Why such a run certifies nothing.
WITHHELD: Final = "only selected requirements were judged, so no class passes"


@dataclass(frozen=True)
class Selection:
    """The requirements that are judged, and whether the run ends at the first finding.

    Attributes:
        ids: of the requirements; None: all.
        exit_first: whether nothing further is tested once a MUST is found to fail.
        accepted: ids whose failures the baseline accepts, so that they end no run.
    """

    ids: frozenset[str] | None = None
    exit_first: bool = False
    accepted: frozenset[str] = frozenset()

    def has(self, requirement: str) -> bool:
        """Return whether a requirement is judged."""
        return self.ids is None or requirement in self.ids

    def ends_at(self, requirement: str) -> bool:
        """Return whether a failure of a requirement ends the run."""
        return self.exit_first and self.has(requirement) and requirement not in self.accepted

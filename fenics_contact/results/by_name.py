"""Results of parts of a scene by their names."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, TypeVar

import numpy as np

from fenics_contact.errors import InvalidInputError

if TYPE_CHECKING:
    from typing import Self

    from fenics_contact.feti.torn import TornSystem
    from fenics_contact.results.forces import NodalForces

T = TypeVar("T")


class Labelled(Protocol):
    """A part of a scene with a label, which other parts may have, too."""

    @property
    def label(self) -> str:
        """The label."""


def names_of(parts: Sequence[Labelled]) -> list[str]:
    """Return the names of parts, those of the same name numbered."""
    labels = [part.label for part in parts]
    return [
        label if labels.count(label) == 1 else f"{label} {labels[: k + 1].count(label)}"
        for k, label in enumerate(labels)
    ]


class ByName(Mapping[str, T]):
    """Results by names, in the scene's order; an unknown name is an error that lists them."""

    #: What they are of, in the plural.
    kind: ClassVar[str]
    entries: Mapping[str, T]

    @classmethod
    @abstractmethod
    def of(
        cls, torn: TornSystem, forces: NodalForces, multiplier: np.ndarray, displacement: np.ndarray
    ) -> Self:
        """Return those of a state; multipliers are owned, displacements torn. Collective."""

    @abstractmethod
    def record(self) -> list[dict[str, Any]]:
        """Return them as entries of a result file."""

    @abstractmethod
    def columns(self, scale: float) -> dict[str, float]:
        """Return columns of a table of load steps; forces below rounding of a scale are zero."""

    @abstractmethod
    def facts(self, force: str, length: str) -> dict[str, str]:
        """Return each in words, with the units of force and length."""

    def __len__(self) -> int:
        """Return their number."""
        return len(self.entries)

    def __getitem__(self, name: str) -> T:
        """Return that of a name."""
        if name not in self.entries:
            raise InvalidInputError(
                f"{self.kind} of the scene are {', '.join(map(repr, self.entries)) or 'none'}, got {name!r}: "
                "use one of these names"
            )
        return self.entries[name]

    def __iter__(self) -> Iterator[str]:
        """Return the names."""
        return iter(self.entries)

"""Plies of materials across cells: composite shells."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

import ufl
from ufl.core.expr import Expr

from fenics_contact.materials.elastic import Elasticity, can_expand

#: Parts of the thickness, from 0 to 1 along the third direction of cells.
Intervals: TypeAlias = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Laminate(Elasticity):
    """Linear materials across one layer of cells, each at its intervals of the thickness.

    Stiffness and thermal stress are integrated ply by ply. Cells deform as one, as those of CalculiX's
    composite shells do. `stress` is that of the mean of the plies.
    """

    plies: tuple[tuple[Any, Intervals], ...]

    @classmethod
    def of(cls, layers: Iterable[tuple[Any, float]]) -> Laminate:
        """Return that of materials and thicknesses from the bottom; equal materials are one ply."""
        layers = list(layers)
        whole, low = sum(thickness for _, thickness in layers), 0.0
        plies = dict[Any, Intervals]()
        for material, thickness in layers:
            high = low + thickness / whole
            plies[material] = (*plies.get(material, ()), (low, high))
            low = high
        return cls(tuple(plies.items()))

    @property
    def dims(self) -> tuple[int, ...]:
        """Bodies in space."""
        return (3,)

    @property
    def parameters(self) -> tuple[float, ...]:
        """Those of all plies."""
        return tuple(value for material, _ in self.plies for value in material.parameters)

    @property
    def expands(self) -> bool:
        """Whether all plies do."""
        return all(can_expand(material) for material, _ in self.plies)

    def split(self, parameters: tuple[ufl.Constant, ...]) -> Iterator[tuple[Any, Intervals, Any]]:
        """Yield the materials with their intervals and parameters."""
        start = 0
        for material, intervals in self.plies:
            end = start + len(material.parameters)
            yield material, intervals, parameters[start:end]
            start = end

    def stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the mean of the stresses that the plies would have."""
        parts = self.split(parameters)
        return sum(share(where) * material.stress(u, own) for material, where, own in parts)

    def thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the mean of the thermal stresses of the plies."""
        parts = self.split(parameters)
        return sum(share(where) * material.thermal_stress(own) for material, where, own in parts)


def share(intervals: Intervals) -> float:
    """Return the share of the thickness."""
    return sum(high - low for low, high in intervals)


def plies_of(material: Any, parameters: Any) -> Iterable[tuple[Any, Intervals, Any]]:
    """Return the plies of a material with their parameters, one that has none as it is."""
    whole = [(material, (), parameters)]
    return getattr(material, "split", lambda _: whole)(parameters)

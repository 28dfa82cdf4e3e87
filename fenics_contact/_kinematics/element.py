"""Finite elements: the cells, the kinematics and the integration for which forms are written."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ufl

from fenics_contact import _dolfinx
from fenics_contact._kinematics.base import Kinematics
from fenics_contact._kinematics.integration import FULL, Integration
from fenics_contact.mesh.cell_types import CELL_TYPES, CellType


@dataclass(frozen=True)
class Element:
    """What forms are written for.

    `cells`: type of the cells of the mesh.
    """

    cells: str
    kinematics: Kinematics
    integration: Integration = FULL

    @property
    def name(self) -> str:
        """Its name in those of forms and in messages."""
        return " ".join(part for part in (self.kinematics.name, self.cells, self.integration.name) if part)

    @property
    def cell(self) -> CellType:
        """The type of its cells with nodes and faces."""
        return CELL_TYPES[self.cells]

    @property
    def dim(self) -> int:
        """Number of coordinates."""
        return self.kinematics.dim

    @property
    def components(self) -> int:
        """Number of components of displacements."""
        return self.kinematics.components

    @property
    def template(self) -> ufl.Mesh:
        """The mesh without coordinates on which its forms are written."""
        return _dolfinx.template(self.cells)

    @property
    def x(self) -> ufl.SpatialCoordinate:
        """The coordinates on the template."""
        return ufl.SpatialCoordinate(self.template)

    @property
    def displacements(self) -> ufl.FunctionSpace:
        """The template's space of displacements."""
        return _dolfinx.displacement_space(self.cells, self.components)

    @property
    def nodal(self) -> ufl.FunctionSpace:
        """The template's space of scalars, of the cells' degree."""
        return _dolfinx.nodal_space(self.cells)

    def cellwise(self, shape: tuple[int, ...] = ()) -> ufl.FunctionSpace:
        """Return the template's space of what is constant on each cell."""
        return _dolfinx.cellwise_space(self.cells, shape)

    def fields(self, count: int) -> list[ufl.Coefficient]:
        """Return displacements (UFL) on the template, see `_dolfinx.field_symbols`."""
        return _dolfinx.field_symbols(self.cells, count, self.components)

    def constant(self, shape: tuple[int, ...] = ()) -> ufl.Constant:
        """Return a constant (UFL) on the template."""
        return _dolfinx.constant_symbol(self.cells, shape)

    def in_space(self, *fields: Any) -> tuple[Any, ...]:
        """Return displacements (UFL) as materials get them."""
        return self.kinematics.in_space(self.x, fields)

    def on_cells(self, density: Any) -> Any:
        """Return what a material made of `in_space` (UFL), written in displacements on the cells."""
        return self.kinematics.on_cells(density, self.x)

    def integrand(self, density: Any) -> Any:
        """Return what is integrated over cells or facets for a density (UFL)."""
        return self.kinematics.integrand(density, self.x)


def plain_element(cells: str) -> Element:
    """Return the element of solid or plane cells in full integration."""
    return Element(cells, Kinematics(_dolfinx.dimension(cells)))

"""The materials on the cells of a mesh, and integrals over all of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact._fem.templates import Constants, scalar_constants, stiffness_measure
from fenics_contact._kinematics.element import Element
from fenics_contact._scene.body import Body
from fenics_contact.errors.kinds import user_code
from fenics_contact.materials.elastic import Material
from fenics_contact.materials.laminate import plies_of

#: Builds an integrand (UFL) from a material and its constants, None for materials that are left out.
OfMaterial = Callable[[Material, Constants], Expr | None]


@dataclass(frozen=True, eq=False)
class Composition:
    """The materials of the cells of one mesh.

    `cells`: tag (from 1, in the order of the materials) -> cells of the mesh; None if there is only one.
    """

    materials: tuple[Material, ...]
    cells: dict[int, np.ndarray] | None = None

    def same_as(self, other: Composition) -> bool:
        """Return whether the other has the same materials at the same cells."""
        if self.materials != other.materials or self.cells is None or other.cells is None:
            return self.materials == other.materials and self.cells is other.cells
        return all(np.array_equal(cells, other.cells[tag]) for tag, cells in self.cells.items())

    def cells_of(self, tag: int, count: int) -> np.ndarray:
        """Return the cells of a material, of ``count`` on the mesh."""
        return np.arange(count) if self.cells is None else self.cells[tag]

    @property
    def parameters(self) -> tuple[float, ...]:
        """Values of the constants of `integrate`."""
        return tuple(value for material in self.materials for value in material.parameters)


def composition(body: Body, cells: np.ndarray) -> Composition:
    """Return the materials of some cells of a body."""
    materials = body.materials
    if len(materials) == 1:
        return Composition(materials)
    number = body.material_of_cells[cells]
    here = np.unique(number)
    if len(here) == 1:
        return Composition((materials[here[0]],))
    return Composition(materials, {k + 1: np.flatnonzero(number == k) for k in range(len(materials))})


def material_sets(body: Body) -> tuple[tuple[Material, ...], ...]:
    """Return the materials of all compositions that parts of a body can have."""
    single = tuple((material,) for material in body.materials)
    return single if len(single) == 1 else (*single, body.materials)


def integrate(
    materials: tuple[Material, ...], element: Element, integrand: OfMaterial, measure: ufl.Measure
) -> tuple[ufl.Form, Constants]:
    """Return ∫ integrand over all materials (a form) and its constants."""
    return _summed(materials, element, lambda material, own: [(integrand(material, own), measure)])


def integrate_by_ply(
    materials: tuple[Material, ...], element: Element, integrand: OfMaterial, measure: ufl.Measure
) -> tuple[ufl.Form, Constants]:
    """Return the same with each ply of laminates at the points of its own; `measure`: of others."""

    def parts(material: Material, constants: Constants) -> list[tuple[Expr | None, ufl.Measure]]:
        return [
            (integrand(ply, own), stiffness_measure(element, where) if where else measure)
            for ply, where, own in plies_of(material, constants)
        ]

    return _summed(materials, element, parts)


def _summed(
    materials: tuple[Material, ...],
    element: Element,
    parts: Callable[[Material, Constants], list[tuple[Expr | None, ufl.Measure]]],
) -> tuple[ufl.Form, Constants]:
    """Return the sum of integrals over all materials, and its constants."""
    all_constants: list[ufl.Constant] = []
    form = None
    for number, material in enumerate(materials):
        constants = scalar_constants(element, len(material.parameters))
        with user_code(f"the UFL of material {type(material).__name__}"):
            found = [
                (element.integrand(element.on_cells(density)), measure)
                for density, measure in parts(material, constants)
                if density is not None
            ]
        all_constants.extend(constants)
        for density, measure in found:
            part = density * (measure if len(materials) == 1 else measure(number + 1))
            form = part if form is None else form + part
    return form, tuple(all_constants)

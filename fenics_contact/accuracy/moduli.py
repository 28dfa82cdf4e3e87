"""The moduli of a material as numbers, from its stiffness on one cell."""

from __future__ import annotations

import numpy as np

from fenics_contact import _dolfinx
from fenics_contact.fem import Composition, FormLibrary, stiffness_of_cell
from fenics_contact.mesh import CELL_TYPES
from fenics_contact.scene import Material


def moduli(forms: FormLibrary, material: Material, cell_type: str) -> np.ndarray:
    """Return C of C g : g, twice the energy per volume of a displacement gradient g.

    A material only defines a bilinear form of displacements, and its stress may be any UFL. On a cell with
    the displacement g x it stores C g : g times the volume. Some materials resist displacements, too: that
    contribution scales with the square of the cell size and is eliminated by two sizes.

    Args:
        forms: Compiled forms, including those of the material.
        material: A material whose moduli are the same everywhere.
        cell_type: Type of the cell.

    Returns:
        Shape (dim², dim²), g_kj at index dim k + j, [force / length²].
    """
    parts = Composition((material,))

    def bind(space: _dolfinx.fem.FunctionSpace) -> _dolfinx.fem.Form:
        return forms.stiffness(parts, cell_type, space)

    def on_cell_of(size: float) -> np.ndarray:
        K, points = stiffness_of_cell(size * CELL_TYPES[cell_type].nodes, cell_type, bind)
        n, dim = points.shape
        motions = np.einsum("ki,nj->nikj", np.eye(dim), points).reshape(n * dim, dim * dim)
        return np.asarray(motions.T @ K @ motions / (CELL_TYPES[cell_type].reference_volume * size**dim))

    return np.asarray((4 * on_cell_of(0.5) - on_cell_of(1.0)) / 3)

"""Elasticity in space by a stiffness matrix: that of any material, with 21 constants, and what they share."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact._base.checks import checked
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.elastic import (
    Expanding,
    as_tensor,
    expansions,
    rotated_stiffness,
    strain,
    strain_vector,
    symmetric_product,
    thermal_stresses,
    upper_triangle,
)

Triple = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]
#: The axes of the scene.
ALONG_XYZ = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def checked_axes(orientation: tuple[Triple, Triple, Triple]) -> tuple[Triple, Triple, Triple]:
    """Return material axes as plain numbers; reject rows that are no rotation."""
    axes = np.array(orientation, dtype=np.float64)
    if axes.shape != (3, 3) or not np.allclose(axes @ axes.T, np.eye(3), atol=1e-8):
        raise InvalidInputError(
            f"orientation must be three orthonormal rows, got {orientation!r}: use material_axes(a, b)"
        )
    return tuple(tuple(float(c) for c in axis) for axis in axes)  # type: ignore[return-value]


class SpatialElasticity(Expanding):
    """σ = C : (ε(u) − ΔT α) with a stiffness matrix C and expansions α in axes of the material."""

    orientation: tuple[Triple, Triple, Triple]
    thermal_expansion: tuple[float, ...] | None

    @property
    @abstractmethod
    def stiffness_matrix(self) -> np.ndarray:
        """Stiffness in the scene's axes, Voigt order xx, yy, zz, yz, xz, xy, shape (6, 6)."""

    @property
    def dims(self) -> tuple[int, ...]:
        """Bodies in space."""
        return (3,)

    @property
    def parameters(self) -> tuple[float, ...]:
        """Upper triangle of the stiffness matrix, and the thermal stress per degree where it was given."""
        C = self.stiffness_matrix
        return upper_triangle(C) + thermal_stresses(C, np.array(self.orientation), self.thermal_expansion)

    def stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return C : ε(u)."""
        return as_tensor(symmetric_product(parameters[:21], strain_vector(strain(u), 3)), 3)

    def thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return C : α, with the expansions as a strain."""
        return as_tensor(list(parameters[21:]), 3)


@dataclass(frozen=True)
@checked("moduli", "thermal_expansion")
class AnisotropicElasticity(SpatialElasticity):
    """Small-strain elasticity in space without any symmetry, from 21 constants: crystals, sheared laminates.

    Attributes:
        moduli: Stiffness matrix in material axes, six rows of six numbers, [force / length²], symmetric and
            positive definite: stress = moduli · (ε_xx, ε_yy, ε_zz, 2 ε_yz, 2 ε_xz, 2 ε_xy), the stress in
            the same order.
        orientation: Material axes as rows of a rotation matrix; see `material_axes`.
        thermal_expansion: Six components of the thermal strain per degree in material axes, in the same order
            and without factors, ε_yz and not 2 ε_yz. None for a body without thermal strain.

    Example:
        A crystal of cubic symmetry, such as silicon:

        >>> axial, across, shear = 165.7e3, 63.9e3, 79.6e3  # N/mm²
        >>> moduli = np.diag([axial - across] * 3 + [shear] * 3)
        >>> moduli[:3, :3] += across
        >>> silicon = AnisotropicElasticity(moduli, thermal_expansion=(2.6e-6, 2.6e-6, 2.6e-6, 0, 0, 0))
    """

    moduli: tuple[Six, Six, Six, Six, Six, Six]
    orientation: tuple[Triple, Triple, Triple] = ALONG_XYZ
    thermal_expansion: Six | None = None

    def __post_init__(self) -> None:
        """Reject constants for which the strain energy is not positive, and axes that are not a rotation."""
        order = "give one for each of xx, yy, zz, yz, xz, xy"
        try:
            C = np.array(self.moduli, dtype=np.float64)
        except (TypeError, ValueError):
            C = np.zeros(0)
        if C.shape != (6, 6) or not np.isfinite(C).all():
            raise InvalidInputError(f"moduli must be 6 x 6 finite numbers, got {self.moduli!r}: {order}")
        if np.abs(C - C.T).max() > 1e-9 * np.abs(C).max():
            i, j = np.unravel_index(np.abs(C - C.T).argmax(), C.shape)
            raise InvalidInputError(
                f"moduli must be symmetric, got [{i}][{j}] = {C[i, j]:g}, [{j}][{i}] = {C[j, i]:g}: fix one"
            )
        size = np.sqrt(np.abs(np.diag(C)))
        scaled = C / np.outer(size, size) if size.all() else np.zeros((6, 6))
        least = np.linalg.eigvalsh(scaled).min()
        if not least > 1e-12:
            raise InvalidInputError(
                f"moduli must give a positive energy, a scaled eigenvalue is {least:.3g}: {order}"
            )
        rows = tuple(tuple(float(value) for value in row) for row in C)
        object.__setattr__(self, "moduli", rows)
        object.__setattr__(self, "orientation", checked_axes(self.orientation))
        object.__setattr__(self, "thermal_expansion", expansions(self.thermal_expansion, 6, order))

    @cached_property
    def stiffness_matrix(self) -> np.ndarray:
        """Stiffness in the scene's axes, Voigt order xx, yy, zz, yz, xz, xy, shape (6, 6)."""
        return rotated_stiffness(np.array(self.moduli), np.array(self.orientation))

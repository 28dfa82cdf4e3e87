"""Orthotropic elasticity: three planes of symmetry, such as in wood and fibre composites."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact._base.checks import checked
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.anisotropic import ALONG_XYZ, SpatialElasticity, Triple, checked_axes
from fenics_contact.materials.elastic import (
    Expanding,
    Plate,
    as_tensor,
    check_thickness,
    checked_stiffness,
    expansions,
    numbers,
    require_positive,
    rotated_stiffness,
    strain,
    strain_vector,
    symmetric_product,
    thermal_stresses,
    upper_triangle,
)


def material_axes(first: Sequence[float], second: Sequence[float]) -> tuple[Triple, Triple, Triple]:
    """Return an orientation from two directions.

    Args:
        first: Direction of the first material axis, any length.
        second: A direction in the plane of the first two axes; its component along the first is removed.

    Returns:
        The three material axes as rows, orthonormal and right-handed.

    Raises:
        InvalidInputError: If the directions are parallel or zero.

    Example:
        >>> material_axes((0, 2, 0), (0, 1, 1))
        ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    """
    a, b = (np.array(numbers("a material axis", v, 3, "give x, y and z")) for v in (first, second))
    normal = np.cross(a, b)
    if not np.linalg.norm(normal) > 1e-8 * np.linalg.norm(a) * np.linalg.norm(b):
        raise InvalidInputError(
            f"material axes must not be parallel or zero, got {first!r} and {second!r}: give others"
        )
    a, c = a / np.linalg.norm(a), normal / np.linalg.norm(normal)
    x, y, z = ((float(v[0]), float(v[1]), float(v[2])) for v in (a, np.cross(c, a), c))
    return x, y, z


@dataclass(frozen=True)
@checked("young_moduli", "poisson_ratios", "shear_moduli", "thermal_expansion")
class OrthotropicElasticity(SpatialElasticity):
    """Small-strain orthotropic elasticity in space from nine engineering constants in material axes.

    The constants are those of uniaxial tests along the material axes 1, 2, 3: ν_ij is the contraction along j
    under tension along i.

    Attributes:
        young_moduli: E_1, E_2, E_3 > 0, [force / length²].
        poisson_ratios: ν_12, ν_13, ν_23, dimensionless.
        shear_moduli: G_12, G_13, G_23 > 0, [force / length²].
        orientation: Material axes as rows of a rotation matrix; see `material_axes`.
        thermal_expansion: Thermal expansion, strain per degree along the material axes. None for a body
            without thermal strain.
    """

    young_moduli: Triple
    poisson_ratios: Triple
    shear_moduli: Triple
    orientation: tuple[Triple, Triple, Triple] = ALONG_XYZ
    thermal_expansion: Triple | None = None

    def __post_init__(self) -> None:
        """Reject constants for which the strain energy is not positive, and axes that are not a rotation."""
        order = "give those of the axes 1, 2, 3 (pairs 12, 13, 23)"
        for name in ("young_moduli", "poisson_ratios", "shear_moduli"):
            object.__setattr__(self, name, numbers(name, getattr(self, name), 3, order))
        object.__setattr__(self, "thermal_expansion", expansions(self.thermal_expansion, 3, order))
        for modulus in (*self.young_moduli, *self.shear_moduli):
            require_positive("each of young_moduli and shear_moduli", modulus, "give it in force per area")
        object.__setattr__(self, "orientation", checked_axes(self.orientation))
        _ = self.stiffness_matrix

    @cached_property
    def stiffness_matrix(self) -> np.ndarray:
        """Stiffness in the scene's axes, Voigt order xx, yy, zz, yz, xz, xy, shape (6, 6)."""
        (E1, E2, E3), (n12, n13, n23), (G12, G13, G23) = (
            self.young_moduli,
            self.poisson_ratios,
            self.shear_moduli,
        )
        compliance = np.diag([1 / E1, 1 / E2, 1 / E3, 1 / G23, 1 / G13, 1 / G12])
        for (i, j), value in {(0, 1): -n12 / E1, (0, 2): -n13 / E1, (1, 2): -n23 / E2}.items():
            compliance[i, j] = compliance[j, i] = value
        constants = f"young_moduli {self.young_moduli} with poisson_ratios {self.poisson_ratios}"
        return rotated_stiffness(checked_stiffness(compliance, constants), np.array(self.orientation))


@dataclass(frozen=True)
@checked("young_moduli", "thermal_expansion")
class OrthotropicPlaneStress(Plate, Expanding):
    """A thin orthotropic plate without stress normal to it.

    Attributes:
        young_moduli: E_1, E_2 > 0, [force / length²].
        poisson_ratio: ν_12, dimensionless.
        shear_modulus: G_12 > 0, [force / length²].
        angle: From the x-axis to material axis 1, counterclockwise, in radians.
        thermal_expansion: Thermal expansion, strain per degree along the material axes. None for a body
            without thermal strain.
        thickness: Of the plate, [length]. None: forces of the scene are per unit of thickness.
    """

    young_moduli: tuple[float, float]
    poisson_ratio: float
    shear_modulus: float
    angle: float = 0.0
    thermal_expansion: tuple[float, float] | None = None
    thickness: float | None = None

    def __post_init__(self) -> None:
        """Reject constants for which the strain energy is not positive."""
        order = "give those of the axes 1 and 2"
        moduli = numbers("young_moduli", self.young_moduli, 2, order)
        object.__setattr__(self, "young_moduli", moduli)
        object.__setattr__(self, "thermal_expansion", expansions(self.thermal_expansion, 2, order))
        others = (self.poisson_ratio, self.shear_modulus, self.angle)
        if not np.isfinite(others).all() or min(*moduli, self.shear_modulus) <= 0:
            raise InvalidInputError(
                "OrthotropicPlaneStress needs finite constants and positive moduli, got young_moduli "
                f"{moduli} and (poisson_ratio, shear_modulus, angle) {others}: correct them"
            )
        check_thickness(self.thickness)
        _ = self.stiffness_matrix

    @property
    def dims(self) -> tuple[int, ...]:
        """Plane bodies."""
        return (2,)

    @cached_property
    def stiffness_matrix(self) -> np.ndarray:
        """Stiffness in the scene's axes, Voigt order xx, yy, xy, shape (3, 3)."""
        (E1, E2), coupling = self.young_moduli, -self.poisson_ratio / self.young_moduli[0]
        compliance = np.array([[1 / E1, coupling, 0], [coupling, 1 / E2, 0], [0, 0, 1 / self.shear_modulus]])
        constants = f"young_moduli {self.young_moduli} with poisson_ratio {self.poisson_ratio}"
        return rotated_stiffness(checked_stiffness(compliance, constants), self._axes)

    @property
    def _axes(self) -> np.ndarray:
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.array([[c, s], [-s, c]])

    @property
    def parameters(self) -> tuple[float, ...]:
        """Upper triangle of the stiffness matrix, then thermal stress per degree and thickness, if given."""
        C = self.stiffness_matrix
        thermal = thermal_stresses(C, self._axes, self.thermal_expansion)
        return upper_triangle(C) + thermal + self.of_thickness

    def stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return C : ε(u)."""
        return as_tensor(symmetric_product(parameters[:6], strain_vector(strain(u), 2)), 2)

    def thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return C : α, with the expansions as a strain."""
        return as_tensor(list(parameters[6:9]), 2)

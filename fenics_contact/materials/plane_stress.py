"""Sheets in plane stress of materials that are not linear: of any energy, and of metals in small strain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives
from ufl.core.expr import Expr

from fenics_contact._base.checks import checked
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.elastic import Expanding
from fenics_contact.materials.hyperelastic import (
    Hyperelasticity,
    deformation_gradient,
    gradient_of_sheet,
    has_mean_dilatation,
)
from fenics_contact.materials.plastic import HistoryMaterial, MaterialResponse

Parameters = tuple[ufl.Constant, ...]


class Sheet(Expanding):
    """A thin plane body of a material of bodies in space, without stress normal to it."""

    material: Any
    is_sheet: ClassVar[bool] = True

    @property
    def dims(self) -> tuple[int, ...]:
        """Plane bodies."""
        return (2,)

    @property
    def thermal_expansion(self) -> float | None:  # type: ignore[override]
        """That of the material."""
        expansion: float | None = self.material.thermal_expansion
        return expansion

    def _check(self) -> None:
        """Reject plane materials, and mean dilatations, which would couple the points of a cell."""
        name = type(self.material).__name__
        if 3 not in self.material.dims:
            raise InvalidInputError(
                f"a sheet needs a material of bodies in space, got {name}: give its material"
            )
        if has_mean_dilatation(self.material):
            raise InvalidInputError(
                f"sheets find what is normal to them at each point, got {name} with mean_dilatation=True: "
                "leave it out, sheets do not lock"
            )


def is_sheet(material: object) -> bool:
    """Return whether a material finds by itself what bodies do normal to their plane."""
    return bool(getattr(material, "is_sheet", False))


@dataclass(frozen=True)
@checked()
class HyperelasticPlaneStress(Sheet, Hyperelasticity):  # type: ignore[override]
    """A thin sheet of a hyperelastic material, without stress normal to it, under large deformations.

    The stretch λ normal to the sheet is found at each point so that ∂W/∂λ = 0. Forces are per unit of
    length normal to the undeformed sheet. Where there is no such λ there is no stress (NaN), and load steps
    are cut.

    Attributes:
        material: The material, of bodies in space; its energy must not change where the sheet is mirrored at
            its plane. Without `mean_dilatation`: sheets become thinner, and do not lock.

    Example:
        >>> from fenics_contact.materials import NeoHooke
        >>> HyperelasticPlaneStress(NeoHooke(young_modulus=3.0, poisson_ratio=0.49)).dims
        (2,)
    """

    material: Hyperelasticity

    def __post_init__(self) -> None:
        """Reject materials of other bodies, and those that a stretch in the plane would shear across it."""
        self._check()
        for axis in range(2):
            one, other = (self._sheared(axis, size) for size in (0.1, -0.1))
            if not abs(one - other) <= 1e-9 * abs(one + other):
                raise InvalidInputError(
                    f"stretched sheets of {type(self.material).__name__} must not shear across their plane, "
                    "but the energy differs by the sign of that shear: turn its axes into the plane"
                )

    def _sheared(self, axis: int, size: float) -> float:
        """Return the energy of a strained sheet that is sheared across its plane."""
        F = [[1.1, 0.05, 0.0], [0.0, 0.98, 0.0], [0.0, 0.0, 0.97]]
        F[axis][2] = size
        return float(
            expand_derivatives(ufl.as_ufl(self.material.energy(ufl.as_matrix(F), self.parameters)))(())
        )

    @property
    def parameters(self) -> tuple[float, ...]:
        """Those of the material."""
        return self.material.parameters

    def energy(self, F: Expr, parameters: Parameters) -> Expr:
        """Return W of a deformation gradient of which the part in the plane counts."""
        return self.material.energy(self._of_sheet(F, parameters), parameters)

    def density(self, F: Expr, parameters: Parameters) -> Expr:
        """Return W of a deformation gradient of which the part in the plane counts."""
        return self.energy(F, parameters)

    def work(self, u: Expr, v: Expr, parameters: Parameters) -> Expr:
        """Return the work ∂W/∂F : ∇v of the stresses of ``u`` on ``v`` per undeformed volume."""
        return self._in_space(self.material.work, parameters, u, v)

    def tangent(self, u: Expr, du: Expr, v: Expr, parameters: Parameters) -> Expr:
        """Return the growth of `work` with the displacement along ``du``, on which λ depends."""
        return self._in_space(self.material.tangent, parameters, u, du, v)

    def cauchy(self, u: Expr, parameters: Parameters) -> Expr:
        """Return Cauchy's stress of a displacement (3 x 3, UFL), [force / length²]."""
        return self._in_space(self.material.cauchy, parameters, u)

    def transverse_stress(self, u: Expr, parameters: Parameters) -> Expr:
        """Return zero."""
        return ufl.as_ufl(0.0)

    def transverse_thermal_stress(self, parameters: Parameters) -> Expr:
        """Return zero."""
        return ufl.as_ufl(0.0)

    def _moduli(self, dim: int, parameters: Parameters) -> Expr:
        """Return the moduli in the plane at F = I where the strain normal to it is free, 2 x 2 x 2 x 2."""
        M, (i, j, k, l) = self.material._moduli(3, parameters), ufl.indices(4)  # noqa: E741
        free = ufl.as_tensor(M[i, j, k, l] - M[i, j, 2, 2] * M[2, 2, k, l] / M[2, 2, 2, 2], (i, j, k, l))
        return ufl.as_tensor(
            [[[[free[a, b, c, d] for d in (0, 1)] for c in (0, 1)] for b in (0, 1)] for a in (0, 1)]
        )

    def _of_sheet(self, F: Expr, parameters: Parameters) -> Expr:
        """Return a deformation gradient in space without stress normal to the sheet."""
        return gradient_of_sheet(F, self.material.stretch_across(F, parameters))

    def _in_space(self, written: Callable[..., Expr], parameters: Parameters, u: Expr, *others: Expr) -> Expr:
        """Return what the material makes of a displacement and of others along it, as it gets those in space.

        The stress τ(F, λ) normal to the sheet stays zero along each: ∂τ/∂F : ∇v + ∂τ/∂λ δλ = 0.
        """
        from fenics_contact.materials.stand_ins import replaced, stand_in  # others go without

        F = deformation_gradient(u)
        at, stretch = ufl.variable(F), self.material.stretch_across(F, parameters)
        stress, slope = self.material.stress_across(at, stretch, parameters)
        by_gradient = ufl.diff(stress, at)
        nowhere, one = ufl.as_vector([0, 0, 0]), ufl.Identity(3)
        fields = [stand_in(3, nowhere, gradient_of_sheet(F, stretch) - one)]
        for number, each in enumerate(others, start=4):
            along = ufl.grad(each)
            growth = -stretch * ufl.inner(by_gradient, along) / slope
            fields.append(stand_in(number, nowhere, gradient_of_sheet(along, growth)))
        return replaced(written(*fields, parameters), ufl.SpatialCoordinate(u.ufl_domain()))


@dataclass(frozen=True)
@checked()
class HistoryPlaneStress(Sheet, HistoryMaterial):  # type: ignore[override]
    """A thin sheet of a metal in small strain, without stress normal to it.

    The strain normal to the sheet is found at each point by Newton's method, safeguarded by bisection, with
    the consistent tangent. Internal variables: those of the material, and that strain. Forces are per unit
    of length normal to it.

    Attributes:
        material: The material, such as `J2Plasticity`, of small strain and without `mean_dilatation`.

    Example:
        >>> from fenics_contact.materials import J2Plasticity
        >>> HistoryPlaneStress(J2Plasticity(2e5, 0.3, 235.0, isotropic_hardening=2e3)).history_size
        8
    """

    material: HistoryMaterial

    def __post_init__(self) -> None:
        """Reject materials of other bodies and of large deformations."""
        self._check()
        if self.material.finite:
            raise InvalidInputError(
                f"HistoryPlaneStress needs a material of small strain, got {type(self.material).__name__}: "
                "take one such as J2Plasticity, or a body in space"
            )

    @property
    def symmetric(self) -> bool:  # type: ignore[override]
        """Whether tangents of the material are."""
        return self.material.symmetric

    @property
    def expands(self) -> bool:
        """Whether the material does."""
        return self.material.expands

    @property
    def history_size(self) -> int:
        """Internal variables of the material, and the strain normal to the sheet."""
        return self.material.history_size + 1

    def respond(self, gradient: np.ndarray, history: np.ndarray, duration: float) -> MaterialResponse:
        """Return stress and consistent tangent in the plane, and the new history."""
        return self._settled(
            lambda strained: self.material.answer(strained, history[:, :-1], duration), gradient, history
        )

    def respond_at(
        self, gradient: np.ndarray, history: np.ndarray, duration: float, change: np.ndarray
    ) -> MaterialResponse:
        """Return the same at changes of temperature."""
        return self._settled(
            lambda strained: self.material.answer(strained, history[:, :-1], duration, change),
            gradient,
            history,
        )

    def equivalent_plastic_strain(self, history: np.ndarray) -> np.ndarray:
        """Return that of the material."""
        return self.material.equivalent_plastic_strain(history[:, :-1])

    def plastic_work(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Return that of the material."""
        return self.material.plastic_work(before[:, :-1], after[:, :-1])

    def admissible(self, history: np.ndarray) -> np.ndarray:
        """Return what the material admits, and the strain normal to the sheet."""
        return np.column_stack([self.material.admissible(history[:, :-1]), history[:, -1]])

    def _settled(
        self,
        answer: Callable[[np.ndarray], MaterialResponse],
        gradient: np.ndarray,
        history: np.ndarray,
        steps: int = 60,
    ) -> MaterialResponse:
        """Return what the material answers where no stress is normal to the sheet."""
        strained, across = np.zeros_like(gradient), history[:, -1].copy()
        strained[:, :2, :2] = gradient[:, :2, :2]
        low, high = np.full_like(across, -np.inf), np.full_like(across, np.inf)
        for _ in range(steps):
            strained[:, 2, 2] = across
            end = answer(strained)
            stress, slope = end.stress[:, 2, 2], end.tangent[:, 2, 2, 2, 2]
            left = np.abs(stress) > 1e-13 * slope * np.abs(strained).max(axis=(1, 2))
            if not left.any():
                return MaterialResponse(*_in_plane(end), np.column_stack([end.history, across]))
            low, high = np.where(stress < 0, across, low), np.where(stress > 0, across, high)
            newton = across - stress / slope
            within = (low < newton) & (newton < high)
            across[left & within] = newton[left & within]
            between = left & ~within
            across[between] = 0.5 * low[between] + 0.5 * high[between]
        raise InvalidInputError(
            f"{type(self.material).__name__} must have a strain normal to a sheet without stress there, got "
            f"none at {left.sum()} of {len(left)} points: its stress must grow with its strain"
        )


def _in_plane(end: MaterialResponse) -> tuple[np.ndarray, np.ndarray]:
    """Return stress and tangent where the strain normal to the plane is free."""
    A, stress, tangent = end.tangent, np.zeros_like(end.stress), np.zeros_like(end.tangent)
    stress[:, :2, :2] = end.stress[:, :2, :2]
    free = (
        A - np.einsum("nij,nkl->nijkl", A[..., 2, 2], A[:, 2, 2]) / A[:, 2, 2, 2, 2, None, None, None, None]
    )
    tangent[:, :2, :2, :2, :2] = free[:, :2, :2, :2, :2]
    return stress, tangent

"""The base of materials that remember: plasticity, viscoelasticity, damage."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError, user_code
from fenics_contact.scene.materials.elasticity import Elasticity, strain
from fenics_contact.scene.materials.voigt import (
    as_tensor,
    strain_vector,
    symmetric_product,
    to_vector,
    upper_triangle,
)


@displayed
@dataclass(frozen=True, eq=False)
class MaterialResponse:
    """What a material with a history answers at n points at the end of a step.

    Attributes:
        stress: First Piola-Kirchhoff stress P, shape (n, 3, 3), [force / length²]; in small strain σ.
        tangent: ∂P/∂H of the same step, H = ∇u, shape (n, 3, 3, 3, 3): [p, i, j, k, l] is ∂P_ij / ∂H_kl.
        history: Internal variables at the end of the step, shape (n, k).
    """

    stress: np.ndarray
    tangent: np.ndarray
    history: np.ndarray


class HistoryMaterial(Elasticity):
    """A material whose stress depends on what it went through; write its history_size and respond.

    The internal variables are zero at first, where the body is free of stress. Bodies in the plane are in
    plane strain. The tangent at zero displacement and history, for a step of no duration, is the model's
    linear part (`parameters`, `stress`, `stiffness`): small-strain elasticity.

    `finite` tells whether `respond` uses the whole displacement gradient, rotations included, or its
    symmetric part alone (small strain). With `mean_dilatation`, in small strain, it gets the mean change of
    volume of each cell at all of its points, against locking where flow keeps the volume.

    Example:
        A Maxwell fluid: a spring that a damper relaxes, with its stress as history.

        >>> from dataclasses import dataclass
        >>> @dataclass(frozen=True)
        ... class Maxwell(HistoryMaterial):
        ...     modulus: float
        ...     relaxation_time: float
        ...     history_size = 12  # strain and stress at the start of the step
        ...
        ...     def respond(self, gradient, history, duration):
        ...         strain = to_vector(0.5 * (gradient + gradient.swapaxes(1, 2)))
        ...         decay = np.exp(-duration / self.relaxation_time)
        ...         stress = decay * (history[:, 6:] + self.modulus * (strain - history[:, :6]))
        ...         one = np.einsum("ik,jl->ijkl", np.eye(3), np.eye(3))
        ...         tangent = 0.5 * decay * self.modulus * (one + one.swapaxes(0, 1))
        ...         return MaterialResponse(
        ...             to_tensor(stress),
        ...             np.broadcast_to(tangent, (len(stress), 3, 3, 3, 3)),
        ...             np.hstack([strain, stress]),
        ...         )
        >>> from fenics_contact.scene.materials.voigt import to_tensor, to_vector
        >>> float(Maxwell(2.0, 1.0).moduli[0, 0])
        2.0
    """

    nonlinear: ClassVar[bool] = True
    finite: ClassVar[bool] = False
    mean_dilatation: bool = False

    def __init_subclass__(cls, **given: Any) -> None:
        """Reject a model that replaces the checks of what it returns.

        Raises:
            InvalidInputError: If it has an `answer` of its own.
        """
        super().__init_subclass__(**given)
        if "answer" in vars(cls):
            raise InvalidInputError(
                f"a material with a history must define respond, {cls.__name__} defines answer, which checks "
                "what respond returns: rename it, and call super().respond there"
            )

    @property
    @abstractmethod
    def history_size(self) -> int:
        """Number k of internal variables per point."""

    @abstractmethod
    def respond(self, gradient: np.ndarray, history: np.ndarray, duration: float) -> MaterialResponse:
        """Return stress, tangent and history at the end of a step, for all points at once.

        Args:
            gradient: Displacement gradients ∂u_i/∂X_j at the end of the step, shape (n, 3, 3).
            history: Internal variables at its start, shape (n, k); must not be changed.
            duration: Of the step, in the unit of time of the material's constants; NaN where it is not known,
                with which a model that depends on it shall compute, so that it ends in NaN, too.
        """

    def answer(self, gradient: np.ndarray, history: np.ndarray, duration: float) -> MaterialResponse:
        """Return what `respond` does, as float64 arrays of the right shapes.

        Raises:
            InvalidInputError: If it returns other shapes, or numbers that are not finite where cells are not
                turned inside out.
            UserCodeError: If it raises.
        """
        name, n = type(self).__name__, len(gradient)
        with user_code(f"respond of material {name}"):
            given = self.respond(gradient, history, duration)
        shapes = {"stress": (n, 3, 3), "tangent": (n, 3, 3, 3, 3), "history": (n, self.history_size)}
        arrays = {part: np.asarray(getattr(given, part, None), dtype=np.float64) for part in shapes}
        for part, shape in shapes.items():
            if arrays[part].shape != shape:
                raise InvalidInputError(
                    f"respond of {name} must return {part} of shape {shape} for {n} points and "
                    f"{self.history_size} internal variables, got {arrays[part].shape}: return a "
                    "MaterialResponse(stress, tangent, history) with one row per point"
                )
        if np.isnan(duration) and not np.isfinite(arrays["stress"]).any():
            raise InvalidInputError(
                f"the answer of {name} depends on the duration of the step, none was given: give it, or use "
                "a material that does not depend on it"
            )
        upright = np.linalg.det(np.eye(3) + gradient) > 0 if self.finite else np.ones(n, dtype=bool)
        for part, values in arrays.items():
            bad = ~np.isfinite(values.reshape(n, -1)).all(axis=1) & upright
            if bad.any():
                raise InvalidInputError(
                    f"respond of {name} must return finite numbers, {part} has NaN or infinity at "
                    f"{bad.sum()} of {n} points, first for the displacement gradient "
                    f"{np.array2string(gradient[bad][0], precision=3, separator=', ')}: check the constants "
                    "and guard divisions by zero"
                )
        return MaterialResponse(**arrays)

    @cached_property
    def moduli(self) -> np.ndarray:
        """Elastic stiffness of the unloaded material, order xx, yy, zz, yz, xz, xy, shape (6, 6).

        Raises:
            InvalidInputError: If the unloaded material has stress, or the tangent there is not symmetric.
        """
        name = type(self).__name__
        first = self.answer(np.zeros((1, 3, 3)), np.zeros((1, self.history_size)), 0.0)
        A = first.tangent[0]
        C = to_vector(np.moveaxis(to_vector(A), -1, 0))
        size = np.abs(C).max()
        swapped = C - C.T, A - A.swapaxes(0, 1), A - A.swapaxes(2, 3)
        unsymmetric = max(np.abs(each).max() for each in swapped)
        if np.abs(first.stress).max() > 1e-10 * size:
            raise InvalidInputError(
                f"{name} must have no stress at zero displacement and history, got "
                f"{np.abs(first.stress).max():.3g}: choose internal variables that are zero in the "
                "unloaded body"
            )
        if unsymmetric > 1e-10 * size:
            raise InvalidInputError(
                f"the tangent of {name} at zero displacement and history must be that of linear elasticity, "
                f"it misses C_ijkl = C_klij = C_jikl by {unsymmetric / size:.1e} of its largest entry: check "
                "the order of its indices, [point, i, j, k, l] is dP_ij / dH_kl"
            )
        return C

    @property
    def parameters(self) -> tuple[float, ...]:
        """Upper triangle of `moduli`, which is all that the linear part knows."""
        return upper_triangle(self.moduli)

    def stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the stress of the linear part."""
        dim = len(u)
        return as_tensor(self._stress_vector(u, parameters, dim), dim)

    def transverse_stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the stress of the linear part normal to the plane."""
        return self._stress_vector(u, parameters, 3)[2]

    def transverse_thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return zero: the model has no thermal expansion."""
        return ufl.as_ufl(0.0)

    def _stress_vector(self, u: Expr, parameters: tuple[ufl.Constant, ...], dim: int) -> list[Expr]:
        if len(u) == 3:
            return symmetric_product(parameters, strain_vector(strain(u), 3))
        x, y, xy = strain_vector(strain(u), 2)
        zero = ufl.as_ufl(0.0)
        stress = symmetric_product(parameters, [x, y, zero, zero, zero, xy])
        return stress if dim == 3 else [stress[0], stress[1], stress[5]]

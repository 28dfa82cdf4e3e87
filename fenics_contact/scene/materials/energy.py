"""The base of models that are given by their energy."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives, extract_coefficients
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact.errors import InvalidInputError
from fenics_contact.scene.materials.elasticity import Elasticity, strain


class EnergyModel(Elasticity):
    """Elasticity given by its energy density W(ε), a quadratic function; write `parameters` and `energy`.

    The stress is ∂W/∂ε and the stiffness ∂²W/∂ε², both by UFL.

    Example:
        >>> from dataclasses import dataclass
        >>> import ufl
        >>> @dataclass(frozen=True)
        ... class Hooke(EnergyModel):
        ...     lame: float
        ...     shear: float
        ...
        ...     @property
        ...     def parameters(self):
        ...         return self.lame, self.shear
        ...
        ...     def energy(self, strain, parameters):
        ...         lame, shear = parameters
        ...         return lame / 2 * ufl.tr(strain) ** 2 + shear * ufl.inner(strain, strain)
        >>> Hooke(1.0, 1.0).dims
        (2, 3)
    """

    @abstractmethod
    def energy(self, strain: Expr, parameters: tuple[ufl.Constant, ...] | tuple[float, ...]) -> Expr:
        """Return the energy density (UFL scalar) of a strain tensor (dim x dim, UFL), quadratic in it."""

    def stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return ∂W/∂ε at ε(u).

        Raises:
            InvalidInputError: If the energy is not a quadratic function of the strain.
        """
        moduli = self._moduli(len(u), parameters)
        i, j, k, l = ufl.indices(4)  # noqa: E741
        return ufl.as_tensor(moduli[i, j, k, l] * strain(u)[k, l], (i, j))

    def _moduli(self, dim: int, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return ∂²W/∂ε², fourth order, symmetric in its first and in its last two indices."""
        (probe,) = _dolfinx.field_symbols("triangle" if dim == 2 else "tetrahedron", 1)
        epsilon = ufl.variable(strain(probe))
        energy = self.energy(epsilon, parameters)
        moduli = expand_derivatives(ufl.diff(ufl.diff(energy, epsilon), epsilon))
        if extract_coefficients(moduli) or not self._is_quadratic(dim):
            raise InvalidInputError(
                f"{type(self).__name__}.energy must be a quadratic function of the strain without linear "
                "terms, this one is not (or hides it: its second derivative must not mention the strain): "
                "only small-strain linear elasticity is solved here"
            )
        i, j, k, l = ufl.indices(4)  # noqa: E741
        left = ufl.as_tensor(0.5 * (moduli[i, j, k, l] + moduli[j, i, k, l]), (i, j, k, l))
        return ufl.as_tensor(0.5 * (left[i, j, k, l] + left[i, j, l, k]), (i, j, k, l))

    def _is_quadratic(self, dim: int) -> bool:
        """Test the parallelogram law, which only quadratic forms satisfy."""

        def energy(epsilon: np.ndarray) -> float:
            symmetric = ufl.as_matrix((epsilon + epsilon.T).tolist())
            return float(ufl.as_ufl(self.energy(symmetric, self.parameters))(()))

        one, other = np.random.default_rng(1).standard_normal((2, dim, dim))
        for size in (1.0, 1e-2):
            a, b = size * one, size * other
            law = energy(a + b) + energy(a - b) - 2 * energy(a) - 2 * energy(b)
            if abs(law) > 1e-10 * (abs(energy(a + b)) + abs(energy(a - b))):
                return False
        return True

"""The base of models that are given by their energy."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import ufl
from ufl.algorithms import expand_derivatives, extract_coefficients
from ufl.classes import Zero

from fenics_contact import _dolfinx
from fenics_contact.errors import InvalidInputError
from fenics_contact.scene.materials.elasticity import Elasticity, strain


class EnergyModel(Elasticity):
    """Elasticity given by its energy a volume, W(ε), a quadratic function; write `parameters` and `energy`.

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
    def energy(self, strain: Any, parameters: Any) -> Any:
        """Return the energy a volume (UFL scalar) of a strain tensor (dim x dim, UFL), quadratic in it."""

    def stress(self, u: Any, parameters: Any) -> Any:
        """Return ∂W/∂ε at ε(u).

        Raises:
            InvalidInputError: If the energy is not a quadratic function of the strain.
        """
        moduli = self._moduli(len(u), parameters)
        i, j, k, l = ufl.indices(4)  # noqa: E741
        return ufl.as_tensor(moduli[i, j, k, l] * strain(u)[k, l], (i, j))

    def _moduli(self, dim: int, parameters: Any) -> Any:
        """Return ∂²W/∂ε², fourth order, symmetric in its first and in its last two indices."""
        (probe,) = _dolfinx.field_symbols("triangle" if dim == 2 else "tetrahedron", 1)
        epsilon = ufl.variable(strain(probe))
        slope = ufl.diff(self.energy(epsilon, parameters), epsilon)
        moduli = expand_derivatives(ufl.diff(slope, epsilon))
        at_rest = ufl.replace(expand_derivatives(slope), {probe: ufl.zero(dim)})
        if extract_coefficients(moduli) or not isinstance(expand_derivatives(at_rest), Zero):
            raise InvalidInputError(
                f"{type(self).__name__}.energy must be a quadratic function of the strain without linear "
                "terms, this one is not (its second derivative depends on the strain, or its first does not "
                "vanish at rest): only small-strain linear elasticity is solved here"
            )
        i, j, k, l = ufl.indices(4)  # noqa: E741
        left = ufl.as_tensor(0.5 * (moduli[i, j, k, l] + moduli[j, i, k, l]), (i, j, k, l))
        return ufl.as_tensor(0.5 * (left[i, j, k, l] + left[i, j, l, k]), (i, j, k, l))

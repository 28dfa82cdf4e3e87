"""Models given by their energy: neo-Hookean, Mooney-Rivlin, Ogden, St. Venant-Kirchhoff, and bases."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import ufl
from ufl.algorithms import expand_derivatives, extract_coefficients
from ufl.core.expr import Expr

from fenics_contact import _dolfinx
from fenics_contact._base.checks import checked
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.elastic import (
    Elasticity,
    Expanding,
    check_expansion,
    check_isotropic,
    lame,
    numbers,
    strain,
)


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
                "terms: write it so that its second derivative does not contain the strain"
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


class Hyperelasticity(Expanding):
    """Elasticity for large deformations, given by its energy density W; write `parameters` and `energy`.

    W is the energy per undeformed volume, a function of the deformation gradient F = I + ∇u. F has three rows
    and columns in the plane, too, where F₃₃ = 1 (plane strain). The first Piola-Kirchhoff stress ∂W/∂F and
    its tangent follow by UFL. W must not change when the deformed body is rotated, and F = I must be free of
    stress. `stress` and `stiffness` are the model's linear part at F = I.

    A model with a `thermal_expansion` α that is not None, the last of its parameters (`expansion`), expands:
    at a change of temperature ΔT its energy is θ³ W(F / θ) with θ = 1 + α ΔT.

    Example:
        >>> from dataclasses import dataclass
        >>> import ufl
        >>> @dataclass(frozen=True)
        ... class CompressibleNeoHooke(Hyperelasticity):
        ...     shear: float
        ...     lame: float
        ...
        ...     @property
        ...     def parameters(self):
        ...         return self.shear, self.lame
        ...
        ...     def energy(self, F, parameters):
        ...         shear, lame = parameters
        ...         J = ufl.det(F)
        ...         volumetric = lame / 4 * (J**2 - 1 - 2 * ufl.ln(J))
        ...         return shear / 2 * (ufl.inner(F, F) - 3 - 2 * ufl.ln(J)) + volumetric
        >>> CompressibleNeoHooke(1.0, 1.0).nonlinear
        True
    """

    nonlinear: ClassVar[bool] = True
    thermal_expansion: float | None = None

    @property
    def expansion(self) -> tuple[float, ...]:
        """α where it was given, else nothing: the last of the parameters."""
        return () if self.thermal_expansion is None else (self.thermal_expansion,)

    @abstractmethod
    def energy(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return W (UFL scalar), [force / length²], of a deformation gradient (3 x 3, UFL)."""

    def density(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return W of a deformation gradient in the plane (2 x 2, in plane strain) or in space (3 x 3)."""
        return self.energy(gradient_in_space(F), parameters)

    def first_piola(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the first Piola-Kirchhoff stress ∂W/∂F (as large as F, UFL), [force / length²]."""
        gradient = ufl.variable(F)
        return ufl.diff(self.density(gradient, parameters), gradient)

    def cauchy(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return Cauchy's stress P Fᵀ / det F of a displacement (3 x 3, UFL), [force / length²]."""
        F = gradient_in_space(deformation_gradient(u))
        return self.first_piola(F, parameters) * F.T / ufl.det(F)

    def work(self, u: Expr, v: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the work ∂W/∂F : ∇v of the stresses of ``u`` on ``v`` per undeformed volume."""
        return ufl.inner(self.first_piola(deformation_gradient(u), parameters), ufl.grad(v))

    def tangent(self, u: Expr, du: Expr, v: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the growth of `work` with the displacement along ``du``."""
        return ufl.derivative(self.work(u, v, parameters), u, du)

    def stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the linear part of the stress, ∂²W/∂F² at F = I times ε(u)."""
        dim = len(u)
        i, j, k, l = ufl.indices(4)  # noqa: E741
        moduli = self._moduli(dim, parameters)
        return ufl.as_tensor(moduli[i, j, k, l] * strain(u)[k, l], (i, j))

    def transverse_stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the linear part of the stress normal to the plane."""
        moduli, epsilon = self._moduli(3, parameters), strain(u)
        return sum(moduli[2, 2, i, j] * epsilon[i, j] for i in range(2) for j in range(2))

    def thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the linear part of the stress that free expansion relieves per degree, 3 x 3."""
        i, j, k = ufl.indices(3)
        return parameters[-1] * ufl.as_tensor(self._moduli(3, parameters)[i, j, k, k], (i, j))

    def transverse_thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the same normal to the plane."""
        return parameters[-1] * sum(self._moduli(3, parameters)[2, 2, k, k] for k in range(3))

    def stress_across(
        self, F: Expr, stretch: Expr, parameters: tuple[ufl.Constant, ...]
    ) -> tuple[Expr, Expr]:
        """Return Kirchhoff's stress λ ∂W/∂λ normal to a plane, and its derivative by ln λ (UFL scalars).

        F: deformation gradient in the plane; λ: stretch normal to it, `stretch`.
        """
        across = ufl.variable(stretch)
        stress = across * ufl.diff(self.energy(gradient_of_sheet(F, across), parameters), across)
        return stress, across * ufl.diff(stress, across)

    def stretch_across(self, F: Expr, parameters: tuple[ufl.Constant, ...], steps: int = 8) -> Expr:
        """Return the stretch λ normal to a plane without stress across it (UFL scalar), by F in the plane.

        Override it where there is a formula. Newton's method for ln λ starts from what is right for small
        strains and without change of volume. Where `steps` of them do not end there is no stretch (NaN).
        """
        moduli = self._moduli(3, parameters)
        poisson = (moduli[2, 2, 0, 0] + moduli[2, 2, 1, 1]) / (2 * moduli[2, 2, 2, 2])
        stretch = ufl.det(gradient_of_sheet(F, 1)) ** (-poisson)
        for _ in range(steps):
            stress, slope = self.stress_across(F, stretch, parameters)
            stretch *= ufl.exp(-stress / slope)
        stress, slope = self.stress_across(F, stretch, parameters)
        nowhere = ufl.sqrt(-1 - stretch**2)
        return ufl.conditional(ufl.le(abs(stress), 1e-10 * slope), stretch, nowhere)

    def _moduli(self, dim: int, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return ∂²W/∂F² at F = I."""
        # The variable keeps UFL from simplifying the identity away before it has differentiated.
        F = ufl.variable(ufl.Identity(dim))
        return expand_derivatives(ufl.diff(ufl.diff(self.density(F, parameters), F), F))


def deformation_gradient(u: Expr) -> Expr:
    """Return F = I + ∇u."""
    return ufl.Identity(len(u)) + ufl.grad(u)


def gradient_in_space(F: Expr) -> Expr:
    """Return a deformation gradient as 3 x 3 tensor; one in the plane is that of plane strain."""
    if F.ufl_shape == (3, 3):
        return F
    return gradient_of_sheet(F, 1)


def gradient_of_sheet(F: Expr, stretch: Expr | int) -> Expr:
    """Return a deformation gradient (3 x 3) by its part in the plane and the stretch normal to it."""
    return ufl.as_tensor([[F[0, 0], F[0, 1], 0], [F[1, 0], F[1, 1], 0], [0, 0, stretch]])


def is_nonlinear(material: object) -> bool:
    """Return whether a material's stress is no linear function of the displacement."""
    return bool(getattr(material, "nonlinear", False))


def is_finite_strain(material: object) -> bool:
    """Return whether a material is made for large deformations, rotations included."""
    return is_nonlinear(material) and bool(getattr(material, "finite", True))


class NearlyIncompressible(Hyperelasticity):
    """Hyperelasticity with W(F) = shape_energy(F) + volume_energy(J): write both and parameters.

    J = det F. With `mean_dilatation` the volume energy is that of the mean J of each cell,
    ∫ U(J) dV = V U(∫ J dV / V): each cell is asked to keep its volume, and not each of its points, which
    would make linear cells lock. All that grows with the bulk modulus must be in the volume energy.
    """

    mean_dilatation: bool = False

    @abstractmethod
    def shape_energy(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the energy density (UFL scalar) of changes of shape by F, 3 x 3, [force / length²]."""

    @abstractmethod
    def volume_energy(self, J: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the energy density (UFL scalar) of a change of volume by the factor J, [force / length²]."""

    def energy(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return W(F)."""
        return self.shape_energy(F, parameters) + self.volume_energy(ufl.det(F), parameters)

    def shape_stress(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the derivative of the shape energy by F, 2 x 2 or 3 x 3."""
        gradient = ufl.variable(F)
        return ufl.diff(self.shape_energy(gradient_in_space(gradient), parameters), gradient)

    def first_piola(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the first Piola-Kirchhoff stress ∂W/∂F (as large as F, UFL), [force / length²]."""
        return self.shape_stress(F, parameters) + self.pressure(ufl.det(F), parameters) * cofactor(F)

    def shape_tangent(self, u: Expr, du: Expr, v: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the growth of the work of the shape stress on ``v`` with the displacement along ``du``."""
        stress = self.shape_stress(deformation_gradient(u), parameters)
        return ufl.derivative(ufl.inner(stress, ufl.grad(v)), u, du)

    def tangent(self, u: Expr, du: Expr, v: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the growth of the work of the shape stress with the displacement along ``du``."""
        pressure = self.pressure(ufl.det(deformation_gradient(u)), parameters)
        volume = ufl.derivative(pressure * volume_change(u, v), u, du)
        return self.shape_tangent(u, du, v, parameters) + volume

    def pressure(self, J: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return U'(J), [force / length²]; positive in tension."""
        dilatation = ufl.variable(J)
        return ufl.diff(self.volume_energy(dilatation, parameters), dilatation)

    def bulk_modulus_at(self, J: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return U''(J), [force / length²]."""
        dilatation = ufl.variable(J)
        return ufl.diff(ufl.diff(self.volume_energy(dilatation, parameters), dilatation), dilatation)

    def unseen_modulus(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return what is missing in the shape energy of the bulk modulus 2G/3 at F = I, [force / length²].

        With it the shape energy of small strains is G ε : ε, as in Lamé's form: no strain is without energy.
        """
        size = ufl.variable(ufl.as_ufl(0.0))
        shear = ufl.as_tensor([[1.0, size, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        along_shear, along_volume = (
            ufl.diff(ufl.diff(self.shape_energy(F, parameters), size), size)
            for F in (shear, (1.0 + size) * ufl.Identity(3))
        )
        return ufl.max_value(2 * along_shear / 3 - along_volume / 9, 0)


def cofactor(F: Expr) -> Expr:
    """Return ∂ det F/∂F."""
    gradient = ufl.variable(F)
    return ufl.diff(ufl.det(gradient), gradient)


def volume_change(u: Expr, v: Expr) -> Expr:
    """Return cof F : ∇v, the change of J along ``v``."""
    return ufl.inner(cofactor(deformation_gradient(u)), ufl.grad(v))


def has_mean_dilatation(material: object) -> bool:
    """Return whether a material feels the mean change of volume of each cell, not that of each point."""
    return bool(getattr(material, "mean_dilatation", False))


class IsotropicRubber(NearlyIncompressible):
    """Isotropic models with a shape energy of Ī₁ and Ī₂, the invariants of FᵀF without its change of volume.

    Derivatives go through the two invariants, so that energies of hundreds of terms still compile in seconds.
    """

    @abstractmethod
    def invariant_energy(self, first: Expr, second: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the shape energy (UFL scalar) of the invariants, [force / length²]."""

    def shape_energy(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the shape energy of F, 3 x 3."""
        first, second = isochoric_invariants(F)
        return self.invariant_energy(first, second, parameters)

    def shape_stress(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the derivative of the shape energy by F, 2 x 2 or 3 x 3."""
        gradient = ufl.variable(F)
        own = [ufl.variable(invariant) for invariant in isochoric_invariants(gradient_in_space(gradient))]
        energy = self.invariant_energy(own[0], own[1], parameters)
        return sum(ufl.diff(energy, one) * ufl.diff(one, gradient) for one in own)

    def shape_tangent(self, u: Expr, du: Expr, v: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the growth of the work of the shape stress on ``v`` with the displacement along ``du``."""
        F = ufl.variable(deformation_gradient(u))
        own = [ufl.variable(invariant) for invariant in isochoric_invariants(gradient_in_space(F))]
        energy = self.invariant_energy(own[0], own[1], parameters)
        slopes = [ufl.diff(energy, one) for one in own]
        along_v, along_du = ([ufl.inner(ufl.diff(one, F), ufl.grad(w)) for one in own] for w in (v, du))
        tangent = sum(slope * ufl.derivative(a, u, du) for slope, a in zip(slopes, along_v, strict=True))
        for slope, a in zip(slopes, along_v, strict=True):
            tangent += sum(ufl.diff(slope, one) * b * a for one, b in zip(own, along_du, strict=True))
        return tangent

    def unseen_modulus(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return 2G/3: changes of volume have no shape energy."""
        return 2 * self._shear_modulus(parameters) / 3

    def _shear_modulus(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return 2 (∂/∂Ī₁ + ∂/∂Ī₂) at F = I."""
        own = [ufl.variable(ufl.as_ufl(3.0)) for _ in range(2)]
        energy = self.invariant_energy(own[0], own[1], parameters)
        return 2 * sum(ufl.diff(energy, one) for one in own)

    def _moduli(self, dim: int, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return ∂²W/∂F² at F = I, of the shear modulus and the bulk modulus U''(1)."""
        shear = self._shear_modulus(parameters)
        bulk, I = self.bulk_modulus_at(ufl.as_ufl(1.0), parameters), ufl.Identity(dim)  # noqa: E741
        i, j, k, l = ufl.indices(4)  # noqa: E741
        symmetric = I[i, k] * I[j, l] + I[i, l] * I[j, k]
        return ufl.as_tensor((bulk - 2 * shear / 3) * I[i, j] * I[k, l] + shear * symmetric, (i, j, k, l))


def isochoric_invariants(F: Expr) -> tuple[Expr, Expr]:
    """Return the first and second invariant of C = FᵀF without its change of volume (det C = 1)."""
    C, J = F.T * F, ufl.det(F)
    first, second = ufl.tr(C), (ufl.tr(C) ** 2 - ufl.inner(C, C)) / 2
    return J ** (-2 / 3) * first, J ** (-4 / 3) * second


@dataclass(frozen=True)
@checked()
class NeoHooke(NearlyIncompressible):
    """Compressible neo-Hookean elasticity, W = μ/2 (tr FᵀF − 3 − 2 ln J) + λ/2 (ln J)² with J = det F.

    Its linear part is isotropic elasticity with the same constants. In the plane it is in plane strain.

    Attributes:
        young_modulus: Young's modulus E > 0 of small strains, [force / length²].
        poisson_ratio: Poisson's ratio ν in (−1, 0.5) of small strains, dimensionless.
        mean_dilatation: Whether λ acts on the mean dilatation of each cell, against locking at ν near 0.5.
        thermal_expansion: Thermal expansion α, stretch per degree. None for a body without.

    References:
        J. Bonet, R. D. Wood, Nonlinear Continuum Mechanics for Finite Element Analysis, 2nd ed., Cambridge
        2008, section 6.4.3.
    """

    young_modulus: float
    poisson_ratio: float
    mean_dilatation: bool = False
    thermal_expansion: float | None = None

    def __post_init__(self) -> None:
        """Reject constants for which the strain energy is not positive."""
        check_isotropic(self.young_modulus, self.poisson_ratio, self.thermal_expansion)

    @property
    def parameters(self) -> tuple[float, ...]:
        """First Lamé parameter and shear modulus, [force / length²], and α where it was given."""
        return (*lame(self.young_modulus, self.poisson_ratio), *self.expansion)

    def shape_energy(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return μ/2 (tr FᵀF − 3 − 2 ln J)."""
        return parameters[1] / 2 * (ufl.inner(F, F) - 3 - 2 * ufl.ln(ufl.det(F)))

    def volume_energy(self, J: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return λ/2 (ln J)²."""
        return parameters[0] / 2 * ufl.ln(J) ** 2


def power_sum(first: Expr, second: Expr, exponent: float, count: int = 32) -> Expr:
    """Return the sum of powers of three positive numbers x whose product is one.

    Integer powers follow from Newton's identities. Others use xʳ = sin(πr)/π ∫ tʳ⁻¹ x/(x + t) dt, 0 < r < 1,
    from 0 to ∞, by Gauss-Jacobi quadrature in v = (1 − t)/(1 + t), in which it is exact at x = 1. Sums of the
    rational functions are rational functions of the invariants: nowhere is there an eigenvalue. The relative
    error is 1e-9 for x between 1/36 and 36, which are stretches of 1/6 to 6, and 5e-6 at stretches of 10.
    """
    if exponent < 0:
        return power_sum(second, first, -exponent, count)  # of the reciprocals
    whole = int(np.floor(exponent))
    rest = exponent - whole
    p = [ufl.as_ufl(3.0), first, first**2 - 2 * second]
    while len(p) < whole + 3:
        p.append(first * p[-1] - second * p[-2] + p[-3])
    if rest == 0.0:
        return p[whole]
    from scipy.special import roots_jacobi  # for models that need it

    with np.errstate(divide="ignore", invalid="ignore"):  # of what SciPy does not use
        v, weights = roots_jacobi(count, rest - 1, -rest)
    poles, factors = (1 - v) / (1 + v), 2 * np.sin(np.pi * rest) / np.pi * weights / (1 + v)
    # The sum of xᵏ/(x + t), k = whole + 1, is tr Aᵏ adj(A + t) / det(A + t).
    a, b, c = p[whole], first * p[whole + 1] - p[whole + 2], p[whole + 1]
    return sum(
        float(factor) * (a + t * b + t**2 * c) / (1 + t * second + t**2 * first + t**3)
        for t, factor in zip(poles.tolist(), factors, strict=True)
    )


@dataclass(frozen=True)
@checked()
class MooneyRivlin(IsotropicRubber):
    """Rubber under moderate strains, W = c10 (Ī₁ − 3) + c01 (Ī₂ − 3) + K/2 (J − 1)².

    Ī₁ and Ī₂ are the invariants of FᵀF without its change of volume. The shear modulus of small strains is
    2 (c10 + c01). With c01 = 0 it is a neo-Hookean model. In the plane it is in plane strain.

    Attributes:
        c10: Constant c10, [force / length²]; c10 + c01 > 0.
        c01: Constant c01, [force / length²].
        bulk_modulus: Bulk modulus K > 0, [force / length²].
        mean_dilatation: Whether K acts on the mean dilatation of each cell, against locking where K is large.
        thermal_expansion: Thermal expansion α, stretch per degree. None for a body without.

    References:
        R. W. Ogden, Non-Linear Elastic Deformations, Ellis Horwood 1984, chapter 7.
    """

    c10: float
    c01: float
    bulk_modulus: float
    mean_dilatation: bool = False
    thermal_expansion: float | None = None

    def __post_init__(self) -> None:
        """Reject constants for which the energy of small strains is not positive."""
        check_expansion(self.thermal_expansion)
        check_moduli("the shear modulus 2 (c10 + c01)", 2 * (self.c10 + self.c01), self.bulk_modulus)

    @property
    def parameters(self) -> tuple[float, ...]:
        """The constants c10, c01 and K, [force / length²], and α where it was given."""
        return self.c10, self.c01, self.bulk_modulus, *self.expansion

    def invariant_energy(self, first: Expr, second: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return c10 (Ī₁ − 3) + c01 (Ī₂ − 3)."""
        return parameters[0] * (first - 3) + parameters[1] * (second - 3)

    def volume_energy(self, J: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return K/2 (J − 1)²."""
        return parameters[2] / 2 * (J - 1) ** 2


@dataclass(frozen=True)
@checked("shear_moduli", "exponents")
class Ogden(IsotropicRubber):
    """Rubber under large strains, W = Σ μ_p/α_p (λ̄₁^α_p + λ̄₂^α_p + λ̄₃^α_p − 3) + K/2 (J − 1)².

    λ̄ are the principal stretches without the change of volume. The shear modulus of small strains is
    ½ Σ μ_p α_p. In the plane it is in plane strain.

    Attributes:
        shear_moduli: μ_p, [force / length²], of any sign.
        exponents: α_p, as many, not zero.
        bulk_modulus: Bulk modulus K > 0, [force / length²].
        mean_dilatation: Whether K acts on the mean dilatation of each cell, against locking where K is large.
        thermal_expansion: Thermal expansion α, stretch per degree. None for a body without.

    References:
        R. W. Ogden, Large deformation isotropic elasticity, Proc. R. Soc. Lond. A 326 (1972) 565-584.
    """

    shear_moduli: tuple[float, ...]
    exponents: tuple[float, ...]
    bulk_modulus: float
    mean_dilatation: bool = False
    thermal_expansion: float | None = None

    def __post_init__(self) -> None:
        """Reject constants for which the energy of small strains is not positive."""
        check_expansion(self.thermal_expansion)
        order = "give one μ and one exponent for each term"
        count = np.size(self.shear_moduli)
        for name in ("shear_moduli", "exponents"):
            object.__setattr__(self, name, numbers(name, getattr(self, name), count, order))
        check_exponents(self.exponents)
        shear = sum(mu * alpha for mu, alpha in zip(self.shear_moduli, self.exponents, strict=True)) / 2
        check_moduli("the shear modulus ½ Σ μ_p α_p", shear, self.bulk_modulus)

    @property
    def parameters(self) -> tuple[float, ...]:
        """μ_1, μ_2, ... and K, [force / length²], and α if given; the exponents are part of the form."""
        return *self.shear_moduli, self.bulk_modulus, *self.expansion

    def invariant_energy(self, first: Expr, second: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return Σ μ_p/α_p (λ̄₁^α_p + λ̄₂^α_p + λ̄₃^α_p − 3)."""
        return sum(
            shear / alpha * (power_sum(first, second, alpha / 2) - 3)
            for shear, alpha in zip(parameters, self.exponents, strict=False)
        )

    def volume_energy(self, J: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return K/2 (J − 1)²."""
        return parameters[len(self.exponents)] / 2 * (J - 1) ** 2

    def stress_across(
        self, F: Expr, stretch: Expr, parameters: tuple[ufl.Constant, ...]
    ) -> tuple[Expr, Expr]:
        """Return Σ μ_p (λ̄^α_p − ⅓ Σ λ̄_i^α_p) + K J (J − 1), and its derivative by ln λ."""
        whole = gradient_of_sheet(F, stretch)
        (first, second), J = isochoric_invariants(whole), ufl.det(whole)
        bulk = parameters[len(self.exponents)]
        stress, slope = bulk * J * (J - 1), bulk * J * (2 * J - 1)
        for shear, alpha in zip(parameters, self.exponents, strict=False):
            own, total = (stretch * J ** (-1 / 3)) ** alpha, power_sum(first, second, alpha / 2)
            stress += shear * (own - total / 3)
            slope += shear * alpha * (own + total / 3) / 3
        return stress, slope


def check_exponents(exponents: Sequence[float]) -> None:
    """Reject terms of an energy without influence."""
    if not all(exponents):
        raise InvalidInputError(f"exponents must not be zero, got {exponents}: leave out such terms")


def check_moduli(name: str, shear: float, bulk: float) -> None:
    """Reject moduli of small strains that are not positive."""
    if not min(shear, bulk) > 0 or not np.isfinite([shear, bulk]).all():
        raise InvalidInputError(
            f"{name} and the bulk modulus must be positive, got {shear:g} and {bulk:g}: give force per area"
        )


@dataclass(frozen=True)
@checked()
class StVenantKirchhoff(Hyperelasticity):
    """Small strains under large rotations, W = λ/2 (tr E)² + μ E : E with E = (FᵀF − I) / 2.

    It softens under compression and lets cells collapse: a bar carries no larger load than at 58 % of its
    length. Take `NeoHooke` where strains are not small. In the plane it is in plane strain.

    Attributes:
        young_modulus: Young's modulus E > 0 of small strains, [force / length²].
        poisson_ratio: Poisson's ratio ν in (−1, 0.5) of small strains, dimensionless.
        thermal_expansion: Thermal expansion α, stretch per degree. None for a body without.
    """

    young_modulus: float
    poisson_ratio: float
    thermal_expansion: float | None = None

    def __post_init__(self) -> None:
        """Reject constants for which the strain energy is not positive."""
        check_isotropic(self.young_modulus, self.poisson_ratio, self.thermal_expansion)

    @property
    def parameters(self) -> tuple[float, ...]:
        """First Lamé parameter and shear modulus, [force / length²], and α where it was given."""
        return (*lame(self.young_modulus, self.poisson_ratio), *self.expansion)

    def energy(self, F: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return W(F) with ``parameters`` = (λ, μ, ...)."""
        lame_parameter, shear = parameters[:2]
        E = (F.T * F - ufl.Identity(3)) / 2
        return lame_parameter / 2 * ufl.tr(E) ** 2 + shear * ufl.inner(E, E)

    def stretch_across(self, F: Expr, parameters: tuple[ufl.Constant, ...], steps: int = 0) -> Expr:
        """Return √(1 − λ/(λ + 2μ) (tr FᵀF − 2)) of F in the plane; none is left where that is not real."""
        lame_parameter, shear = parameters[:2]
        squares = sum(F[i, j] ** 2 for i in range(2) for j in range(2))
        return ufl.sqrt(1 - lame_parameter / (lame_parameter + 2 * shear) * (squares - 2))

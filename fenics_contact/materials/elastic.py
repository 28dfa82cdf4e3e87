"""Small-strain elasticity: what a material must provide, isotropic models, Voigt vectors."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact._base.checks import checked
from fenics_contact.errors import InvalidInputError
from fenics_contact.materials.kernels import rigid_body_modes


def require_positive(name: str, value: float, meaning: str) -> None:
    """Reject a constant that is not finite and above zero."""
    if not (np.isfinite(value) and value > 0):
        raise InvalidInputError(f"{name} must be a positive number, got {value!r}: {meaning}")


def check_isotropic(young_modulus: float, poisson_ratio: float, thermal_expansion: float | None) -> None:
    """Reject constants for which the strain energy is not positive."""
    require_positive("young_modulus", young_modulus, "give E in force per area, for steel 2.1e5 in N/mm²")
    if not -1 < poisson_ratio < 0.5:
        raise InvalidInputError(
            f"poisson_ratio must lie between -1 and 0.5 (excluded), got {poisson_ratio!r}: use 0.3 for steel"
        )
    check_expansion(thermal_expansion)


def check_expansion(thermal_expansion: float | None) -> None:
    """Reject an expansion that is not finite."""
    if thermal_expansion is not None and not np.isfinite(thermal_expansion):
        raise InvalidInputError(
            f"thermal_expansion must be a finite number or None, got {thermal_expansion!r}: for steel 1.2e-5"
        )


def isotropic_constants(material: object) -> tuple[float, float] | None:
    """Return E and ν of an isotropic material at its initial temperature, None if it has none."""
    constants = getattr(material, "at_rest", None)
    if constants is None:
        constants = getattr(material, "young_modulus", None), getattr(material, "poisson_ratio", None)
    young, poisson = constants
    return (float(young), float(poisson)) if young is not None and poisson is not None else None


def is_isotropic(material: object) -> bool:
    """Return whether a material is one of the isotropic ones here; models derived from these may not be."""
    return type(material) in (IsotropicElasticity, PlaneStrain, PlaneStress)


def lame(young_modulus: float, poisson_ratio: float) -> tuple[float, float]:
    """Return the first Lamé parameter λ and the shear modulus G, [force / length²]."""
    E, nu = young_modulus, poisson_ratio
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def numbers(name: str, values: Sequence[float], count: int, meaning: str) -> tuple[float, ...]:
    """Return ``count`` finite numbers as floats."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.full(0, np.nan)
    if array.shape != (count,) or not np.isfinite(array).all():
        raise InvalidInputError(f"{name} must be {count} finite numbers, got {values!r}: {meaning}")
    return tuple(float(value) for value in array)


def expansions(values: Sequence[float] | None, count: int, meaning: str) -> tuple[float, ...] | None:
    """Return ``count`` thermal expansions as floats, None if none were given."""
    return None if values is None else numbers("thermal_expansion", values, count, meaning)


def strain(u: Expr) -> Expr:
    """Return the small strain ε(u) = ½ (∇u + ∇uᵀ)."""
    return ufl.sym(ufl.grad(u))


class Elasticity(ABC):
    """Elasticity with work σ(u) : ε(v) and rigid motions as its kernel; write `parameters` and `stress`.

    A plane model with stress normal to its plane adds the members of `Transverse`; otherwise its von Mises
    stress is that of plane stress. A model with thermal expansion adds those of `Thermoelastic`.

    Example:
        Two independent moduli, in the plane or in space:

        >>> from dataclasses import dataclass
        >>> import ufl
        >>> @dataclass(frozen=True)
        ... class BulkAndShear(Elasticity):
        ...     bulk: float
        ...     shear: float
        ...
        ...     @property
        ...     def parameters(self):
        ...         return self.bulk, self.shear
        ...
        ...     def stress(self, u, parameters):
        ...         bulk, shear = parameters
        ...         return bulk * ufl.div(u) * ufl.Identity(len(u)) + 2 * shear * ufl.dev(strain(u))
        >>> BulkAndShear(3.0, 1.0).dims
        (2, 3)
    """

    @property
    def dims(self) -> tuple[int, ...]:
        """Plane bodies and bodies in space, unless a model overrides it."""
        return (2, 3)

    @property
    @abstractmethod
    def parameters(self) -> tuple[float, ...]:
        """Values of the model's constants, in the order in which `stress` receives them."""

    @abstractmethod
    def stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the stress tensor (dim x dim, symmetric, UFL), linear in the displacement ``u``."""

    def stiffness(self, u: Expr, v: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return σ(u) : ε(v)."""
        return ufl.inner(self.stress(u, parameters), strain(v))

    def kernel(self, points: np.ndarray) -> np.ndarray:
        """Return the rigid body modes."""
        return rigid_body_modes(points)


class Expanding(Elasticity):
    """A model that may have a thermal expansion α, None without one."""

    thermal_expansion: Any

    @property
    def expands(self) -> bool:
        """Whether α was given."""
        return self.thermal_expansion is not None


class Plate(Elasticity):
    """A plane model with a thickness: forces, moments and energies are those of the whole thickness.

    It is the last of the parameters; stresses do not depend on it, work per area of the plane does.
    """

    thickness: float | None

    @property
    def of_thickness(self) -> tuple[float, ...]:
        """The thickness where it was given, else nothing."""
        return () if self.thickness is None else (self.thickness,)

    def per_area(self, density: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return a density per volume as one per area of the plane (UFL)."""
        return parameters[-1] * density if self.of_thickness else density

    def stiffness(self, u: Expr, v: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return σ(u) : ε(v), times the thickness."""
        return self.per_area(super().stiffness(u, v, parameters), parameters)


def check_thickness(thickness: float | None) -> None:
    """Reject a thickness that is not positive."""
    if thickness is not None:
        require_positive("thickness", thickness, "give a length, or None for forces per unit of thickness")


def thickness_of(material: object) -> float | None:
    """Return the thickness of a material of plane bodies, None without one."""
    return material.thickness if isinstance(material, Plate) else None


@dataclass(frozen=True)
@checked()
class Isotropic(Expanding):
    """The constants that all isotropic models have."""

    young_modulus: float
    poisson_ratio: float
    thermal_expansion: float | None = None

    def __post_init__(self) -> None:
        """Reject constants for which the strain energy is not positive."""
        check_isotropic(self.young_modulus, self.poisson_ratio, self.thermal_expansion)

    @property
    def expansion(self) -> tuple[float, ...]:
        """α where it was given, else nothing: the last of the parameters."""
        return () if self.thermal_expansion is None else (self.thermal_expansion,)


class LameModel(Isotropic):
    """Isotropic models with σ = λ tr(ε) I + 2 G ε − ΔT (3λ + 2G) α I, in space and in the plane."""

    @property
    def parameters(self) -> tuple[float, ...]:
        """First Lamé parameter and shear modulus, [force / length²], and α where it was given."""
        return (*lame(self.young_modulus, self.poisson_ratio), *self.expansion)

    def stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return σ(u) with ``parameters`` = (λ, G, ...)."""
        return parameters[0] * ufl.div(u) * ufl.Identity(len(u)) + 2 * parameters[1] * strain(u)

    def thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return (3λ + 2G) α I."""
        lame_parameter, shear, expansion = parameters[:3]
        return (3 * lame_parameter + 2 * shear) * expansion * ufl.Identity(self.dims[0])


@dataclass(frozen=True)
class IsotropicElasticity(LameModel):
    """Small-strain isotropic linear elasticity in space, σ = λ tr(ε) I + 2 G ε − ΔT (3λ + 2G) α I.

    Attributes:
        young_modulus: Young's modulus E > 0, [force / length²].
        poisson_ratio: Poisson's ratio ν in (−1, 0.5), dimensionless.
        thermal_expansion: Thermal expansion α, strain per degree. None for a body without thermal strain.
    """

    @property
    def dims(self) -> tuple[int, ...]:
        """Bodies in space; in the plane use `PlaneStrain` or `PlaneStress`."""
        return (3,)


@dataclass(frozen=True)
@checked()
class PlaneStrain(Plate, LameModel):
    """A slice of a long body that cannot strain along its length, σ = λ tr(ε) I + 2 G ε − ΔT (3λ + 2G) α I.

    Attributes:
        young_modulus: Young's modulus E > 0, [force / length²].
        poisson_ratio: Poisson's ratio ν in (−1, 0.5), dimensionless.
        thermal_expansion: Thermal expansion α, strain per degree. None for a body without thermal strain.
        thickness: Of the slice, [length]. None: forces of the scene are per unit of thickness.
    """

    thickness: float | None = None

    def __post_init__(self) -> None:
        """Reject constants for which the strain energy is not positive."""
        super().__post_init__()
        check_thickness(self.thickness)

    @property
    def dims(self) -> tuple[int, ...]:
        """Plane bodies."""
        return (2,)

    @property
    def parameters(self) -> tuple[float, ...]:
        """First Lamé parameter, shear modulus, [force / length²], and what was given of α and thickness."""
        return (*super().parameters, *self.of_thickness)

    def transverse_stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return λ tr(ε)."""
        return parameters[0] * ufl.div(u)

    def transverse_thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return (3λ + 2G) α."""
        lame_parameter, shear, expansion = parameters[:3]
        return (3 * lame_parameter + 2 * shear) * expansion


@dataclass(frozen=True)
@checked()
class PlaneStress(Plate, Isotropic):
    """A thin plate without stress normal to it, σ = E/(1−ν²) ((1−ν) ε + ν tr(ε) I) − ΔT E/(1−ν) α I.

    Attributes:
        young_modulus: Young's modulus E > 0, [force / length²].
        poisson_ratio: Poisson's ratio ν in (−1, 0.5), dimensionless.
        thermal_expansion: Thermal expansion α, strain per degree. None for a body without thermal strain.
        thickness: Of the plate, [length]. None: forces of the scene are per unit of thickness.
    """

    thickness: float | None = None

    def __post_init__(self) -> None:
        """Reject constants for which the strain energy is not positive."""
        super().__post_init__()
        check_thickness(self.thickness)

    @property
    def dims(self) -> tuple[int, ...]:
        """Plane bodies."""
        return (2,)

    @property
    def parameters(self) -> tuple[float, ...]:
        """E, [force / length²], ν, and what was given of α and thickness."""
        return (self.young_modulus, self.poisson_ratio, *self.expansion, *self.of_thickness)

    def stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return σ(u) in the plane."""
        E, nu = parameters[0], parameters[1]
        return E / (1 - nu**2) * ((1 - nu) * strain(u) + nu * ufl.div(u) * ufl.Identity(2))

    def thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return E α / (1 − ν) I."""
        E, nu, expansion = parameters[:3]
        return E * expansion / (1 - nu) * ufl.Identity(2)


@runtime_checkable
class Material(Protocol):
    """A linear elastic model; `Elasticity` and `EnergyModel` leave only two of these members to write.

    Numbers that may differ from body to body are returned by `parameters` and reach the forms as UFL
    constants, so that all bodies of one class share one compiled form. A model is a value: equal models are
    interchangeable, and it can be hashed, as a frozen dataclass of numbers and tuples can.
    """

    @property
    def dims(self) -> tuple[int, ...]:
        """Dimensions of the bodies that it is for, ``(2,)``, ``(3,)`` or ``(2, 3)``."""

    @property
    def parameters(self) -> tuple[float, ...]:
        """Values of the model's constants, in the order in which the forms receive them."""

    def stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the stress tensor (dim x dim, UFL) of the displacement ``u``."""

    def stiffness(self, u: Expr, v: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the integrand of the symmetric bilinear form, virtual work per volume (UFL scalar)."""

    def kernel(self, points: np.ndarray) -> np.ndarray:
        """Return the zero-energy modes at ``points``, shape (n, dim) -> (n, dim, n_modes)."""


@runtime_checkable
class Thermoelastic(Protocol):
    """What a material must provide in addition for `ThermalStrain` to act on it."""

    @property
    def expands(self) -> bool:
        """Whether this material was given a thermal expansion."""

    def thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the stress that free expansion relieves per degree of temperature rise (dim x dim, UFL).

        σ = stress(u) − ΔT · thermal_stress; for an isotropic body (3λ + 2G) α I.
        """


@runtime_checkable
class Transverse(Protocol):
    """What a plane model provides in addition if it has stress normal to its plane (plane strain)."""

    def transverse_stress(self, u: Expr, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the stress normal to the plane (UFL scalar), without thermal strain."""

    def transverse_thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return by how much it falls per degree of temperature rise (UFL scalar)."""


def can_expand(material: Material) -> bool:
    """Return whether a temperature change strains the material."""
    return isinstance(material, Thermoelastic) and material.expands


#: Index pairs in Voigt order: xx, yy, zz, yz, xz, xy; in the plane xx, yy, xy.
PAIRS = {3: ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)), 2: ((0, 0), (1, 1), (0, 1))}


def to_vector(tensor: np.ndarray) -> np.ndarray:
    """Return the entries of symmetric tensors, (..., 3, 3), in Voigt order, without factors."""
    rows, columns = np.transpose(PAIRS[3])
    return np.asarray(tensor[..., rows, columns])


def to_tensor(vector: np.ndarray) -> np.ndarray:
    """Return the symmetric tensors with the given entries, (..., 6) to (..., 3, 3); undoes `to_vector`."""
    return np.asarray(vector[..., [[0, 5, 4], [5, 1, 3], [4, 3, 2]]])


def strain_vector(strain: Expr, dim: int) -> list[Expr]:
    """Return the entries of a strain tensor (UFL) with engineering shears, γ = 2 ε."""
    return [(1 if i == j else 2) * strain[i, j] for i, j in PAIRS[dim]]


def as_tensor(vector: list[Expr], dim: int) -> Expr:
    """Return the stress tensor (UFL) with the given Voigt entries."""
    place = {pair: k for k, pair in enumerate(PAIRS[dim])}
    return ufl.as_tensor([[vector[place[min(i, j), max(i, j)]] for j in range(dim)] for i in range(dim)])


def upper_triangle(matrix: np.ndarray) -> tuple[float, ...]:
    """Return the entries on and above the diagonal, row by row."""
    return tuple(float(value) for value in matrix[np.triu_indices(len(matrix))])


def symmetric_product(entries: tuple[ufl.Constant, ...], vector: list[Expr]) -> list[Expr]:
    """Return the product of a symmetric matrix, given by its upper triangle, with a vector (UFL)."""
    n = len(vector)
    place = {(int(i), int(j)): k for k, (i, j) in enumerate(zip(*np.triu_indices(n), strict=True))}
    return [sum(entries[place[min(i, j), max(i, j)]] * vector[j] for j in range(n)) for i in range(n)]


def rotated_stiffness(C: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Rotate a stiffness matrix (Voigt) from material axes, given as rows, to those of the scene."""
    T = strain_rotation(axes)
    return np.asarray(T.T @ C @ T)


def strain_rotation(axes: np.ndarray) -> np.ndarray:
    """Return the matrix that rotates a strain vector from the scene's axes to material axes."""
    dim = len(axes)
    T = np.empty((len(PAIRS[dim]),) * 2)
    for column, (i, j) in enumerate(PAIRS[dim]):
        unit = np.zeros((dim, dim))
        unit[i, j] += 0.5
        unit[j, i] += 0.5  # engineering shear 1
        turned = axes @ unit @ axes.T
        T[:, column] = [(1 if a == b else 2) * turned[a, b] for a, b in PAIRS[dim]]
    return T


def thermal_stresses(
    C: np.ndarray, axes: np.ndarray, expansion: tuple[float, ...] | None
) -> tuple[float, ...]:
    """Return C : α in Voigt order, nothing without an expansion.

    `axes`: material axes as rows; `expansion`: along them, or all components of a tensor in Voigt order.
    """
    if expansion is None:
        return ()
    along = np.zeros(len(C))
    along[: len(expansion)] = expansion
    along[len(axes) :] *= 2.0  # engineering shear
    return tuple(float(value) for value in C @ np.linalg.solve(strain_rotation(axes), along))


def checked_stiffness(compliance: np.ndarray, constants: str) -> np.ndarray:
    """Invert a compliance matrix, shape (n, n)."""
    scale = np.sqrt(np.abs(np.diag(compliance)))
    smallest = np.linalg.eigvalsh(compliance / np.outer(scale, scale)).min()
    if not smallest > 1e-12:
        raise InvalidInputError(
            f"{constants} give no positive energy: reduce the Poisson ratios, ν_ij² < E_i / E_j must hold"
        )
    return np.asarray(np.linalg.inv(compliance), dtype=np.float64)

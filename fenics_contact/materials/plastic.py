"""Materials with internal variables: their base, and von Mises plasticity for small and large strains."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, TypeGuard

import numpy as np
import ufl
from ufl.core.expr import Expr

from fenics_contact._base.checks import checked
from fenics_contact._base.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.errors.kinds import user_code
from fenics_contact.materials.elastic import (
    Expanding,
    as_tensor,
    check_isotropic,
    lame,
    strain,
    strain_vector,
    symmetric_product,
    to_tensor,
    to_vector,
    upper_triangle,
)
from fenics_contact.materials.hardening import (
    NO_BACK_STRESS,
    Curve,
    Hardening,
    Points,
    check_plastic,
    checked_curve,
    radial_return,
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


class HistoryMaterial(Expanding):
    """A material whose stress depends on what it went through; write its history_size and respond.

    The internal variables are zero at first, where the body is free of stress. Bodies in the plane are in
    plane strain. The tangent at zero displacement and history, for a step of no duration, is the model's
    linear part (`parameters`, `stress`, `stiffness`): small-strain elasticity.

    `finite` states whether `respond` uses the whole displacement gradient, rotations included, or its
    symmetric part alone (small strain). With `mean_dilatation`, in small strain, it gets the mean change of
    volume of each cell at all of its points, against locking where flow keeps the volume.

    A model with a `thermal_expansion` α that is not None expands: `respond` gets the gradient without
    thermal strain, (F / θ) − I of large deformations with θ = 1 + α ΔT, else ∇u − α ΔT I.

    `symmetric` states whether tangents are, A_ijkl = A_klij. Of others Newton's method takes the symmetric
    part, and converges linearly, the faster the smaller the rest.

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
        >>> from fenics_contact.materials.elastic import to_tensor, to_vector
        >>> float(Maxwell(2.0, 1.0).moduli[0, 0])
        2.0
    """

    nonlinear: ClassVar[bool] = True
    finite: ClassVar[bool] = False
    symmetric: ClassVar[bool] = True
    mean_dilatation: bool = False
    thermal_expansion: float | None = None

    def __init_subclass__(cls, **given: Any) -> None:
        """Reject a model that replaces `answer`, the checks of what it returns."""
        super().__init_subclass__(**given)
        if "answer" in vars(cls):
            raise InvalidInputError(
                f"{cls.__name__} must define respond, not answer, which checks respond: rename it"
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

    def respond_at(
        self, gradient: np.ndarray, history: np.ndarray, duration: float, change: np.ndarray
    ) -> MaterialResponse:
        """Return what `respond` does, at changes of temperature.

        The default leaves them out. A model whose constants follow the temperature overrides it, and has
        ``expands`` true, so that `ThermalStrain` may act on it.

        Args:
            gradient: As for `respond`.
            history: As for `respond`.
            duration: As for `respond`.
            change: Sum of the temperature changes of the points at the end of the step, shape (n,).
        """
        return self.respond(gradient, history, duration)

    def equivalent_plastic_strain(self, history: np.ndarray) -> np.ndarray:
        """Return the accumulated equivalent plastic strain, shape (n,): zeros unless a model has one."""
        return np.zeros(len(history))

    def plastic_work(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Return the work per undeformed volume that is lost between histories, (n, k), shape (n,)."""
        raise InvalidInputError(
            f"heat of plastic work needs what {type(self).__name__} loses in a step, got no plastic_work: "
            "define it, or leave out PlasticHeat"
        )

    def admissible(self, history: np.ndarray) -> np.ndarray:
        """Return internal variables that points may have, near means of those of several points, (n, k).

        Histories that are carried to larger cells are means. Override it where the admissible ones are no
        convex set.
        """
        return history

    def answer(
        self, gradient: np.ndarray, history: np.ndarray, duration: float, change: np.ndarray | None = None
    ) -> MaterialResponse:
        """Return what `respond_at` does, without a change `respond`, as float64 arrays of the right shapes.

        Raises:
            InvalidInputError: If it returns other shapes, or numbers that are not finite where cells are not
                turned inside out.
            UserCodeError: If it raises.
        """
        name, n = type(self).__name__, len(gradient)
        with user_code(f"respond of material {name}"):
            if change is None:
                given = self.respond(gradient, history, duration)
            else:
                given = self.respond_at(gradient, history, duration, change)
        shapes = {"stress": (n, 3, 3), "tangent": (n, 3, 3, 3, 3), "history": (n, self.history_size)}
        arrays = {part: np.asarray(getattr(given, part, None), dtype=np.float64) for part in shapes}
        for part, shape in shapes.items():
            if arrays[part].shape != shape:
                raise InvalidInputError(
                    f"respond of {name} must return {part} of shape {shape}, got {arrays[part].shape}"
                )
        if np.isnan(duration) and not np.isfinite(arrays["stress"]).any():
            raise InvalidInputError(f"{name} needs the duration of the step, got none: give one")
        upright = np.linalg.det(np.eye(3) + gradient) > 0 if self.finite else np.ones(n, dtype=bool)
        for part, values in arrays.items():
            bad = ~np.isfinite(values.reshape(n, -1)).all(axis=1) & upright
            if bad.any():
                raise InvalidInputError(
                    f"respond of {name} must return finite numbers, {part} is not at {bad.sum()} of {n}, "
                    f"first at H = {np.array2string(gradient[bad][0], precision=3, separator=', ')}: check it"
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
                f"{name} must have no stress at rest, got {np.abs(first.stress).max():.3g}: use zero history"
            )
        if unsymmetric > 1e-10 * size:
            raise InvalidInputError(
                f"the tangent of {name} at rest must satisfy C_ijkl = C_klij = C_jikl, but misses it by "
                f"{unsymmetric / size:.1e}: check its order, [point, i, j, k, l] is dP_ij / dH_kl"
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

    def thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the stress of the linear part that free expansion relieves per degree, 3 x 3."""
        return as_tensor(self._thermal_stresses(parameters), 3)

    def transverse_thermal_stress(self, parameters: tuple[ufl.Constant, ...]) -> Expr:
        """Return the same normal to the plane."""
        return self._thermal_stresses(parameters)[2]

    def _thermal_stresses(self, parameters: tuple[ufl.Constant, ...]) -> list[Expr]:
        free = ufl.as_ufl(self.thermal_expansion or 0.0)
        zero = ufl.as_ufl(0.0)
        return symmetric_product(parameters, [free, free, free, zero, zero, zero])

    def _stress_vector(self, u: Expr, parameters: tuple[ufl.Constant, ...], dim: int) -> list[Expr]:
        if len(u) == 3:
            return symmetric_product(parameters, strain_vector(strain(u), 3))
        x, y, xy = strain_vector(strain(u), 2)
        zero = ufl.as_ufl(0.0)
        stress = symmetric_product(parameters, [x, y, zero, zero, zero, xy])
        return stress if dim == 3 else [stress[0], stress[1], stress[5]]


class VonMisesMetal(HistoryMaterial):
    """Isotropic elasticity with a yield stress that grows with the equivalent plastic strain."""

    young_modulus: float
    poisson_ratio: float
    yield_stress: float
    isotropic_hardening: float
    saturation_stress: float | None
    saturation_rate: float
    hardening_curve: Points
    kinematic_hardening: float = 0.0
    kinematic_curve: Points = ()

    def __post_init__(self) -> None:
        """Reject constants without a unique answer."""
        check_isotropic(self.young_modulus, self.poisson_ratio, self.thermal_expansion)
        for name, first in (("hardening_curve", self.yield_stress), ("kinematic_curve", 0.0)):
            if getattr(self, name):
                object.__setattr__(self, name, checked_curve(name, getattr(self, name), first))
        self._require_one("hardening_curve", ("isotropic_hardening", "saturation_rate"))
        self._require_one("kinematic_curve", ("kinematic_hardening",))
        check_plastic(self.young_modulus, self.hardening, self.back_stress)
        if (self.saturation_stress is None) != (self.saturation_rate == 0.0):
            raise InvalidInputError(
                "saturation_stress and saturation_rate must be given together, got "
                f"{self.saturation_stress!r} and {self.saturation_rate!r}: give both or neither"
            )

    def _require_one(self, curve: str, others: tuple[str, ...]) -> None:
        given = [name for name in others if getattr(self, name)]
        if getattr(self, curve) and given:
            raise InvalidInputError(
                f"{curve} must be all of that hardening, got {given[0]} as well: give one of them"
            )

    @property
    def hardening(self) -> Hardening:
        """Yield stress by equivalent plastic strain."""
        gain = 0.0 if self.saturation_stress is None else self.saturation_stress - self.yield_stress
        curve = Curve(((0.0, self.yield_stress), *self.hardening_curve), self.isotropic_hardening)
        return Hardening(curve, gain, self.saturation_rate)

    @property
    def back_stress(self) -> Curve:
        """Back stress in tension by equivalent plastic strain."""
        if not (self.kinematic_curve or self.kinematic_hardening):
            return NO_BACK_STRESS
        return Curve(((0.0, 0.0), *self.kinematic_curve), self.kinematic_hardening)

    @property
    def history_size(self) -> int:
        """A symmetric tensor of plastic deformation, and the equivalent plastic strain."""
        return 7

    def equivalent_plastic_strain(self, history: np.ndarray) -> np.ndarray:
        """Return the accumulated equivalent plastic strain, shape (n,)."""
        return history[:, 6]

    def plastic_work(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Return ∫ σ_y dα by the trapezoidal rule, (n,); what back stresses take is stored, not lost."""
        low, high = (self.hardening.at(each[:, 6])[0] for each in (before, after))
        return np.asarray(0.5 * (low + high) * (after[:, 6] - before[:, 6]))


@dataclass(frozen=True)
@checked("hardening_curve", "kinematic_curve")
class J2Plasticity(VonMisesMetal):
    """Elastic-plastic metals in small strain: von Mises' yield function, associated flow, no creep.

    Yields where √(3/2) ‖dev σ − β‖ = σ_y(α), with σ_y = σ_0 + H α + (σ_∞ − σ_0)(1 − exp(−δ α)) or a curve,
    and the back stress β̇ = ⅔ C ε̇_p, C constant or the slope of a curve at α; elastic strain is isotropic.
    Plane bodies are in plane strain. The stress is that at the end of each step by the radial return with
    its consistent tangent, exact to rounding for steps along one direction of strain. Internal variables:
    plastic strain (xx, yy, zz, yz, xz, xy), α, with a kinematic curve β (xx, ...).

    Attributes:
        young_modulus: Young's modulus E > 0, [force / length²].
        poisson_ratio: Poisson's ratio ν in (−1, 0.5), dimensionless.
        yield_stress: Initial yield stress in tension σ_0 > 0, [force / length²].
        isotropic_hardening: Slope H of the yield stress by plastic strain, [force / length²]; negative for
            softening, whose bands are as wide as cells.
        kinematic_hardening: Slope C ≥ 0 of the back stress by plastic strain in tension, [force / length²].
        saturation_stress: Yield stress σ_∞ ≥ σ_0 that is approached exponentially, [force / length²]. None
            for none.
        saturation_rate: How fast it is approached, δ ≥ 0, per plastic strain.
        mean_dilatation: Whether changes of volume are the means of cells: plastic flow keeps the volume, and
            linear hexahedra and quadrilaterals lock without it.
        hardening_curve: Yield stress by plastic strain in place of H and δ: pairs (α, σ_y) beyond
            (0, σ_0), straight between them, constant beyond the last.
        kinematic_curve: Back stress by plastic strain in tension in place of C: pairs (α, β) beyond (0, 0),
            straight between them, constant beyond the last. In cycles α is all plastic strain there was.
        thermal_expansion: Thermal expansion α, strain per degree. None for a body without.

    Example:
        Half the strain beyond yield is plastic where H = E:

        >>> import numpy as np
        >>> steel = J2Plasticity(2e5, 0.3, 235.0, isotropic_hardening=2e5)
        >>> steel.history_size, steel.nonlinear, steel.finite
        (7, True, False)

        A measured curve:

        >>> steel = J2Plasticity(2e5, 0.3, 235.0, hardening_curve=((0.02, 290.0), (0.1, 340.0)))
        >>> stress, slope = steel.hardening.at(np.array([0.01, 0.2]))
        >>> stress.tolist(), slope.tolist()
        ([262.5, 340.0], [2750.0, 0.0])
    """

    young_modulus: float
    poisson_ratio: float
    yield_stress: float
    isotropic_hardening: float = 0.0
    kinematic_hardening: float = 0.0
    saturation_stress: float | None = None
    saturation_rate: float = 0.0
    mean_dilatation: bool = False
    hardening_curve: Points = ()
    kinematic_curve: Points = ()
    thermal_expansion: float | None = None

    @property
    def history_size(self) -> int:
        """Plastic strain, the equivalent plastic strain, and the back stress where it has a curve."""
        return 13 if self.kinematic_curve else 7

    def respond(self, gradient: np.ndarray, history: np.ndarray, duration: float) -> MaterialResponse:
        """Return σ, the consistent tangent and the new plastic strain; nothing depends on the duration."""
        plastic = to_tensor(history[:, :6])
        strain = 0.5 * (gradient + gradient.swapaxes(1, 2))
        back = 2 / 3 * self.kinematic_hardening * plastic
        if self.kinematic_curve:
            back = to_tensor(history[:, 7:])
        end = radial_return(
            strain - plastic,
            back,
            history[:, 6],
            elastic_moduli(self.young_modulus, self.poisson_ratio),
            self.hardening,
            self.back_stress,
        )
        after = [to_vector(plastic + end.flow), end.alpha]
        if self.kinematic_curve:
            after.append(to_vector(back + end.back))
        return MaterialResponse(end.stress, end.moduli, np.column_stack(after))


def elastic_moduli(young_modulus: float, poisson_ratio: float) -> tuple[float, float]:
    """Return the bulk and the shear modulus."""
    first, shear = lame(young_modulus, poisson_ratio)
    return first + 2 / 3 * shear, shear


@dataclass(frozen=True)
@checked("hardening_curve")
class FinitePlasticity(VonMisesMetal):
    """Elastic-plastic metals in large deformations: multiplicative von Mises plasticity, F = F_e F_p.

    Hencky's elastic law τ = κ tr ε I + 2 G dev ε between the Kirchhoff stress τ and the logarithmic elastic
    strain ε = ½ ln(F_e F_eᵀ); yields where √(3/2) ‖dev τ‖ = σ_y(α), σ_y as in `J2Plasticity`; associated
    flow. The exponential map makes the return mapping that of small strain, plastic flow keeps the volume to
    rounding, and a rotation of the deformed body rotates its stress and does nothing else. The tangent is
    exact. Plane bodies are in plane strain. Where det F ≤ 0 there is no stress (NaN). Hardening is isotropic.
    Internal variables: (F_pᵀ F_p)⁻¹ − I (xx, yy, zz, yz, xz, xy), α.

    Attributes:
        young_modulus: Young's modulus E > 0, [force / length²].
        poisson_ratio: Poisson's ratio ν in (−1, 0.5), dimensionless.
        yield_stress: Initial yield stress σ_0 > 0 in terms of τ, [force / length²].
        isotropic_hardening: Slope H of the yield stress by logarithmic plastic strain, [force / length²].
        saturation_stress: Yield stress σ_∞ ≥ σ_0 that is approached exponentially, [force / length²]. None
            for none.
        saturation_rate: How fast it is approached, δ ≥ 0, per plastic strain.
        hardening_curve: Yield stress by plastic strain in place of H and δ: pairs (α, σ_y) beyond
            (0, σ_0), straight between them, constant beyond the last.
        thermal_expansion: Thermal expansion α, stretch per degree. None for a body without.

    References:
        J. C. Simo: Algorithms for static and dynamic multiplicative plasticity that preserve the classical
        return mapping schemes of the infinitesimal theory. Comput. Methods Appl. Mech. Engrg. 99, 1992.
        E. A. de Souza Neto, D. Perić, D. R. J. Owen: Computational Methods for Plasticity. Wiley 2008,
        chapter 14.
    """

    finite: ClassVar[bool] = True

    young_modulus: float
    poisson_ratio: float
    yield_stress: float
    isotropic_hardening: float = 0.0
    saturation_stress: float | None = None
    saturation_rate: float = 0.0
    hardening_curve: Points = ()
    thermal_expansion: float | None = None

    def admissible(self, history: np.ndarray) -> np.ndarray:
        """Return plastic deformations that keep the volume, and α; a mean of such is a little too large."""
        plastic = np.eye(3) + to_tensor(history[:, :6])
        size = np.cbrt(np.linalg.det(plastic))[:, None, None]
        return np.column_stack([to_vector(plastic / size - np.eye(3)), history[:, 6]])

    def respond(self, gradient: np.ndarray, history: np.ndarray, duration: float) -> MaterialResponse:
        """Return P, its exact tangent and the new plastic deformation; nothing depends on the duration."""
        F = np.eye(3) + gradient
        upright = np.linalg.det(F) > 0
        F = np.where(upright[:, None, None], F, np.eye(3))
        before = np.eye(3) + to_tensor(history[:, :6])
        half = before @ F.swapaxes(1, 2)
        values, axes = np.linalg.eigh(F @ half)
        strain = _spectral(0.5 * np.log(values), axes)
        moduli = elastic_moduli(self.young_modulus, self.poisson_ratio)
        end = radial_return(strain, np.zeros_like(F), history[:, 6], moduli, self.hardening)
        inverse = np.linalg.inv(F)
        stress = end.stress @ inverse.swapaxes(1, 2)
        by_strain = np.einsum("nabkm,nlm->nabkl", _logarithm_derivative(values, axes), half)
        by_gradient = (end.moduli.reshape(-1, 9, 9) @ by_strain.reshape(-1, 9, 9)).reshape(-1, 3, 3, 3, 3)
        tangent = np.einsum("nimkl,njm->nijkl", by_gradient, inverse)
        tangent -= np.einsum("nil,njk->nijkl", stress, inverse)
        left = inverse @ _exponential(2 * (strain - end.flow), axes) @ inverse.swapaxes(1, 2)
        flows = (end.alpha > history[:, 6])[:, None, None]
        after = np.column_stack([to_vector(np.where(flows, left, before) - np.eye(3)), end.alpha])
        for part in (stress, tangent):
            part[~upright] = np.nan
        return MaterialResponse(stress, tangent, np.where(upright[:, None], after, np.nan))


def _spectral(values: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Return symmetric tensors by their eigenvalues and eigenvectors (columns)."""
    return np.asarray((axes * values[:, None, :]) @ axes.swapaxes(1, 2))


def _exponential(tensor: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Return the exponential of symmetric tensors of which the eigenvectors (columns) are known."""
    return _spectral(np.exp(np.einsum("nia,nij,nja->na", axes, tensor, axes)), axes)


def _logarithm_derivative(values: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Return ∂(ln b)/∂b, shape (n, 3, 3, 3, 3), of symmetric tensors by eigenvalues and eigenvectors.

    In the eigenvectors' frame the entries are divided differences (ln b_i − ln b_j) / (b_i − b_j), exact for
    equal eigenvalues, too.
    """
    ratio = values[:, :, None] / values[:, None, :] - 1
    safe = np.where(ratio == 0, 1.0, ratio)
    quotient = np.where(ratio == 0, 1.0, np.log1p(safe) / safe) / values[:, None, :]
    outer = np.einsum("nai,nbj->nabij", axes, axes).reshape(-1, 9, 9)
    full = (outer * quotient.reshape(-1, 1, 9)) @ outer.swapaxes(1, 2)
    full = full.reshape(-1, 3, 3, 3, 3)
    return np.asarray(0.5 * (full + full.swapaxes(3, 4)))


def has_history(material: object) -> TypeGuard[HistoryMaterial]:
    """Return whether the stress of a material depends on what it went through."""
    return isinstance(material, HistoryMaterial)

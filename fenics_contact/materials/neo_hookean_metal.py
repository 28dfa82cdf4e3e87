"""Multiplicative plasticity with neo-Hookean elasticity and kinematic hardening, in true stresses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from fenics_contact._base.checks import checked
from fenics_contact.materials.elastic import to_tensor, to_vector
from fenics_contact.materials.hardening import ROOT, Points, multipliers
from fenics_contact.materials.plastic import MaterialResponse, VonMisesMetal, elastic_moduli


@dataclass(frozen=True)
@checked("hardening_curve", "kinematic_curve")
class NeoHookeanPlasticity(VonMisesMetal):
    """Elastic-plastic metals in large deformations by Simo's theory of 1988, with kinematic hardening.

    Kirchhoff stress τ = κ/2 (J² − 1) I + G dev b̄, b̄ = J^(−2/3) F G_p Fᵀ; yields where
    √(3/2) ‖dev σ − β‖ = σ_y(α) with Cauchy's stress σ = τ / J: curves are those of true stress over
    logarithmic plastic strain. With Lie's derivative L and q = J β, L b̄ = −⅔ γ̇ tr(b̄) n and
    L q̄ = ⅔ γ̇ C J (Ḡ / G) n, Ḡ = (G tr b̄ − tr q̄) / 3: the deformation carries the back stress along, which in
    tension is C/3 (λ² − 1/λ) at a stretch λ. Theory and algorithm are those of CalculiX, and so are the
    errors of long steps: one of 3 % is too short by 1 % of its strain; steps of `FinitePlasticity` along
    one direction are exact. A yield surface in true stresses makes the tangent unsymmetric by σ_y / E;
    Newton's method takes its symmetric part. Plane bodies are in plane strain. Where det F ≤ 0 there is no
    stress (NaN). Internal variables: G_p = (F_pᵀ F_p)⁻¹ − I (xx, yy, zz, yz, xz, xy), α, with kinematic
    hardening the back stress F⁻¹ q F⁻ᵀ (xx, ...).

    Attributes:
        young_modulus: Young's modulus E > 0, [force / length²].
        poisson_ratio: Poisson's ratio ν in (−1, 0.5), dimensionless.
        yield_stress: Initial yield stress σ_0 > 0 in terms of true stress, [force / length²].
        isotropic_hardening: Slope H of the yield stress by logarithmic plastic strain, [force / length²].
        kinematic_hardening: Slope C ≥ 0 of the back stress by plastic strain in tension, [force / length²].
        saturation_stress: Yield stress σ_∞ ≥ σ_0 that is approached exponentially, [force / length²]. None
            for none.
        saturation_rate: How fast it is approached, δ ≥ 0, per plastic strain.
        hardening_curve: Yield stress by plastic strain in place of H and δ: pairs (α, σ_y) beyond
            (0, σ_0), straight between them, constant beyond the last.
        kinematic_curve: Back stress by plastic strain in tension in place of C: pairs (α, β) beyond (0, 0),
            straight between them, constant beyond the last. In cycles α is all plastic strain there was.
        thermal_expansion: Thermal expansion α, stretch per degree. None for a body without.

    References:
        J. C. Simo: A framework for finite strain elastoplasticity based on maximum plastic dissipation and
        the multiplicative decomposition. Comput. Methods Appl. Mech. Engrg. 66 and 68, 1988.
        J. C. Simo, T. J. R. Hughes: Computational Inelasticity. Springer 1998, chapter 9.

    Example:
        >>> metal = NeoHookeanPlasticity(2.1e5, 0.3, 800.0, kinematic_curve=((0.1, 800.0),))
        >>> metal.history_size, metal.finite
        (13, True)
    """

    finite: ClassVar[bool] = True
    symmetric: ClassVar[bool] = False

    young_modulus: float
    poisson_ratio: float
    yield_stress: float
    isotropic_hardening: float = 0.0
    kinematic_hardening: float = 0.0
    saturation_stress: float | None = None
    saturation_rate: float = 0.0
    hardening_curve: Points = ()
    kinematic_curve: Points = ()
    thermal_expansion: float | None = None

    @property
    def history_size(self) -> int:
        """Plastic deformation, the equivalent plastic strain, and the back stress if there is any."""
        return 13 if self._pulls else 7

    @property
    def _pulls(self) -> bool:
        """Whether hardening has a kinematic part."""
        return bool(self.kinematic_curve or self.kinematic_hardening)

    def admissible(self, history: np.ndarray) -> np.ndarray:
        """Return plastic deformations that keep the volume, and the rest as it is."""
        plastic = np.eye(3) + to_tensor(history[:, :6])
        size = np.cbrt(np.linalg.det(plastic))[:, None, None]
        return np.column_stack([to_vector(plastic / size - np.eye(3)), history[:, 6:]])

    def respond(self, gradient: np.ndarray, history: np.ndarray, duration: float) -> MaterialResponse:
        """Return P, its exact tangent and the new internal variables; nothing depends on the duration."""
        F = np.eye(3) + gradient
        upright = np.linalg.det(F) > 0
        F = np.where(upright[:, None, None], F, np.eye(3))
        inverse, J = np.linalg.inv(F), np.linalg.det(F)
        plastic = np.eye(3) + to_tensor(history[:, :6])
        back = to_tensor(history[:, 7:]) if self._pulls else np.zeros_like(F)
        (bulk, shear), alpha = elastic_moduli(self.young_modulus, self.poisson_ratio), history[:, 6]
        elastic, pulled = (_pushed(F, inverse, J, each) for each in (plastic, back))
        relative = shear * elastic.deviator - pulled.deviator
        length = np.linalg.norm(relative, axis=(1, 2))
        normal = relative / np.where(length > 0, length, 1.0)[:, None, None]
        modulus = shear * elastic.mean - pulled.mean
        flowing = multipliers(
            length, alpha, 2 * modulus, self.hardening, self.back_stress, J, J * modulus / shear
        )
        gamma = flowing.multiplier
        fall = _times(2 * modulus * gamma, normal)
        kirchhoff = _times(bulk / 2 * (J**2 - 1), np.eye(3)) + shear * elastic.deviator - fall
        stress = kirchhoff @ inverse.swapaxes(1, 2)

        # Derivatives by F, whose indices come last.
        spin = inverse.swapaxes(1, 2)  # ∂ ln J / ∂F
        d_relative = shear * elastic.d_deviator - pulled.d_deviator
        d_length = np.einsum("nij,nijkl->nkl", normal, d_relative)
        d_normal = d_relative - np.einsum("nij,nkl->nijkl", normal, d_length)
        d_normal /= np.where(length > 0, length, 1.0)[:, None, None, None, None]
        d_modulus = shear * elastic.d_mean - pulled.d_mean
        # The consistency condition is solved for the growth of Δγ.
        rise = ROOT / shear * J * flowing.back
        growth = (
            d_length
            - _times(2 * gamma + rise, d_modulus)
            - _times(ROOT * flowing.strength + modulus * rise, spin)
        )
        d_gamma = _times((gamma > 0) / (2 * modulus + 2 / 3 * flowing.slope), growth)
        d_fall = 2 * (_times(gamma, d_modulus) + _times(modulus, d_gamma))
        d_kirchhoff = shear * elastic.d_deviator - np.einsum("nij,nkl->nijkl", normal, d_fall)
        d_kirchhoff -= (2 * modulus * gamma)[:, None, None, None, None] * d_normal
        d_kirchhoff += np.einsum("ij,nkl->nijkl", np.eye(3), _times(bulk * J**2, spin))
        tangent = np.einsum("nimkl,njm->nijkl", d_kirchhoff, inverse)
        tangent -= np.einsum("nil,njk->nijkl", stress, inverse)

        along = np.cbrt(J**2)[:, None, None] * (inverse @ normal @ inverse.swapaxes(1, 2))
        after = [to_vector(plastic - np.eye(3) - _times(2 * modulus * gamma / shear, along))]
        after.append((alpha + ROOT * gamma)[:, None])
        if self._pulls:
            after.append(to_vector(back + _times(ROOT * J * modulus / shear * flowing.back, along)))
        for part in (stress, tangent):
            part[~upright] = np.nan
        return MaterialResponse(stress, tangent, np.where(upright[:, None], np.hstack(after), np.nan))


class _Pushed(NamedTuple):
    """J^(−2/3) F A Fᵀ of a symmetric tensor A: a third of its trace, its deviator, and both by F."""

    mean: np.ndarray
    deviator: np.ndarray
    d_mean: np.ndarray
    d_deviator: np.ndarray


def _pushed(F: np.ndarray, inverse: np.ndarray, J: np.ndarray, tensor: np.ndarray) -> _Pushed:
    one, size = np.eye(3), J ** (-2 / 3)
    half = _times(size, F @ tensor)
    whole = half @ F.swapaxes(1, 2)
    by_F = np.einsum("ik,njl->nijkl", one, half) + np.einsum("nil,jk->nijkl", half, one)
    by_F -= 2 / 3 * np.einsum("nij,nlk->nijkl", whole, inverse)
    mean, d_mean = np.trace(whole, axis1=1, axis2=2) / 3, np.einsum("niikl->nkl", by_F) / 3
    deviator = whole - _times(mean, one)
    return _Pushed(mean, deviator, d_mean, by_F - np.einsum("ij,nkl->nijkl", one, d_mean))


def _times(factor: np.ndarray, tensor: np.ndarray) -> np.ndarray:
    """Return a number of each point times a tensor, (n,) and (n, 3, 3) or (3, 3)."""
    return np.asarray(factor[:, None, None] * tensor)

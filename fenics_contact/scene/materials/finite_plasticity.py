"""Von Mises plasticity for large deformations, by logarithmic strains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fenics_contact.checks import checked
from fenics_contact.scene.materials.history_material import MaterialResponse
from fenics_contact.scene.materials.j2_plasticity import elastic_moduli
from fenics_contact.scene.materials.return_mapping import radial_return
from fenics_contact.scene.materials.voigt import to_tensor, to_vector
from fenics_contact.scene.materials.von_mises_metal import VonMisesMetal


@dataclass(frozen=True)
@checked()
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

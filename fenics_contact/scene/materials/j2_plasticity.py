"""Von Mises plasticity in small strain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.checks import checked
from fenics_contact.scene.materials.constants import lame
from fenics_contact.scene.materials.history_material import MaterialResponse
from fenics_contact.scene.materials.return_mapping import radial_return
from fenics_contact.scene.materials.voigt import to_tensor, to_vector
from fenics_contact.scene.materials.von_mises_metal import VonMisesMetal


@dataclass(frozen=True)
@checked()
class J2Plasticity(VonMisesMetal):
    """Elastic-plastic metals in small strain: von Mises' yield function, associated flow, no creep.

    Yields where √(3/2) ‖dev σ − β‖ = σ_y(α), with σ_y = σ_0 + H α + (σ_∞ − σ_0)(1 − exp(−δ α)) and Prager's
    back stress β = ⅔ C ε_p; elastic strain is isotropic. Plane bodies are in plane strain. The stress is that
    at the end of each step by the radial return with its consistent tangent, exact to rounding for steps
    along one direction of strain. Internal variables: plastic strain (xx, yy, zz, yz, xz, xy), α.

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

    Example:
        Half the strain beyond yield is plastic where H = E:

        >>> import numpy as np
        >>> steel = J2Plasticity(2e5, 0.3, 235.0, isotropic_hardening=2e5)
        >>> steel.history_size, steel.nonlinear, steel.finite
        (7, True, False)
    """

    young_modulus: float
    poisson_ratio: float
    yield_stress: float
    isotropic_hardening: float = 0.0
    kinematic_hardening: float = 0.0
    saturation_stress: float | None = None
    saturation_rate: float = 0.0
    mean_dilatation: bool = False

    @property
    def _back_slope(self) -> float:
        return self.kinematic_hardening

    def respond(self, gradient: np.ndarray, history: np.ndarray, duration: float) -> MaterialResponse:
        """Return σ, the consistent tangent and the new plastic strain; nothing depends on the duration."""
        plastic = to_tensor(history[:, :6])
        strain = 0.5 * (gradient + gradient.swapaxes(1, 2))
        back = 2 / 3 * self.kinematic_hardening * plastic
        end = radial_return(
            strain - plastic,
            back,
            history[:, 6],
            elastic_moduli(self.young_modulus, self.poisson_ratio),
            self.hardening,
            self.kinematic_hardening,
        )
        return MaterialResponse(
            end.stress, end.moduli, np.column_stack([to_vector(plastic + end.flow), end.alpha])
        )


def elastic_moduli(young_modulus: float, poisson_ratio: float) -> tuple[float, float]:
    """Return the bulk and the shear modulus."""
    first, shear = lame(young_modulus, poisson_ratio)
    return first + 2 / 3 * shear, shear

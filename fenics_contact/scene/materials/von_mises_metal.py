"""What von Mises' metals have in common, in small and large deformations."""

from __future__ import annotations

from fenics_contact.errors import InvalidInputError
from fenics_contact.scene.materials.constants import check_isotropic
from fenics_contact.scene.materials.history_material import HistoryMaterial
from fenics_contact.scene.materials.return_mapping import Hardening, check_plastic


class VonMisesMetal(HistoryMaterial):
    """Isotropic elasticity with a yield stress that grows with the equivalent plastic strain."""

    young_modulus: float
    poisson_ratio: float
    yield_stress: float
    isotropic_hardening: float
    saturation_stress: float | None
    saturation_rate: float

    def __post_init__(self) -> None:
        """Reject constants without a unique answer."""
        check_isotropic(self.young_modulus, self.poisson_ratio, None)
        law = self.hardening
        saturation = law.saturation_stress, law.saturation_rate
        check_plastic(self.young_modulus, law.yield_stress, law.slope, self._back_slope, saturation)
        if (self.saturation_stress is None) != (self.saturation_rate == 0.0):
            raise InvalidInputError(
                "saturation_stress and saturation_rate must be given together, got "
                f"{self.saturation_stress!r} and {self.saturation_rate!r}: one alone has no effect"
            )

    @property
    def _back_slope(self) -> float:
        """Slope of the back stress by plastic strain."""
        return 0.0

    @property
    def hardening(self) -> Hardening:
        """Yield stress by equivalent plastic strain."""
        final = self.yield_stress if self.saturation_stress is None else self.saturation_stress
        return Hardening(self.yield_stress, self.isotropic_hardening, final, self.saturation_rate)

    @property
    def history_size(self) -> int:
        """A symmetric tensor of plastic deformation, and the equivalent plastic strain."""
        return 7

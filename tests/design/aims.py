"""What engineers ask of a contact: low and even pressure, little wear, low stress, stiffness."""

from __future__ import annotations

from fenics_contact.design import (
    ContactArea,
    FrictionWork,
    LargestPressure,
    LargestStress,
    Maximum,
    Movement,
    Objective,
    PressureNonuniformity,
    PressureNorm,
    StrainEnergy,
)


def aims(body: str, surface: str, dim: int = 3) -> dict[str, Objective]:
    """Objectives of the contact, and of a body with a surface that moves."""
    along, across = (1.0, 0.0, 1.0)[-dim:], (1.0, 2.0, 3.0)[:dim]
    return {
        "strain energy": StrainEnergy(),
        "largest pressure": LargestPressure(),
        "pressure norm": PressureNorm(),
        "unevenness": PressureNonuniformity(0),
        "area": ContactArea(),
        "friction work": FrictionWork(),
        "largest stress": LargestStress(body),
        "movement": Movement(body, surface, along),
        "movement of a node": Movement(body, 30, across),
        "largest of two": Maximum((0.01 * LargestStress(body), 2.0 * LargestPressure(0))),
    }

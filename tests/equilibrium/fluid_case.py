"""A seal on a floor that fluid may enter."""

from __future__ import annotations

from typing import Any

import numpy as np

from fenics_contact import Body, ContactPair, FluidPressure, Scene, Support, Surface, Traction
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from tests.equilibrium.law_cases import FLOOR

FLUID = 2.0


def seal(fluid: FluidPressure | None, extra: float = 0.0, poisson: float = 0.0, **more: Any) -> Scene:
    """A block whose lower side rises to its left and right, pressed in its middle."""
    mesh = block((0.0, 0.0, 0.0), (4.0, 1.0, 1.0), (16, 2, 4))
    points = mesh.points.copy()
    points[:, 2] += 0.004 * np.abs(points[:, 0] - 1.9) ** 2 * (1.0 - points[:, 2])
    guides = [Support("seal", "y0", (None, 0.0, None)), Support("seal", "x0", (0.0, None, None))]

    def pressing(x: np.ndarray) -> np.ndarray:
        down = -extra - 6.0 * np.exp(-((x[:, 0] - 2.1) ** 2))
        return np.column_stack([0.0 * down, 0.0 * down, down])

    pair = ContactPair(Surface("seal", "z0"), FLOOR, fluid=fluid, **more)
    body = Body(mesh.moved(points), IsotropicElasticity(1000.0, poisson))
    return Scene({"seal": body}, guides, [Traction("seal", "z1", pressing)], [pair])


def both_ends(x: np.ndarray) -> np.ndarray:
    return (x[:, 0] < 1e-9) | (x[:, 0] > 4.0 - 1e-9)

"""Forces and moments spread over a surface: the traction that has a given resultant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.checks import GivenVector, floats
from fenics_contact.errors import InvalidInputError
from fenics_contact.linalg import ROUNDING
from fenics_contact.scene import Load, Scene, TotalForce, Traction
from fenics_contact.surfaces import SurfaceMoments, surface_moments


@dataclass(frozen=True)
class LinearTraction:
    """A traction a + b × (x − c) that grows linearly with the distance from a point; a function of position.

    Attributes:
        even: a, shape (dim,), [force / length²].
        turning: b, shape (3,), in the plane (1,), [force / length³].
        centre: c, shape (dim,), [length].
    """

    even: GivenVector
    turning: GivenVector
    centre: GivenVector

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Return the traction at points, both of shape (n, dim)."""
        arm = points - self.centre
        around: np.ndarray
        if len(self.centre) == 2:
            around = self.turning[0] * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        else:
            around = np.cross(self.turning, arm)
        return np.asarray(self.even + around)


def as_tractions(scene: Scene) -> tuple[Load, ...]:
    """Return the scene's loads with every resultant spread over the present shape of its surface."""
    return tuple(
        spread_traction(scene, load) if isinstance(load, TotalForce) else load for load in scene.loads
    )


def spread_traction(scene: Scene, load: TotalForce) -> Traction:
    """Return the traction a + b × (x − c), c the centroid, that has the resultant of a load.

    With the area A and J b = ∫ (x − c) × (b × (x − c)): a = F / A and J b = M + (p − c) × F.
    """
    mesh = scene.bodies[load.body].mesh
    surface = surface_moments(mesh.points, mesh.surfaces[load.surface])
    even = tuple(component / surface.area for component in load.value)
    if load.moment is None and load.at is None:
        return Traction(load.body, load.surface, even)
    force = np.array(load.value)
    arm = np.zeros(mesh.dim) if load.at is None else load.at - surface.centroid
    lever = np.cross(arm, force) if mesh.dim == 3 else arm[:1] * force[1] - arm[1:] * force[0]
    moment = lever + (0.0 if load.moment is None else load.moment)
    turning = floats(_turning(load, surface, moment))
    return Traction(load.body, load.surface, LinearTraction(even, turning, floats(surface.centroid)))


def _turning(load: TotalForce, surface: SurfaceMoments, moment: np.ndarray) -> np.ndarray:
    """Return b = J⁻¹ M, shape (3,), in the plane (1,).

    Raises:
        InvalidInputError: If the surface is so narrow that no traction on it has a moment about its length.
    """
    second = surface.second_moment
    if len(second) == 2:
        return moment / np.trace(second)
    size, axes = np.linalg.eigh(np.trace(second) * np.eye(3) - second)
    along = axes.T @ moment
    if size[0] <= ROUNDING * size[-1]:
        raise InvalidInputError(
            f"a moment needs a surface that is no line, surface {load.surface!r} of body {load.body!r} is "
            f"{np.sqrt(size[0] / size[-1]):.1e} times as wide as long: choose a wider one"
        )
    return np.asarray(axes @ (along / size))

"""What all supports answer."""

from __future__ import annotations

from typing import Any, Self

import numpy as np

from fenics_contact._scene.part import Around, Part, centroid
from fenics_contact.mesh.body_mesh import BodyMesh


class SupportPart(Part):
    """What all supports answer.

    Attributes:
        body: Name of the body.
        surface: Name of its surface, or of a node set of its mesh.
    """

    body: str
    surface: str

    @property
    def rollers(self) -> tuple[Any, ...]:
        """The support, if it is a `Roller`."""
        return ()

    @property
    def rigid_surfaces(self) -> tuple[Any, ...]:
        """The support, if it is a `RigidSurface`."""
        return ()

    @property
    def keeps(self) -> bool:
        """Whether it holds something where it is when a load step begins, see `HoldCurrent`."""
        return False

    @property
    def varies(self) -> bool:
        """Whether it has values that are functions of position."""
        return False

    def keeping(self, points: np.ndarray, moved: np.ndarray) -> Self:
        """Return it with displacements of its nodes, (n, components), where it keeps them."""
        return self

    def nodes_in(self, mesh: BodyMesh) -> np.ndarray:
        """Return its nodes in the mesh of its body, ascending."""
        return mesh.nodes_of(self.surface)

    def values(self, points: np.ndarray) -> np.ndarray:
        """Return what it prescribes at points, NaN where it prescribes nothing."""
        return np.full(points.shape, np.nan)

    def holds(self, components: int) -> np.ndarray:
        """Return which components it holds along the axes, shape (components,)."""
        return np.ones(components, dtype=bool)

    def held(self, scene: Around) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """Return its nodes, ascending, and what it prescribes there along the axes, NaN where free.

        Shapes (n,) and (n, components); nothing of rollers, which hold along directions of their own.
        """
        mesh = scene.bodies[self.body].mesh
        nodes = mesh.nodes_to_hold(self.surface)
        return ((nodes, self.values(mesh.points[nodes])),)

    def largest_motion(self, scene: Around) -> float:
        """Return the largest displacement that it prescribes, [length]."""
        values = (np.nan_to_num(given) for _, given in self.held(scene))
        return max(float(np.linalg.norm(each, axis=1).max(initial=0.0)) for each in values)

    def motion_along(self, normal: np.ndarray, scene: Around) -> float:
        """Return the largest displacement along a direction that it prescribes by numbers, [length]."""
        return 0.0

    def symmetry(self, scene: Around) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """Return the normal of the plane of symmetry for which it stands, if any, and its nodes there."""
        return ()

    def reference(self, scene: Around) -> np.ndarray:
        """Return the point to which its reaction refers, shape (dim,): the centroid of its surface."""
        return centroid(scene, self.body, self.surface)

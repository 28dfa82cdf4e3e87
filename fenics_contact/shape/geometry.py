"""How a scene moves with a design: its surfaces, the mesh behind them, and the way back of derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fenics_contact.errors import InvalidDesignError, InvalidInputError
from fenics_contact.feti import Decomposition
from fenics_contact.scene import Body, Scene
from fenics_contact.shape.design import SurfaceDesign, checked_variables
from fenics_contact.shape.forms import ShapeForms
from fenics_contact.shape.motion import motion_of, moving_nodes
from fenics_contact.shape.volume import volume_of


class DesignGeometry:
    """The moving surfaces of a scene with their mesh motions, shared by all load cases of a design.

    Attributes:
        designs: The moving surfaces; α is the concatenation of their variables.
        motions: Mesh motion of each design.
        moving: Body name -> marks of the nodes that a design moves, shape (n_nodes,).
        size: Number of design variables.
        forms: Compiled derivatives of integrals where nodes move.
    """

    def __init__(self, scene: Scene, decomposition: Decomposition, designs: Sequence[SurfaceDesign]) -> None:
        """Prepare the mesh motion. Collective on the decomposition's communicator.

        Args:
            scene: The scene in its reference shape.
        """
        self.designs = tuple(design.on(scene) for design in designs)
        self.size = sum(design.size for design in self.designs)
        self._bodies, self._decomposition = dict(scene.bodies), decomposition
        self.motions = [motion_of(decomposition, scene, design) for design in self.designs]
        self.moving = moving_nodes(scene, self.designs, self.motions)
        self.forms = ShapeForms(decomposition.comm, np.concatenate(list(self.moving.values())))
        self._points: tuple[np.ndarray, dict[str, np.ndarray]] | None = None
        self._last: tuple[np.ndarray, dict[str, Body]] | None = None

    def points_of(self, alpha: np.ndarray) -> dict[str, np.ndarray]:
        """Return the coordinates of the designed bodies; of the last design they are known. Collective.

        Args:
            alpha: Design variables, shape (size,), [length].

        Returns:
            Body name -> coordinates, shape (n_nodes, dim), [length].
        """
        alpha = checked_variables(alpha, self.size, self._decomposition.comm)
        if self._points is None or not np.array_equal(self._points[0], alpha):
            self._points = alpha.copy(), self._moved(alpha)
        return {name: points.copy() for name, points in self._points[1].items()}

    def _moved(self, alpha: np.ndarray) -> dict[str, np.ndarray]:
        points: dict[str, np.ndarray] = {}
        parts = np.split(alpha, np.cumsum([design.size for design in self.designs])[:-1])
        for design, motion, part in zip(self.designs, self.motions, parts, strict=True):
            start = points.get(design.body, self._bodies[design.body].mesh.points)
            points[design.body] = start + motion.extend(design.displacement(part))
        return points

    def scene_of(self, scene: Scene, alpha: np.ndarray) -> Scene:
        """Return a scene of these bodies in the shape of a design. Collective.

        The scenes of one design have the same meshes, so that they share matrices and factors.
        """
        if self._last is None or not np.array_equal(self._last[0], alpha):
            points = self.points_of(alpha)
            try:
                moved = scene.reshaped(points)
            except InvalidInputError as error:
                raise InvalidDesignError(f"the design cannot be meshed: {error}") from error
            self._last = np.array(alpha, dtype=float), dict(moved.bodies)
            return moved
        return replace(scene, bodies=self._last[1])

    def volume(self, scene: Scene) -> tuple[float, np.ndarray]:
        """Return the volume of the designed bodies, in the plane the area, and its gradient. Collective."""
        names = sorted({design.body for design in self.designs})
        total, by_points = volume_of(scene, names, self._decomposition.tearing)
        return total, self.pull_back(by_points)

    def pull_back(self, by_points: np.ndarray) -> np.ndarray:
        """Vector-Jacobian product of the nodes of all bodies with respect to α, replicated. Collective."""
        parts = []
        for design, motion in zip(self.designs, self.motions, strict=True):
            own = np.arange(self._bodies[design.body].mesh.n_nodes)
            nodes = self._decomposition.tearing.global_nodes(design.body, own)
            parts.append(design.pull_back(motion.pull_back(by_points[nodes])))
        return np.concatenate(parts)

"""Common numbering of the nodes of all bodies of a scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.display import displayed
from fenics_contact.scene import Scene


@displayed
@dataclass(frozen=True)
class NodeNumbers:
    """Numbers of the nodes of all bodies, body after body.

    Attributes:
        body_names: Names of the bodies, in numbering order.
        node_offset: First node of each body and the total, shape (n_bodies + 1,).
    """

    body_names: tuple[str, ...]
    node_offset: np.ndarray

    @classmethod
    def of(cls, scene: Scene) -> NodeNumbers:
        """Number the nodes of a scene."""
        names = scene.body_names
        return NodeNumbers(names, np.cumsum([0] + [scene.bodies[name].mesh.n_nodes for name in names]))

    @property
    def n_nodes(self) -> int:
        """Number of nodes of all bodies."""
        return int(self.node_offset[-1])

    def first_of(self, body: str) -> int:
        """Return the number of a body's first node."""
        return int(self.node_offset[self.body_names.index(body)])

    def global_nodes(self, body: str, nodes: np.ndarray) -> np.ndarray:
        """Number nodes of one body among those of all bodies."""
        return nodes + self.first_of(body)

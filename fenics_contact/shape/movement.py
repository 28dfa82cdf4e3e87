"""The displacement of a surface or a node as an objective."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.checks import GivenVector, checked, unit_vector
from fenics_contact.contact import State
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti import nodal_mean_at, nodal_mean_transposed
from fenics_contact.scene import Surface, surface_of
from fenics_contact.shape.forms import ShapeForms
from fenics_contact.shape.objective import Partials
from fenics_contact.shape.sums import Weighable
from fenics_contact.shape.surface_derivative import areas_pulled_back
from fenics_contact.shape.volume_integral import require_body
from fenics_contact.surfaces import FacetedSurface


@dataclass(frozen=True)
@checked()
class Movement(Weighable):
    """J = d · ∫ u dA / A, the mean displacement of a surface along a direction, or that of a node, [length].

    On each facet the mean is that of its corners. A small movement of a loaded surface is a stiff part; as a
    constraint it keeps a part from giving way.

    Attributes:
        body: Name of the body.
        at: Name of a surface of the body, or number of one of its nodes.
        direction: d, of any length: it is divided by it.

    Example:
        >>> Movement("link 2", "grip", (1, 0, 0)).at
        'grip'
    """

    body: str
    at: str | int
    direction: GivenVector

    def value(self, state: State, forms: ShapeForms) -> float:
        """Return the movement. Collective.

        Raises:
            InvalidInputError: If the scene has no such body, surface or node.
        """
        return self.partials(state, forms).value

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        """Differentiate by displacements, and by the areas that weigh them. Collective; raises as `value`."""
        nodes, weights, surface = self._weighed(state)
        direction = unit_vector("Movement.direction", self.direction, state.scene.dim)
        decomposition = state.torn.decomposition
        along = nodal_mean_at(decomposition, state.torn_displacement, nodes) @ direction
        value = float(weights @ along)
        by_displacement = nodal_mean_transposed(decomposition, nodes, np.outer(weights, direction))
        partials = Partials.of(state, value, by_displacement=by_displacement)
        if surface is not None and decomposition.comm.rank == 0:
            partials.by_shape[nodes] = areas_pulled_back(surface, (along - value) / surface.areas.sum())
        return partials

    def _weighed(self, state: State) -> tuple[np.ndarray, np.ndarray, FacetedSurface | None]:
        """Return the nodes among those of all bodies, their weights, which sum to one, and the surface."""
        require_body(state, "Movement", self.body)
        mesh, tearing = state.scene.bodies[self.body].mesh, state.torn.decomposition.tearing
        if isinstance(self.at, str) and self.at in mesh.surfaces:
            surface = surface_of(state.scene, Surface(self.body, self.at), "faceted")
            nodes = tearing.global_nodes(self.body, surface.nodes)
            return nodes, surface.areas / surface.areas.sum(), surface
        if not isinstance(self.at, str) and 0 <= self.at < mesh.n_nodes:
            return tearing.global_nodes(self.body, np.array([self.at])), np.ones(1), None
        raise InvalidInputError(
            f"Movement.at must be a surface of body {self.body!r}, one of {sorted(mesh.surfaces)}, or the "
            f"number of a node, 0 to {mesh.n_nodes - 1}, got {self.at!r}"
        )

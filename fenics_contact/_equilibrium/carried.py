"""The state at the end of the load step before, on other meshes: slip, displacement and histories carried."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fenics_contact._base.display import displayed
from fenics_contact._equilibrium.outer_loops import outer_loops
from fenics_contact._equilibrium.starts import CoarseStart
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti.torn import TornSystem
from fenics_contact.mesh.transfer import MeshTransfer
from fenics_contact.results.state import State


@displayed
@dataclass(frozen=True, eq=False)
class TransferredState:
    """The state at the end of a load step as the start of the next, on meshes of the same family.

    - **Displacements** are interpolated to the new nodes, by the shape functions of the old cells in which
      they lie. **Slip** of the next step is measured from where the contact points of the new meshes are
      then, exactly as on the old ones.
    - **Histories of materials** at Gauss points are those of the nearest old point, or means of several where
      cells become larger, see `fenics_contact.mesh.MeshTransfer.at_gauss_points`. The return mapping of the
      next step brings stresses back to the yield surface.
    - **Forces** are not carried: the next step finds those that are in equilibrium with displacements and
      histories. So what small cells knew and large ones cannot hold is lost.

    Attributes:
        state: The state, on its own meshes.
        transfers: Body name -> how its mesh became that of the next step; bodies that are not named have
            kept theirs.

    Example:
        >>> finer = refined(scene.bodies["block"].mesh, [0, 1])  # doctest: +SKIP
        >>> fine_body = replace(scene.bodies["block"], mesh=finer.mesh)  # doctest: +SKIP
        >>> pulled = replace(scene, bodies={"block": fine_body}, loads=[pull])  # doctest: +SKIP
        >>> before = TransferredState(state, {"block": MeshTransfer(new=[finer])})  # doctest: +SKIP
        >>> after = ContactProblem(pulled, comm).solve(before=before)  # doctest: +SKIP
    """

    state: State
    transfers: Mapping[str, MeshTransfer]

    @cached_property
    def fields(self) -> CoarseStart:
        """Displacements and forces on the new meshes."""
        return CoarseStart(self.state, self.transfers)

    def check(self, scene: Scene) -> None:
        """Reject what cannot be carried to the meshes of a scene.

        Raises:
            InvalidInputError: If the transfers lead to other meshes, or a history is not carried: of friction
                by slip, of fluid in contacts, of preloads in scenes with nonlinear materials.
        """
        self.fields.check(scene)
        what = [loop.name for loop in outer_loops(scene)]
        if scene.preloads and scene.is_nonlinear:
            what.append("preloads in scenes with nonlinear materials")
        if what:
            raise InvalidInputError(
                f"load steps on other meshes carry histories, but not that of {what[0]}: keep the meshes"
            )

    def scene_on(self, scene: Scene) -> Scene:
        """Return the scene of the state on the meshes of another one."""
        return replace(self.state.scene, bodies=scene.bodies)

    def slip_origin(self, torn: TornSystem) -> tuple[np.ndarray, np.ndarray]:
        """Return from where the next step measures slip, see `TornSystem.slip_origin`. Collective.

        `torn`: the system of `scene_on` the new meshes.
        """
        return torn.slip_origin(self.fields.displacement(torn), self.multiplier(torn))

    def slip_at(self, torn: TornSystem) -> np.ndarray:
        """Return the slip of all steps at the points of a system in their tangents, (n, dim − 1)."""
        contact, tangents = self.state.contact, torn.points.tangents
        vectors = np.einsum("na,nad->nd", contact.total_slip, contact.points.tangents)
        return np.einsum("nd,nad->na", self.fields.at_points(torn, vectors), tangents)

    def multiplier(self, torn: TornSystem) -> np.ndarray:
        """Return forces at contact, owned, zero on all other rows: as a start, and for elastic slip."""
        return self.fields.at_contact(torn)

"""What acts on the bodies, at the end of a load step and on the way there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fenics_contact.display import displayed
from fenics_contact.errors import together
from fenics_contact.feti import Decomposition, TornSystem
from fenics_contact.mesh import corners_of
from fenics_contact.qp import Vector
from fenics_contact.scene import Scene


@displayed
@dataclass(frozen=True, eq=False)
class Loading:
    """What acts on the bodies at one time.

    Attributes:
        torn: The system with loads and supports; pressures that follow their surfaces act as on undeformed
            ones.
        prescribed: Prescribed components of all nodes, NaN where free, shape (n_nodes, dim), [length].
        time: The time, for obstacles that move.
        following: Pressures that follow their surfaces, each with the part of them that acts.
    """

    torn: TornSystem
    prescribed: np.ndarray
    time: float
    following: tuple[tuple[float, FollowingPressures], ...] = ()

    def between(self, first: Loading, part: float) -> Loading:
        """Return the load at a part of the way from another one to this."""
        if part == 1.0:
            return self
        parts = zip(first.torn.subdomains, self.torn.subdomains, strict=True)
        subdomains = tuple(replace(b, load=(1.0 - part) * a.load + part * b.load) for a, b in parts)

        def mixed(name: str) -> np.ndarray:
            return np.asarray((1.0 - part) * getattr(first.torn, name) + part * getattr(self.torn, name))

        torn = replace(self.torn, subdomains=subdomains, right=mixed("right"), supported=mixed("supported"))
        prescribed = (1.0 - part) * first.prescribed + part * self.prescribed
        weighted = [((1.0 - part) * weight, each) for weight, each in first.following]
        weighted += [(part * weight, each) for weight, each in self.following]
        time = (1.0 - part) * first.time + part * self.time
        return Loading(torn, prescribed, time, tuple(weighted))

    def removed(self) -> Loading:
        """Return the same supports without movement, at time zero, and no loads."""
        torn = self.torn
        equality = torn.numbering.owned < torn.n_equality
        right = np.where(equality, 0.0, torn.right + torn.supported)
        subdomains = tuple(replace(part, load=np.zeros_like(part.load)) for part in torn.subdomains)
        torn = replace(torn, subdomains=subdomains, right=right, supported=np.zeros_like(torn.supported))
        return Loading(torn, 0.0 * self.prescribed, 0.0)

    @property
    def rim(self) -> np.ndarray:
        """Marks of the nodes near the rims of surfaces that pressures follow, shape (n_nodes,)."""
        marks = np.zeros(len(self.prescribed), dtype=bool)
        for _, pressures in self.following:
            marks |= pressures.rim
        return marks

    def at(self, displacement: Vector) -> tuple[Vector, sp.csr_matrix | None]:
        """Return the forces on deformed bodies, and the stiffness of those that follow their surfaces.

        Args:
            displacement: u of this rank, torn, shape (torn_size,), [length].

        Returns:
            Forces of this rank, torn, shape (torn_size,), [force]; less their growth with u, shape
            (torn_size, torn_size), None where all are dead.
        """
        force, softening = self.torn.load, None
        for weight, pressures in self.following:
            more, matrix = pressures.at(displacement)
            force, matrix = force + weight * more, weight * matrix
            softening = matrix if softening is None else softening + matrix
        return force, softening


@displayed
class FollowingPressures:
    """The pressures of a scene that follow their surfaces, on this rank's subdomains."""

    def __init__(self, scene: Scene, decomposition: Decomposition) -> None:
        """Bind the forms. Collective."""
        forms = decomposition.forms
        self._scene, self._tearing = scene, decomposition.tearing
        forms.prepare_mechanics(scene)
        self._parts = decomposition.parts
        self._acting = []
        with together(decomposition.comm):
            for number, mesh in enumerate(decomposition.meshes):
                body, order = scene.bodies[mesh.body], np.argsort(mesh.nodes)
                for load in scene.following_pressures:
                    if load.body != mesh.body:
                        continue
                    facets = mesh.facets_of(body, load.surface)
                    if not len(facets[0]):
                        continue
                    nodes = mesh.nodes[order]
                    acted = np.isin(nodes, body.mesh.surfaces[load.surface])
                    points, kind = body.mesh.points[nodes], body.mesh.cell_type
                    self._acting.append(
                        (number, forms.following(load, kind, mesh.space, points, facets, acted))
                    )

    @cached_property
    def rim(self) -> np.ndarray:
        """Marks of the nodes of facets at the rims of the surfaces, shape (n_nodes,), replicated."""
        scene, tearing = self._scene, self._tearing
        marks = np.zeros(tearing.n_nodes, dtype=bool)
        for load in scene.following_pressures:
            facets = scene.bodies[load.body].mesh.surfaces[load.surface]
            marks[tearing.global_nodes(load.body, np.unique(_at_rim(facets, scene.dim)))] = True
        return marks

    def _facts(self) -> dict[str, object]:
        return {"pressures": f"{len(self._acting)} on this rank"}

    def at(self, displacement: Vector) -> tuple[Vector, sp.csr_matrix]:
        """Return what forces are more than on undeformed surfaces, and their stiffness; see `Loading.at`."""
        parts = self._parts
        force, size = np.zeros(displacement.size), displacement.size
        blocks = [sp.csr_matrix((part.stop - part.start,) * 2) for part in parts]
        for number, pressure in self._acting:
            more, softening = pressure.at(displacement[parts[number]])
            force[parts[number]] += more
            blocks[number] = blocks[number] + softening
        matrix = sp.block_diag(blocks, format="csr") if blocks else sp.csr_matrix((size, size))
        return force, sp.csr_matrix(matrix)


def _at_rim(facets: np.ndarray, dim: int) -> np.ndarray:
    """Return the facets with a side that no other one has."""
    corners = corners_of(facets, dim)
    if dim == 2:
        sides = corners[..., None]
    else:
        sides = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1), axis=-1)
    _, number, count = np.unique(
        sides.reshape(-1, sides.shape[-1]), axis=0, return_inverse=True, return_counts=True
    )
    alone = count[number.reshape(corners.shape)] == 1
    return np.asarray(facets[alone.any(axis=1)])

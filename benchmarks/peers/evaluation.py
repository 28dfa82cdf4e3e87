"""All bodies in one numbering, and forces, pressure and overlap of any program's displacements, by NumPy.

Every program writes displacements of the same linear hexahedra; what is compared follows from these in the
same way for all, from the forces K u that they need at the nodes.
"""

from __future__ import annotations

from functools import cached_property
from time import process_time
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from benchmarks.cases.scene_data import PLANE_HEIGHT
from benchmarks.peers.scenes import PeerScene, Side
from fenics_contact.study.worker import peak_memory

#: Corners of a hexahedron's faces, counted as Abaqus and CalculiX count them.
FACES = np.array([[0, 1, 2, 3], [4, 7, 6, 5], [0, 4, 5, 1], [1, 5, 6, 2], [2, 6, 7, 3], [3, 7, 4, 0]])
#: Reference coordinates of the corners, in [−1, 1], and Gauss's points.
CORNERS = np.array([[x, y, z] for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))], float)
GAUSS = CORNERS / np.sqrt(3.0)


class Whole:
    """All bodies of a scene in one numbering from 0.

    Attributes:
        points: Coordinates, shape (n, 3).
        cells: Nodes of the hexahedra in VTK's order, shape (m, 8).
        body: Name of the body of each cell.
    """

    def __init__(self, scene: PeerScene) -> None:
        """Number the nodes body by body."""
        self.scene = scene
        meshes = scene.bodies
        starts = np.cumsum([0, *(len(mesh.points) for mesh in meshes.values())])
        self.first = dict(zip(meshes, starts.tolist(), strict=False))
        self.points = np.concatenate([mesh.points for mesh in meshes.values()])
        self.cells = np.concatenate([mesh.cells + self.first[name] for name, mesh in meshes.items()])
        self.body = np.repeat(list(meshes), [len(mesh.cells) for mesh in meshes.values()])

    def facets(self, side: Side) -> np.ndarray:
        """Return the nodes of a side's facets, shape (k, 4)."""
        body, name = side
        return np.asarray(self.scene.bodies[body].surfaces[name] + self.first[body])

    def nodes(self, side: Side) -> np.ndarray:
        """Return the nodes of a side, ascending."""
        return np.unique(self.facets(side))

    def faces(self, side: Side) -> np.ndarray:
        """Return cell and face, both from 0, of every facet of a side, shape (k, 2)."""
        keys = np.sort(self.cells[:, FACES], axis=2).reshape(-1, 4)
        both = np.concatenate([keys, np.sort(self.facets(side), axis=1)])
        _, same = np.unique(both, axis=0, return_inverse=True)
        same = same.ravel()
        place = np.empty(same.max() + 1, dtype=np.int64)
        place[same[: len(keys)]] = np.arange(len(keys))
        return np.column_stack(np.divmod(place[same[len(keys) :]], len(FACES)))

    def weights(self, side: Side) -> np.ndarray:
        """Return the integrals of the shape functions of all nodes over a side, shape (n,)."""
        facets, total = self.facets(side), np.zeros(len(self.points))
        corners = self.points[facets]
        for s, t in GAUSS[:4, :2]:
            along, across = CORNERS[:4, 0], CORNERS[:4, 1]
            shape = (1 + s * along) * (1 + t * across) / 4
            tangents = np.stack([along * (1 + t * across) / 4, across * (1 + s * along) / 4])
            first, second = np.einsum("ka,fad->kfd", tangents, corners)
            np.add.at(total, facets, np.linalg.norm(np.cross(first, second), axis=1)[:, None] * shape)
        return total

    def held(self) -> dict[tuple[int, int], float]:
        """Return the given displacement of (node, direction)."""
        return {
            (int(node), direction): value
            for side, values in self.scene.held
            for node in self.nodes(side)
            for direction, value in enumerate(values)
            if value is not None
        }

    def loads(self) -> np.ndarray:
        """Return the nodal forces of the traction, shape (n, 3)."""
        if self.scene.traction is None:
            return np.zeros_like(self.points)
        side, value = self.scene.traction
        return np.outer(self.weights(side), value)

    @cached_property
    def stiffness(self) -> sp.csr_matrix:
        """K of all bodies, three dofs a node, by eight points of Gauss."""
        young, poisson = self.scene.young, self.scene.poisson
        lame = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
        law = 2 * young / (2 * (1 + poisson)) * np.diag([1, 1, 1, 0.5, 0.5, 0.5])
        law[:3, :3] += lame
        corners, local = self.points[self.cells], np.zeros((len(self.cells), 24, 24))
        for point in GAUSS:
            factors = (1 + CORNERS * point) / 2
            slopes = np.stack(
                [CORNERS[:, d] / 2 * np.prod(np.delete(factors, d, axis=1), axis=1) for d in range(3)]
            )
            jacobian = np.einsum("da,mac->mdc", slopes, corners)
            gradient = np.linalg.solve(jacobian, np.broadcast_to(slopes, (len(corners), 3, 8)))
            strain = np.zeros((len(corners), 6, 8, 3))
            for row in range(3):
                strain[:, row, :, row] = gradient[:, row]
                i, j = ((0, 1), (1, 2), (0, 2))[row]
                strain[:, 3 + row, :, i], strain[:, 3 + row, :, j] = gradient[:, j], gradient[:, i]
            rows = strain.reshape(-1, 6, 24)
            local += np.linalg.det(jacobian)[:, None, None] * (rows.transpose(0, 2, 1) @ law @ rows)
        dofs = (3 * self.cells[:, :, None] + np.arange(3)).reshape(-1, 24)
        rows, columns = np.repeat(dofs, 24, axis=1), np.tile(dofs, (1, 24))
        size = 3 * len(self.points)
        return sp.coo_matrix((local.ravel(), (rows.ravel(), columns.ravel())), (size, size)).tocsr()

    def forces(self, displacement: np.ndarray) -> np.ndarray:
        """Return what supports and contact exert on the nodes, shape (n, 3): K u − f."""
        return (self.stiffness @ displacement.ravel()).reshape(-1, 3) - self.loads()

    def overlap(self, displacement: np.ndarray, near: int = 8) -> float:
        """Return the largest depth of slave nodes below the master as displaced; 0 where none is below.

        Of the nearest facets of the master, cut into triangles, the closest one on which a node lies counts.
        """
        moved, slaves = self.points + displacement, self.nodes(self.scene.slave)
        if self.scene.master is None:
            return float(max(0.0, (PLANE_HEIGHT - moved[slaves, 2]).max()))
        facets = self.facets(self.scene.master)
        a, b, c = np.moveaxis(moved[np.concatenate([facets[:, [0, 1, 2]], facets[:, [0, 2, 3]]])], 1, 0)
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        _, at = cKDTree((a + b + c) / 3).query(moved[slaves], k=min(near, len(a)))
        away = moved[slaves][:, None] - a[at]
        height = np.einsum("ikd,ikd->ik", away, normal[at])
        edges = np.stack([b - a, c - a], axis=-1)
        within = np.einsum("ikpd,ikd->ikp", np.linalg.pinv(edges)[at], away)
        on = (within.min(axis=2) > -1e-6) & (within.sum(axis=2) < 1 + 1e-6)
        height = np.where(on, height, np.inf)
        closest = np.take_along_axis(height, np.abs(height).argmin(axis=1)[:, None], axis=1)
        return float(max(0.0, -closest[np.isfinite(closest)].min(initial=0.0)))


def taken(start: float, steps: int, converged: bool) -> dict[str, Any]:
    """Return what a state has taken by now: processor seconds since a time, and with all imports, memory."""
    now = process_time()
    return {
        "seconds": now - start,
        "process_seconds": now,
        "program_memory": peak_memory(),  # what is evaluated later takes more
        "steps": int(steps),
        "converged": bool(converged),
    }


def evaluated(whole: Whole, displacement: np.ndarray) -> dict[str, Any]:
    """Return what a scene is judged by, of a displacement of all nodes, shape (n, 3).

    ``normal`` and ``tangential`` are the contact forces on the slave along z and across; ``peak`` is the
    largest nodal force over the area of its node; ``hoop`` is the force on the hub's cut y = 0.
    """
    scene, forces = whole.scene, whole.forces(displacement)
    slaves = whole.nodes(scene.slave)
    found: dict[str, Any] = {"overlap": whole.overlap(displacement)}
    if "hub" in scene.bodies:
        return {**found, "hoop": float(abs(forces[whole.nodes(("hub", "y0")), 1].sum()))}
    for node, direction in whole.held():  # what supports exert there
        forces[node, direction] = 0.0
    across, along, normal = forces[slaves].sum(axis=0)
    found |= {"normal": float(abs(normal)), "tangential": [float(abs(across)), float(abs(along))]}
    if "ball" in scene.bodies:
        area = whole.weights(scene.slave)[slaves]
        found["peak"] = float((np.abs(forces[slaves, 2]) / area).max())
    return found

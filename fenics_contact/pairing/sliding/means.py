"""Mortar contact of bodies where they lie now: weighted means over the master, and how these move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fenics_contact._libraries import MPI
from fenics_contact.linalg import scaled_rows
from fenics_contact.mesh import coordinate_rounding
from fenics_contact.pairing.contact_points import ContactPoints
from fenics_contact.pairing.coupling_derivatives import CouplingDerivatives
from fenics_contact.pairing.mortar import (
    MortarCoupling,
    mortar_coupling,
    mortar_pulled_back,
    weight_derivatives,
)
from fenics_contact.pairing.sliding.differential import spread
from fenics_contact.pairing.sliding.mean_motion import MeanMotion, MeanTangents, interleaved
from fenics_contact.pairing.sliding.meeting import Meeting
from fenics_contact.pairing.sliding.moved_surface import (
    moved_surface,
    summed_normals,
    summed_normals_by_points,
)
from fenics_contact.surfaces import FacetedSurface


@dataclass(frozen=True)
class MovingMeans:
    """The mortar coupling of two surfaces as they lie now, with the gap n_i·(x_i − Σ W_ij x_j).

    Normals n of the slave and weights W depend on the coordinates, but not on how everything lies in space.

    Attributes:
        slave: The slave surface in its present place.
        master: The master surface in its present place.
        coupling: Their coupling, at nodes that may carry a multiplier.
        slave_nodes: Nodes of the slave among those of all bodies.
        master_nodes: Nodes of the master among those of all bodies.
        comm: Communicator of the ranks that share the work.
    """

    slave: FacetedSurface
    master: FacetedSurface
    coupling: MortarCoupling
    slave_nodes: np.ndarray
    master_nodes: np.ndarray
    comm: MPI.Comm

    @classmethod
    def of(cls, meeting: Meeting, coordinates: np.ndarray, comm: MPI.Comm) -> MovingMeans:
        """Couple the surfaces of a pair. Collective on ``comm``.

        Args:
            meeting: The pair.
            coordinates: Of all nodes, shape (n_nodes, dim), [length].
            comm: Communicator of the ranks that share the work.
        """
        assert meeting.facets is not None
        slave = moved_surface(meeting.slave, coordinates[meeting.slave_nodes])
        master = moved_surface(meeting.facets, coordinates[meeting.master_nodes])
        coupling = mortar_coupling(slave, master, comm)
        coupling = coupling.part(np.isin(coupling.node, meeting.candidates))
        return cls(slave, master, coupling, meeting.slave_nodes, meeting.master_nodes, comm)

    def weights(self, n_nodes: int) -> sp.csr_matrix:
        """Return the weights of the nodes of all bodies, shape (n, n_nodes)."""
        weight = self.coupling.weight
        entries = weight.data, self.master_nodes[weight.indices], weight.indptr
        return sp.csr_matrix(entries, shape=(weight.shape[0], n_nodes))

    def symmetric(self) -> np.ndarray:
        """Return the components normal to planes of symmetry that cut both surfaces, shape (n, dim)."""
        slave, master, met = self.slave, self.master, self.coupling.weight.tocoo()
        node, result = self.coupling.node[met.row], np.zeros(self.coupling.normal.shape, dtype=bool)
        apart = np.abs(slave.points[node] - master.points[met.col])
        same = apart <= coordinate_rounding(np.concatenate([slave.points, master.points]))
        np.logical_or.at(result, met.row, slave.mirrored[node] & master.mirrored[met.col] & same)
        return result

    def areas_pulled_back(self, by_area: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Vector-Jacobian product of the coupling's areas with respect to the nodes of slave and master.

        Collective.

        Args:
            by_area: Shape (n,).
        """
        count, dim = self.coupling.normal.shape
        none = np.zeros((count, 0)), np.zeros((len(self.master.nodes), 0))
        by = CouplingDerivatives(by_area, *none, np.zeros((count, dim)), np.zeros(count))
        by_slave, by_master = mortar_pulled_back(self.slave, self.master, self.coupling, by, self.comm)
        return by_slave.points, by_master.points

    def tangents(
        self,
        points: ContactPoints,
        coordinates: np.ndarray,
        forces: tuple[np.ndarray, np.ndarray],
        slid: tuple[np.ndarray, sp.csr_matrix],
    ) -> MeanTangents:
        """Return what the linearisation has beside the rows of the forces. Collective.

        Args:
            points: The contact points of this pair.
            coordinates: Of all nodes, shape (n_nodes, dim), [length].
            forces: λ_N, shape (n,), and τ in the points' tangents, shape (n, dim − 1), [force].
            slid: The slip as vectors, shape (n, dim), [length], and the weights of all nodes from which it
                counts, shape (n, n_nodes).
        """
        normal, friction = forces
        rubbed, (way, before) = (friction != 0.0).any(axis=1), slid
        motion = self.motion(points, rubbed | (normal != 0.0))
        standing = (points.master - before - points.jump).tocsr()
        slip = [
            scaled_rows((spread(points.tangents[:, c], standing) + rows).tocsr(), rubbed.astype(float))
            for c, rows in enumerate(motion.slip_rows(points, coordinates, way))
        ]
        gap = motion.gap_rows(points, coordinates)
        return MeanTangents(motion.stiffness(points, normal, friction), gap, interleaved(slip))

    def motion(self, points: ContactPoints, wanted: np.ndarray) -> MeanMotion:
        """Differentiate normals and weights of wanted points. Collective.

        Args:
            points: The contact points of this pair.
            wanted: Points that need it, a mask, shape (n,).
        """
        nodes, dim = np.concatenate([self.slave_nodes, self.master_nodes]), self.slave.dim
        dof = (dim * nodes[:, None] + np.arange(dim)).ravel()
        size = dim * points.master.shape[1]

        def among_all(rows: sp.csr_matrix) -> sp.csr_matrix:
            """Return rows by the dofs of both surfaces, or of the slave, as rows by those of all bodies."""
            whole = sp.csr_matrix((rows.data, dof[rows.indices], rows.indptr), shape=(rows.shape[0], size))
            whole.sum_duplicates()  # of nodes on both surfaces, and sorted
            return whole

        found = weight_derivatives(self.slave, self.master, self.coupling, wanted, self.comm)
        turn = tuple(
            among_all(scaled_rows(self._turned(points.tangents[:, a]), wanted.astype(float)))
            for a in range(dim - 1)
        )
        return MeanMotion(turn, found.point, self.master_nodes[found.node], among_all(found.rows))

    def _turned(self, along: np.ndarray) -> sp.csr_matrix:
        """Return v·δn of the points by the slave's nodes for vectors v across the normals, (n, n_dofs)."""
        slave, node = self.slave, self.coupling.node
        size = np.linalg.norm(summed_normals(slave, slave.points)[node], axis=1)[:, None]
        vectors = np.zeros_like(slave.points)
        vectors[node] = -np.where(slave.mirrored[node], 0.0, along) / size
        return summed_normals_by_points(slave, vectors)[node]

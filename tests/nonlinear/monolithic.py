"""One Newton system for all unknowns of a body in one piece: another way to the same discrete equilibrium."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from scipy.sparse.linalg import splu

from fenics_contact import Scene
from fenics_contact._large_deformations.equations import Equations
from fenics_contact._large_deformations.loading import Loading
from fenics_contact.feti import TornSystem, build_torn_system, decompose
from fenics_contact.qp.layout import ContactLayout


class Monolithic:
    """Displacements and multipliers of all rows at once, by sparse LU; frictional rows in three dimensions.

    Attributes:
        displacement: By node, shape (n_nodes, dim).
        multiplier: Of supports and contacts, in the order of the rows of the torn system.
        steps: Newton steps of every load step.
    """

    def __init__(self, scene: Scene) -> None:
        pieces = {name: np.zeros(body.mesh.n_cells, dtype=int) for name, body in scene.bodies.items()}
        self._decomposition = decompose(scene, pieces, MPI.COMM_SELF)
        self._equations = Equations(scene, self._decomposition)
        self._last: TornSystem | None = None
        self._u = np.zeros(self._decomposition.torn_size)
        self.multiplier = np.zeros(0)
        self.steps: list[int] = []

    @property
    def displacement(self) -> np.ndarray:
        (mesh,) = self._decomposition.meshes
        by_node = np.empty((len(mesh.nodes), mesh.dim))
        by_node[mesh.nodes] = self._u.reshape(-1, mesh.dim)
        return by_node

    def advance(self, scene: Scene, tolerance: float = 1e-11) -> None:
        """Find the equilibrium of the next load."""
        torn = build_torn_system(scene, self._decomposition, previous=self._last)
        earlier = self._last or Loading(torn, np.zeros(0), 1.0).removed().torn
        self._last = torn
        torn = torn.with_slip_from(earlier.relative(self._u), earlier.sliding(self._u))
        if self.multiplier.size == 0:
            self.multiplier = np.zeros(len(torn.right))
        (mechanics,) = self._equations._mechanics
        layout, u, lam = torn.layout, self._u, self.multiplier
        mu = torn.friction_coefficient
        B, n, m = torn.B, len(u), len(torn.right)
        for number in range(40):
            response = mechanics.at(u)
            lacking = torn.right - B @ u
            rho = 0.1 * response.stiffness.diagonal().max()
            force = torn.load - response.force - B.T @ lam
            rows, A, D = self._rows(layout, lacking, lam, rho, mu)
            size = max(np.abs(lam).max(), np.abs(response.force).max(), 1e-30)
            wrong = max(np.abs(force).max() / size, np.abs(rows).max() / max(np.abs(u).max(), 1e-3))
            if number and wrong < tolerance:
                self._u, self.multiplier = u, lam
                self.steps.append(number)
                return
            matrix = sp.bmat([[response.stiffness, B.T], [A @ B, D]]).tocsc()
            change = splu(matrix).solve(np.concatenate([force, rows]))
            u, lam = u + change[:n], lam + change[n:]
        assert m, "the reference must converge"
        raise AssertionError(f"the reference does not converge, its residual is {wrong}")

    @staticmethod
    def _rows(
        layout: ContactLayout, lacking: np.ndarray, lam: np.ndarray, rho: float, mu: np.ndarray
    ) -> tuple[np.ndarray, sp.csr_matrix, sp.csr_matrix]:
        """Return −(residual) of all rows, in lengths, and its derivatives A by B u and D by λ."""
        m = len(lam)
        A, D, right = sp.lil_matrix((m, m)), sp.lil_matrix((m, m)), lacking.copy()
        for row in layout.equality:
            A[row, row] = 1.0
        closed = lam[layout.normal] - rho * lacking[layout.normal] > 0.0
        for row, on in zip(layout.normal, closed, strict=True):
            A[row, row], D[row, row] = (1.0, 0.0) if on else (0.0, 1.0 / rho)
            right[row] = lacking[row] if on else -lam[row] / rho
        for disc, rows in enumerate(layout.tangential):
            normal = layout.normal[layout.friction_of[disc]]
            bound = mu[disc] * max(lam[normal], 0.0)
            w = lam[rows] - rho * lacking[rows]
            length = np.linalg.norm(w)
            if closed[layout.friction_of[disc]] and length < bound:
                A[rows, rows] = 1.0
                continue
            e = w / length if length > 0 else np.zeros(len(rows))
            turn = (
                bound / length * (np.eye(len(rows)) - np.outer(e, e)) if length > 0 else 0 * np.eye(len(rows))
            )
            # λ_T − μ λ_N e = 0, divided by ρ
            A[np.ix_(rows, rows)] = -turn
            D[np.ix_(rows, rows)] = (np.eye(len(rows)) - turn) / rho
            D[rows, normal] = -mu[disc] * e / rho if lam[normal] > 0.0 else 0.0
            right[rows] = -(lam[rows] - bound * e) / rho
        return right, A.tocsr(), D.tocsr()

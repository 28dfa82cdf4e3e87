"""A block dragged over an arched one by Newton's method on one mesh, contact where the bodies lie."""

from __future__ import annotations

from dataclasses import dataclass

import dolfinx.fem
import dolfinx.fem.petsc
import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg

from fenics_contact import Scene, _dolfinx
from fenics_contact._pairing.sliding.contact import SlidingContact
from fenics_contact._pairing.sliding.points import SlidingPoints
from fenics_contact._pairing.sliding.stiffness import spread
from tests.linear.monolithic import _forms

#: Prescribed motion of the upper block's upper side in each load step: down, then along the arch.
WAY = np.array([[0.02, 0.0, -0.02], [0.12, 0.03, -0.02], [0.12, 0.03, -0.004]])


@dataclass(frozen=True)
class Terms:
    """Which derivatives of the contact forces Newton's method knows."""

    normal: bool = True
    friction: bool = True


def stiffness(scene: Scene) -> sp.csr_matrix:
    """Return the stiffness of all bodies, linear elastic."""
    blocks = []
    for name, body in scene.bodies.items():
        mesh = _dolfinx.local_mesh(body.mesh.points, body.mesh.cells, body.mesh.cell_type)
        V = _dolfinx.coefficient(mesh, "u").function_space
        nodes, dofs = _dolfinx.node_dofs(V)
        matrix = dolfinx.fem.petsc.assemble_matrix(dolfinx.fem.form(_forms(scene, name, V)[0]))
        matrix.assemble()
        start, column, value = matrix.getValuesCSR()
        place = np.empty(body.mesh.n_nodes, dtype=np.int64)
        place[nodes] = dofs
        dof = (3 * place[:, None] + np.arange(3)).ravel()
        blocks.append(sp.csr_matrix((value, column, start))[dof][:, dof])
    return sp.block_diag(blocks, format="csr")


class Dragged:
    """Displacements and multipliers of the scene while it is dragged; all closed points slip."""

    def __init__(self, scene: Scene, coefficient: float, terms: Terms) -> None:
        self.scene, self.coefficient, self.terms = scene, coefficient, terms
        first = scene.bodies["high"].mesh.n_nodes
        self.driven = np.unique(scene.bodies["high"].mesh.surfaces["z1"])
        self.fixed = np.zeros(scene.points.shape, dtype=bool)
        self.fixed[self.driven] = True
        self.fixed[first + np.unique(scene.bodies["low"].mesh.surfaces["z0"])] = True
        self.matrix, self.contact = stiffness(scene), SlidingContact.of(scene, self.fixed)
        self.u = np.zeros(scene.points.shape)
        self.points = self.contact.at(scene.points)
        self.force = np.zeros(self.points.points.count)

    def advance(self, way: np.ndarray, most: int = 25) -> list[float]:
        """Move the driven side on and find the equilibrium; return the residual of each iterate."""
        self.u[self.driven] += way
        start, residuals = self.points.material_points(), []
        while len(residuals) < most:
            now = self.contact.at(self.scene.points + self.u, self.points)
            self.force, self.points = now.carry(self.force, self.points), now
            start = start.extended(now.material_points())
            residuals.append(self._step(now, now.slip(start), now.slip_rows(start)))
            if residuals[-1] < 1e-10:
                break
        return residuals

    def _step(self, now: SlidingPoints, slip: np.ndarray, slip_rows: sp.csr_matrix) -> float:
        points, free = now.points, np.flatnonzero(~self.fixed.ravel())
        closed = np.flatnonzero(self.force - 2.0 * points.gap > 0)
        force = np.zeros(points.count)
        force[closed] = self.force[closed]
        length = np.maximum(np.linalg.norm(slip, axis=1), 1e-12)[:, None]
        way = slip / length
        friction = self.coefficient * force[:, None] * way
        normal = -spread(points.normal, points.jump)
        along = [spread(points.tangents[:, a], points.jump) for a in range(2)]
        rubbing = sp.vstack(along).T.tocsr()
        rest = self.matrix @ self.u.ravel() + normal.T @ force + rubbing @ friction.T.ravel()
        error = max(np.abs(rest[free]).max(), np.abs(points.gap[closed]).max(initial=0.0))
        matrix = self.matrix
        if self.terms.normal:
            matrix = matrix + now.stiffness(force).assembled()
        if self.terms.friction:
            turned = now.friction_stiffness(friction)
            matrix = matrix + turned.left @ turned.right.T
        across = np.eye(2) - way[:, :, None] * way[:, None]
        bent = (self.coefficient * force[:, None] / length)[:, :, None] * across
        by_slip = sp.bmat([[sp.diags(bent[:, a, b]) for b in range(2)] for a in range(2)])
        matrix = matrix + rubbing @ by_slip @ sp.vstack([slip_rows[a::2] for a in range(2)])
        columns = normal.T + rubbing @ sp.vstack([sp.diags(self.coefficient * way[:, a]) for a in range(2)])
        system = [[matrix[free][:, free], columns.tocsr()[free][:, closed]], [normal[closed][:, free], None]]
        right = np.concatenate([-rest[free], points.gap[closed]])
        change = scipy.sparse.linalg.splu(sp.bmat(system, format="csc")).solve(right)
        self.u.ravel()[free] += change[: len(free)]
        force[closed] += change[len(free) :]
        self.force = force
        return float(error)

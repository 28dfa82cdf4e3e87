"""The same contact problem written down a second time, on whole bodies, and given to a conic solver.

Nothing is shared with the package but the scene: elements, loads and contact rows are integrated and
projected here with NumPy, nodes are not torn, supports are eliminated, and Clarabel minimises

    ½ uᵀK u − fᵀu + Σ Ψ_i s_i    over    N u ≤ gap,    ‖T_i u‖ ≤ s_i .

Masters must be flat, so that closest points can be found by hand.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import clarabel
import numpy as np
import scipy.sparse as sp

from fenics_contact import BodyForce, BodyMesh, ContactPair, Coulomb, RigidPlane, Scene, TotalForce, Tresca
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh.faces import vector_areas
from tests.scenes import Load

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])


def quadrature(mesh: BodyMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return shape functions (q, k), gradients (q, cells, k, 3) and weights (q, cells) at Gauss points."""
    if mesh.cell_type == "tetrahedron":
        values = np.full((1, 4), 0.25)
        local = np.vstack([[-1.0, -1.0, -1.0], np.eye(3)])[None]
        share = 1 / 6
    else:
        points = np.array(list(product(0.5 + np.array([-0.5, 0.5]) / np.sqrt(3), repeat=3)))
        factors = np.where(CORNERS[None] == 1, points[:, None], 1 - points[:, None])
        values = factors.prod(axis=2)
        slopes = np.where(CORNERS == 1, 1.0, -1.0)
        others = [np.delete(factors, a, axis=2).prod(axis=2) for a in range(3)]
        local = slopes * np.stack(others, axis=2)
        share = 1 / 8
    jacobian = np.einsum("qka,ckd->qcda", local, mesh.points[mesh.cells])
    gradients = np.einsum("qka,qcad->qckd", local, np.linalg.inv(jacobian))
    return values, gradients, share * np.linalg.det(jacobian)


def stiffness(mesh: BodyMesh, material: IsotropicElasticity) -> sp.csr_matrix:
    """Assemble K, dof 3 n + d for component d of node n."""
    lame, shear = material.parameters
    _, g, weight = quadrature(mesh)
    same = np.einsum("qc,qcie,qcje->cij", weight, g, g)
    outer = np.einsum("qc,qcid,qcje->cijde", weight, g, g)
    blocks = shear * (same[..., None, None] * np.eye(3) + outer.swapaxes(3, 4)) + lame * outer
    dofs = (3 * mesh.cells[:, :, None] + np.arange(3)).reshape(mesh.n_cells, -1)
    entries = blocks.swapaxes(2, 3).reshape(mesh.n_cells, dofs.shape[1], dofs.shape[1])
    rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
    size = 3 * mesh.n_nodes
    return sp.coo_matrix((entries.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size)).tocsr()


def nodal_areas(mesh: BodyMesh, facets: np.ndarray) -> np.ndarray:
    """Deal out facets' areas to their corners in equal parts: exact for parallelograms and triangles."""
    areas = np.zeros(mesh.n_nodes)
    sizes = np.linalg.norm(vector_areas(mesh.points, facets), axis=1)
    np.add.at(areas, facets, sizes[:, None] / facets.shape[1])
    return areas


def load_vector(mesh: BodyMesh, load: Load) -> np.ndarray:
    """Return nodal forces, (n_nodes, 3)."""
    if isinstance(load, BodyForce):
        values, _, weight = quadrature(mesh)
        share = np.zeros(mesh.n_nodes)
        np.add.at(share, mesh.cells, np.einsum("qk,qc->ck", values, weight))
    else:
        share = nodal_areas(mesh, mesh.surfaces[load.surface])
    value = np.asarray(load.value)
    return np.outer(share, value / share.sum() if isinstance(load, TotalForce) else value)


@dataclass(frozen=True)
class ContactRows:
    """Contact written on whole bodies: one normal and two tangential rows for each slave node.

    Attributes:
        slave: Slave nodes among all bodies' nodes, (n,).
        N: Rows of −n·(u_slave − u_master), (n, size).
        T: Rows of three components of the slip in space, (3 n, size).
        normal: From master to slave, (n, 3).
        gap: At the start, (n,).
        bound: Tresca's nodal force, (n,).
        coefficient: Coulomb's coefficient, (n,).
    """

    slave: np.ndarray
    N: sp.csr_matrix
    T: sp.csr_matrix
    normal: np.ndarray
    gap: np.ndarray
    bound: np.ndarray
    coefficient: np.ndarray


def master_weights(points: np.ndarray, mesh: BodyMesh, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Interpolate a flat surface of parallelograms or triangles below points: nodes and weights, (n, k)."""
    corners = mesh.points[facets]
    edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, -1] - corners[:, 0]], axis=2)
    local = np.einsum("fad,nfd->nfa", np.linalg.pinv(edges), points[:, None] - corners[None, :, 0])
    s, t = local[..., 0], local[..., 1]
    if facets.shape[1] == 3:
        values = np.stack([1 - s - t, s, t], axis=-1)
    else:
        values = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=-1)
    worst = values.min(axis=-1)
    best = np.argmax(worst, axis=1)
    assert np.all(worst.max(axis=1) > -1e-9), "a slave node lies beside the master"
    here = np.arange(len(points))
    return facets[best], values[here, best]


def contact_rows(scene: Scene, pair: ContactPair, offset: dict[str, int], size: int) -> ContactRows:
    """Project the slave nodes of one pair on its flat master by hand."""
    body = scene.bodies[pair.slave.body].mesh
    own = np.unique(body.surfaces[pair.slave.name])
    points, count = body.points[own], len(own)
    if isinstance(pair.master, RigidPlane):
        normal, origin = np.asarray(pair.master.normal), np.asarray(pair.master.point)
        nodes, weights = np.zeros((count, 0), dtype=int), np.zeros((count, 0))
    else:
        other = scene.bodies[pair.master.body].mesh
        facets = other.surfaces[pair.master.name]
        normal = vector_areas(other.points, facets).sum(axis=0)
        normal, origin = normal / np.linalg.norm(normal), other.points[facets[0, 0]]
        assert np.allclose((other.points[facets] - origin) @ normal, 0), "the master must be flat"
        nodes, weights = master_weights(points, other, facets)
        nodes = nodes + offset[pair.master.body]
    slave = own + offset[pair.slave.body]
    node = np.column_stack([slave, nodes])
    value = np.column_stack([np.ones(count), -weights])
    row = np.repeat(np.arange(count), node.shape[1])
    jump = sp.csr_matrix((value.ravel(), (row, node.ravel())), shape=(count, size // 3))
    areas = nodal_areas(body, body.surfaces[pair.slave.name])[own]
    law = pair.friction
    return ContactRows(
        slave=slave,
        N=sp.kron(jump, -normal[None]).tocsr(),
        T=sp.kron(jump, np.eye(3) - np.outer(normal, normal)).tocsr(),
        normal=np.tile(normal, (count, 1)),
        gap=(points - origin) @ normal,
        bound=areas * (law.traction if isinstance(law, Tresca) else 0.0),
        coefficient=np.full(count, law.friction_coefficient if isinstance(law, Coulomb) else 0.0),
    )


@dataclass(frozen=True)
class ConicSolution:
    """What Clarabel found.

    Attributes:
        displacement: All bodies' nodes, (n_nodes, 3).
        contact_force: Force on every slave node, (n, 3).
        normal_force: λ_N, (n,).
        primal: ½ uᵀK u − fᵀu + Σ Ψ ‖T u‖.
        dual: The value of the dual problem.
    """

    displacement: np.ndarray
    contact_force: np.ndarray
    normal_force: np.ndarray
    primal: float
    dual: float


class ConicReference:
    """A scene as one system on whole bodies."""

    def __init__(self, scene: Scene) -> None:
        bodies = scene.bodies
        counts = [body.mesh.n_nodes for body in bodies.values()]
        self.offset = dict(zip(bodies, np.cumsum([0, *counts[:-1]]).tolist(), strict=True))
        self.size = 3 * sum(counts)
        self.scene = scene
        self.K = sp.block_diag([stiffness(b.mesh, b.material) for b in bodies.values()], format="csr")
        force = {name: np.zeros((body.mesh.n_nodes, 3)) for name, body in bodies.items()}
        for load in scene.loads:
            force[load.body] += load_vector(bodies[load.body].mesh, load)
        self.f = np.concatenate(list(force.values())).ravel()
        self.prescribed = np.full(self.size, np.nan)
        for support in scene.supports:
            nodes = np.unique(bodies[support.body].mesh.surfaces[support.surface]) + self.offset[support.body]
            for component, value in enumerate(support.value):
                if value is not None:
                    self.prescribed[3 * nodes + component] = value

    @cached_property
    def rows(self) -> ContactRows:
        """Contact rows of all pairs, in the order of the scene, nodes ascending."""
        parts = [contact_rows(self.scene, pair, self.offset, self.size) for pair in self.scene.contacts]
        joined = {}
        for name in ContactRows.__dataclass_fields__:
            values = [getattr(part, name) for part in parts]
            stacked = sp.issparse(values[0])
            joined[name] = sp.vstack(values, format="csr") if stacked else np.concatenate(values)
        return ContactRows(**joined)

    def reaction(self, displacement: np.ndarray) -> np.ndarray:
        """Return K u − f node by node, the forces that supports and contact must exert, (n_nodes, 3)."""
        return (self.K @ displacement.ravel() - self.f).reshape(-1, 3)

    def solve(self, slip_bound: np.ndarray | None = None, before: np.ndarray | None = None) -> ConicSolution:
        """Minimise at given slip bounds, those of the scene's Tresca pairs by default.

        Slip is measured from the displacement ``before``, shape (n_nodes, 3), or from rest.
        """
        bound = self.rows.bound if slip_bound is None else slip_bound
        discs = np.flatnonzero(bound > 0)
        free = np.isnan(self.prescribed)
        held = np.where(free, 0.0, self.prescribed)
        shifted = self.f - self.K @ held
        n_discs = len(discs)
        gap = self.rows.gap - self.rows.N @ held
        slip_rows = (3 * discs[:, None] + np.arange(3)).ravel()
        start = held if before is None else held - before.ravel()
        sliding, pulled = self.rows.T[slip_rows][:, free], self.rows.T[slip_rows] @ start
        # One cone (s, slip in space) a disc: rows 4 i of the identity in s, rows 4 i + 1.. of T.
        lift = sp.kron(sp.identity(n_discs), np.array([[1.0], [0], [0], [0]]))
        spread = sp.kron(sp.identity(n_discs), np.vstack([np.zeros(3), np.eye(3)])) if n_discs else None
        blocks = [[self.rows.N[:, free], None]]
        right = [gap]
        if n_discs:
            blocks.append([-spread @ sliding, -lift])
            right.append(spread @ pulled)
        A = sp.bmat(blocks, format="csc") if n_discs else sp.csc_matrix(self.rows.N[:, free])
        P = sp.block_diag([self.K[free][:, free], sp.csc_matrix((n_discs, n_discs))], format="csc")
        cones = [clarabel.NonnegativeConeT(len(gap))] + [clarabel.SecondOrderConeT(4)] * n_discs
        q = np.concatenate([-shifted[free], bound[discs]])
        upper, b = sp.triu(P).tocsc(), np.concatenate(right)
        # Rounding ends one run sooner than the other: the one with the smaller gap counts.
        runs = [
            clarabel.DefaultSolver(upper, q, A, b, cones, _settings(static)).solve()
            for static in (1e-8, 1e-9, 1e-10)
        ]
        solution = min(runs, key=lambda run: abs(run.obj_val - run.obj_val_dual))
        assert str(solution.status) in ("Solved", "AlmostSolved"), solution.status
        return self._answer(solution, free, held, shifted, discs)

    def _answer(self, solution, free, held, shifted, discs) -> ConicSolution:
        u = held.copy()
        u[free] = solution.x[: int(free.sum())]
        normal = np.array(solution.z[: len(self.rows.gap)])
        force = normal[:, None] * self.rows.normal
        force[discs] += np.array(solution.z[len(normal) :]).reshape(-1, 4)[:, 1:]
        constant = 0.5 * held @ (self.K @ held) - self.f @ held
        return ConicSolution(
            u.reshape(-1, 3), force, normal, solution.obj_val + constant, solution.obj_val_dual + constant
        )


def _settings(static: float) -> clarabel.DefaultSettings:
    """Ask for a little more than rounding allows everywhere, and accept 1e-11.

    ``static`` regularises the factorisations; their errors are taken back by refinement.
    """
    settings = clarabel.DefaultSettings()
    settings.static_regularization_constant = static
    settings.verbose = False
    settings.equilibrate_enable = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-13
    settings.tol_infeas_abs = settings.tol_infeas_rel = 1e-16  # rounding must not pass for a proof
    settings.reduced_tol_gap_abs = settings.reduced_tol_gap_rel = settings.reduced_tol_feas = 1e-11
    return settings

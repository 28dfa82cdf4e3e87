"""Is every body held? A conic feasibility problem on rigid motions, before anything is factored."""

from __future__ import annotations

import clarabel
import numpy as np
import scipy.sparse as sp

from fenics_contact.errors import ConvergenceError, InfeasibleError, together
from fenics_contact.feti import TornSystem
from fenics_contact.feti.dual import BALANCED
from fenics_contact.scene import rigid_body_modes

#: Support reactions below this fraction of the largest count as none: the motion is not resisted.
RANK_TOLERANCE = 1e-9


def check_held(torn: TornSystem) -> None:
    """Refuse a scene in which some body can move away under the load. Collective.

    Asks whether support reactions and admissible contact forces (pressing, inside the friction cone or
    disc) exist that balance the load on every body. If not, the dual problem is infeasible: there is a
    rigid motion that nothing resists and along which the load does work.

    Args:
        torn: Gives scene, contact points and loads; its matrices are not used.

    Raises:
        InfeasibleError: Names the body and the motion.
    """
    comm = torn.numbering.comm
    bodies = [_RigidBody(torn, index) for index in range(len(torn.scene.bodies))]
    loads = comm.allreduce(np.array([body.load_wrench(torn) for body in bodies]))
    loads[np.abs(loads) <= BALANCED * comm.allreduce(np.abs(torn.load).sum())] = 0.0
    with together(comm):
        floating = [index for index, body in enumerate(bodies) if body.support.shape[1] < 6]
        if comm.rank == 0 and floating:
            _check_balance(torn, [bodies[index] for index in floating], loads[floating])


def _check_balance(torn: TornSystem, bodies: list[_RigidBody], loads: np.ndarray) -> None:
    scale = float(np.abs(loads).max())
    if scale == 0.0:
        return
    support = sp.block_diag([body.support for body in bodies])
    contact = sp.vstack([body.contact_wrenches(torn) for body in bodies])
    ray = _infeasibility_ray(support, contact, -loads.ravel() / scale, torn)
    if ray is not None:
        raise InfeasibleError(_describe(ray.reshape(-1, 6), bodies))


class _RigidBody:
    """A body seen as rigid: its six modes, and the wrenches of supports, contacts and loads on it."""

    def __init__(self, torn: TornSystem, index: int) -> None:
        tearing = torn.decomposition.tearing
        self.name = tearing.body_names[index]
        self._nodes = slice(int(tearing.node_offset[index]), int(tearing.node_offset[index + 1]))
        self._modes = rigid_body_modes(torn.scene.bodies[self.name].mesh.points)
        held = self._modes[torn.decomposition.fixed[self._nodes]]
        left, size, _ = np.linalg.svd(held.T @ held)
        resisted = size > RANK_TOLERANCE * size[0]
        #: Wrenches that supports can exert in both directions, shape (6, n), orthonormal columns.
        self.support = left[:, resisted]

    def contact_wrenches(self, torn: TornSystem) -> sp.csr_matrix:
        """Wrenches of unit normal and tangential multipliers, shape (6, n_contact + 2 n_friction)."""
        points = torn.points
        nodes = np.column_stack([points.slave, points.master])
        weights = np.column_stack([np.ones(points.count), -points.weight])
        here = (nodes >= self._nodes.start) & (nodes < self._nodes.stop)
        inside = np.where(here, nodes - self._nodes.start, 0)
        arms = np.einsum("nk,nkdm->ndm", weights * here, self._modes[inside])
        # The contact force on the slave is n λ_N − t τ; the master feels the opposite (negative weights).
        normal = np.einsum("nd,ndm->mn", points.normal, arms)
        slip = -np.einsum("nad,ndm->mna", points.tangents[torn.frictional], arms[torn.frictional])
        return sp.csr_matrix(np.hstack([normal, slip.reshape(6, -1)]))

    def load_wrench(self, torn: TornSystem) -> np.ndarray:
        """Wrench of the loads on this rank's part of the body, shape (6,)."""
        wrench = np.zeros(6)
        for subdomain in torn.subdomains:
            if subdomain.mesh.body == self.name:
                wrench += subdomain.load @ self._modes[subdomain.mesh.nodes].reshape(-1, 6)
        return wrench


def _infeasibility_ray(
    support: sp.spmatrix, contact: sp.spmatrix, right: np.ndarray, torn: TornSystem
) -> np.ndarray | None:
    """Find the shortest x = (reactions, λ_N, τ) in its cones with [support contact] x = right.

    Returns:
        None if there is one, else the rigid motion that certifies that there is none.
    """
    balance = sp.hstack([support, contact])
    n_normal, discs = torn.points.count, len(torn.frictional)
    first = support.shape[1]
    coulomb = torn.tresca_bound == 0.0
    # Rows −(Ψ, τ1, τ2) of each disc, with Ψ = μ λ_N or a given bound; b − A x must lie in the cone.
    disc = 3 * np.arange(discs)
    tau = first + n_normal + np.arange(2 * discs).reshape(-1, 2)
    rows = np.concatenate([disc[coulomb], disc + 1, disc + 2])
    columns = np.concatenate([first + torn.frictional[coulomb], tau[:, 0], tau[:, 1]])
    values = np.concatenate([-torn.friction_coefficient[coulomb], -np.ones(2 * discs)])
    cone = sp.csr_matrix((values, (rows, columns)), shape=(3 * discs, balance.shape[1]))
    bound = np.zeros((discs, 3))
    bound[:, 0] = torn.tresca_bound
    press = -sp.identity(balance.shape[1], format="csr")[first : first + n_normal]
    cones = [clarabel.ZeroConeT(len(right)), clarabel.NonnegativeConeT(n_normal)]
    cones += [clarabel.SecondOrderConeT(3)] * discs
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    solution = clarabel.DefaultSolver(
        sp.identity(balance.shape[1], format="csc"),
        np.zeros(balance.shape[1]),
        sp.vstack([balance, press, cone], format="csc"),
        np.concatenate([right, np.zeros(n_normal), bound.ravel()]),
        cones,
        settings,
    ).solve()
    status = clarabel.SolverStatus
    if solution.status in (status.PrimalInfeasible, status.AlmostPrimalInfeasible):
        return np.array(solution.z[: len(right)])
    if solution.status not in (status.Solved, status.AlmostSolved):
        raise ConvergenceError(
            "the check whether every body is held needs an answer, the conic solver ended with "
            f"{solution.status}: look at the scale of loads and lengths"
        )
    return None


def _describe(motion: np.ndarray, bodies: list[_RigidBody]) -> str:
    worst = int(np.argmax(np.linalg.norm(motion, axis=1)))
    # The certificate points against the right side, which is minus the load.
    free = np.round(motion[worst] / np.abs(motion[worst]).max(), 3) + 0.0  # no -0
    parts = [("translation", free[:3]), ("rotation", free[3:])]
    words = " with ".join(
        f"{kind} ({part[0]:.2g}, {part[1]:.2g}, {part[2]:.2g})" for kind, part in parts if np.any(part)
    )
    return (
        f"every body must be held by supports, contact or friction, but body {bodies[worst].name!r} can move "
        f"away under the load: {words} meets no resistance. Support it, let it touch something in the "
        "direction of the load, or raise the friction coefficient"
    )

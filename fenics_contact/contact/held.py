"""Is every body held? A conic feasibility problem on rigid motions, before anything is factored."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fenics_contact.errors import ConvergenceError, InfeasibleError, together
from fenics_contact.feti import ContactPoints, TornSystem
from fenics_contact.feti.dual import BALANCED
from fenics_contact.scene import rigid_body_modes
from fenics_contact.scene.held import resisted_motions


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
        floating = [index for index, body in enumerate(bodies) if not body.held]
        if comm.rank == 0 and floating:
            _check_balance(torn, [bodies[index] for index in floating], loads[floating])


def _check_balance(torn: TornSystem, bodies: list[_RigidBody], loads: np.ndarray) -> None:
    scale = float(np.abs(loads).max())
    if scale == 0.0:
        return
    support = sp.block_diag([body.support for body in bodies])
    tied = sp.vstack([body.tie_wrenches(torn) for body in bodies])
    contact = sp.vstack([body.contact_wrenches(torn) for body in bodies])
    ray = _infeasibility_ray(sp.hstack([support, tied]), contact, -loads.ravel() / scale, torn)
    if ray is not None:
        raise InfeasibleError(_describe(ray.reshape(len(bodies), -1), bodies, torn.dim))


class _RigidBody:
    """A body seen as rigid: its modes, and the wrenches of supports, ties, contacts and loads on it."""

    def __init__(self, torn: TornSystem, index: int) -> None:
        tearing = torn.decomposition.tearing
        self.name = tearing.body_names[index]
        self._nodes = slice(int(tearing.node_offset[index]), int(tearing.node_offset[index + 1]))
        self._modes = rigid_body_modes(torn.scene.bodies[self.name].mesh.points)
        #: Wrenches that supports can exert in both directions, shape (n_modes, n), orthonormal columns.
        self.support = resisted_motions(self._modes, torn.decomposition.fixed[self._nodes])

    @property
    def held(self) -> bool:
        """Whether supports alone resist every motion."""
        return self.support.shape[1] == self.support.shape[0]

    def contact_wrenches(self, torn: TornSystem) -> sp.csr_matrix:
        """Wrenches of unit normal and tangential multipliers, (n_modes, n_contact + (dim - 1) n_friction)."""
        points, arms = torn.points, self._arms(torn.points)
        # The contact force on the slave is n λ_N − t τ; the master feels the opposite (negative weights).
        normal = np.einsum("nd,ndm->mn", points.normal, arms)
        slip = -np.einsum("nad,ndm->mna", points.tangents[torn.frictional], arms[torn.frictional])
        return sp.csr_matrix(np.hstack([normal, slip.reshape(len(normal), -1)]))

    def tie_wrenches(self, torn: TornSystem) -> sp.csr_matrix:
        """Wrenches of unit forces at tied points, shape (n_modes, n)."""
        arms = self._arms(torn.ties)
        sliding = np.array([tie.sliding for tie in torn.scene.ties], dtype=bool)[torn.ties.pair]
        bonded = arms[~sliding].reshape(-1, arms.shape[2]).T
        gliding = np.einsum("nd,ndm->mn", torn.ties.normal[sliding], arms[sliding])
        return sp.csr_matrix(np.hstack([bonded, gliding]))

    def load_wrench(self, torn: TornSystem) -> np.ndarray:
        """Wrench of the loads on this rank's part of the body, shape (n_modes,)."""
        count = self._modes.shape[2]
        wrench = np.zeros(count)
        for subdomain in torn.subdomains:
            if subdomain.mesh.body == self.name:
                wrench += subdomain.load @ self._modes[subdomain.mesh.nodes].reshape(-1, count)
        return wrench

    def _arms(self, points: ContactPoints) -> np.ndarray:
        """Return the jump at each point when the body alone moves, shape (n, dim, n_modes)."""
        jump = points.jump[:, self._nodes]
        moved = jump @ self._modes.reshape(self._modes.shape[0], -1)
        return np.asarray(moved).reshape(points.count, *self._modes.shape[1:])


def _infeasibility_ray(
    support: sp.spmatrix, contact: sp.spmatrix, right: np.ndarray, torn: TornSystem
) -> np.ndarray | None:
    """Find the shortest x = (reactions, λ_N, τ) in its cones with [support contact] x = right.

    Returns:
        None if there is one, else the rigid motion that certifies that there is none.
    """
    import clarabel  # not before some loaded body floats

    balance = sp.hstack([support, contact])
    n_normal, discs = torn.points.count, len(torn.frictional)
    first = support.shape[1]
    coulomb = torn.tresca_bound == 0.0
    # Rows −(Ψ, τ) of each disc, with Ψ = μ λ_N or a given bound; b − A x must lie in the cone.
    width = torn.dim
    disc = width * np.arange(discs)
    tau = first + n_normal + np.arange((width - 1) * discs).reshape(-1, width - 1)
    rows = np.concatenate([disc[coulomb], (disc[:, None] + 1 + np.arange(width - 1)).ravel()])
    columns = np.concatenate([first + torn.frictional[coulomb], tau.ravel()])
    values = np.concatenate([-torn.friction_coefficient[coulomb], -np.ones(tau.size)])
    cone = sp.csr_matrix((values, (rows, columns)), shape=(width * discs, balance.shape[1]))
    bound = np.zeros((discs, width))
    bound[:, 0] = torn.tresca_bound
    press = -sp.identity(balance.shape[1], format="csr")[first : first + n_normal]
    cones = [clarabel.ZeroConeT(len(right)), clarabel.NonnegativeConeT(n_normal)]
    cones += [clarabel.SecondOrderConeT(width)] * discs
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


def _describe(motion: np.ndarray, bodies: list[_RigidBody], dim: int) -> str:
    worst = int(np.argmax(np.linalg.norm(motion, axis=1)))
    # The certificate points against the right side, which is minus the load.
    free = np.round(motion[worst] / np.abs(motion[worst]).max(), 3) + 0.0  # no -0
    parts = [("translation", free[:dim]), ("rotation", free[dim:])]
    words = " with ".join(
        f"{kind} ({', '.join(f'{component:.2g}' for component in part)})"
        for kind, part in parts
        if np.any(part)
    )
    return (
        f"every body must be held by supports, contact or friction, but body {bodies[worst].name!r} can move "
        f"away under the load: {words} meets no resistance. Support it, let it touch something in the "
        "direction of the load, or raise the friction coefficient"
    )

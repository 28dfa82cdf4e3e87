"""What must hold of every answer, recomputed on whole bodies from displacements and contact forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact import Scene
from fenics_contact._scene.plan import resisted_motions
from fenics_contact.feti import TornSystem, build_torn_system, decompose
from fenics_contact.feti.decomposition import prescribed_displacements
from fenics_contact.materials import rigid_body_modes
from fenics_contact.results.deformed_state import AnyState
from tests.equilibrium.checks import residuals


class Whole:
    """A scene whose bodies are not torn: one stiffness matrix, one load, the contact points.

    Attributes:
        torn: The system in which every body is one subdomain.
        K: Stiffness of all bodies, dof dim n + d for component d of node n, [force / length].
        load: Shape (n_nodes, dim), [force].
        fixed: Whether a component is prescribed, shape (n_nodes, dim).
        gap: Of the contact points at the start, (n_contact,), [length].
    """

    def __init__(self, scene: Scene) -> None:
        one = {name: np.zeros(body.mesh.n_cells, dtype=np.int64) for name, body in scene.bodies.items()}
        decomposition = decompose(scene, one, MPI.COMM_SELF)
        self.torn: TornSystem = build_torn_system(scene, decomposition, overlap=True)
        tearing, dim = decomposition.tearing, self.torn.components
        size = dim * tearing.n_nodes
        self.K = sp.csr_matrix((size, size))
        force = np.zeros(size)
        for subdomain in self.torn.subdomains:
            nodes = tearing.global_nodes(subdomain.mesh.body, subdomain.mesh.nodes)
            dofs = (dim * nodes[:, None] + np.arange(dim)).ravel()
            place = sp.csr_matrix((np.ones(len(dofs)), (dofs, np.arange(len(dofs)))), shape=(size, len(dofs)))
            self.K = self.K + place @ subdomain.stiffness @ place.T
            force[dofs] += subdomain.load
        self.load = force.reshape(-1, dim)
        self.fixed = decomposition.fixed
        prescribed = prescribed_displacements(scene, tearing)
        self.gap = self.torn.groups.normal.gap(prescribed)

    def nodes(self, body: str) -> slice:
        """Return which nodes are a body's."""
        tearing = self.torn.decomposition.tearing
        index = tearing.body_names.index(body)
        return slice(int(tearing.node_offset[index]), int(tearing.node_offset[index + 1]))


@dataclass(frozen=True)
class Violations:
    """How far an answer is from what must hold; all relative, see the page's introduction."""

    natural: float
    gluing: float
    balance: float
    nodal: float
    cone: float
    penetration: float
    complementarity: float
    friction: float
    reaction: float
    imbalance: float

    @property
    def law(self) -> float:
        """The worst violation of the contact and friction law."""
        return max(self.penetration, self.complementarity, self.friction)


def assert_holds(found: Violations, tolerance: float, amplification: float) -> None:
    """Require every violation to be as small as the tolerance lets it be."""
    assert found.natural <= 1.01 * tolerance, found
    assert found.cone <= tolerance, found
    assert found.gluing <= 10 * tolerance, found
    assert found.balance <= 10 * tolerance, found
    # Rounding of sums, in which stiff parts beside soft ones weigh as much more as in the nodes' balance.
    assert found.imbalance <= max(1e-12, 1e-15 * amplification), found
    nodal = found.nodal, found.reaction
    for value in (*nodal, found.penetration, found.complementarity, found.friction):
        assert value <= amplification * tolerance, found


def violations(state: AnyState, force_scale: float = 0.0) -> Violations:
    """Recompute everything. On one rank.

    Args:
        state: The answer.
        force_scale: The smallest force that contact forces are compared with, [force].
    """
    scene, whole = state.scene, Whole(state.scene)
    found = residuals(state)
    u = np.concatenate([state.gather_displacement(name) for name in scene.bodies])
    contact, points = state.contact, whole.torn.points
    assert np.array_equal(points.slave, state.torn.points.slave)
    on_nodes = points.jump.T @ contact.force
    applied = whole.load + on_nodes
    internal = (whole.K @ u.ravel()).reshape(u.shape)
    cancelling = (abs(whole.K) @ np.abs(u).ravel()).reshape(u.shape) + np.abs(whole.load)
    open_dofs = ~whole.fixed
    scale = cancelling[open_dofs].max(initial=0.0)
    nodal = np.abs((internal - applied)[open_dofs]).max(initial=0.0) / (scale or 1.0)

    jump = points.jump @ u
    gap = whole.gap + np.einsum("nd,nd->n", jump, points.normal)
    slip = np.einsum("nad,nd->na", points.tangents, jump) - contact.slip_before
    normal, tau, bound = _forces(state)
    size, length = max(_size(state), force_scale), _length(u, whole.gap)
    speed, friction = np.linalg.norm(slip, axis=1), np.linalg.norm(tau, axis=1)
    # τ acts on the master, along the slip: zero where a point sticks, or friction is all it can be.
    unopposed = (bound * speed - (tau * slip).sum(axis=1)).max(initial=0.0)
    return Violations(
        natural=found["natural"] * (np.linalg.norm(normal) or 1.0) / max(float(np.linalg.norm(normal)), size),
        gluing=found["gluing"],
        balance=max((_balance(whole, name, applied, on_nodes) for name in scene.bodies), default=0.0),
        nodal=float(nodal),
        cone=max(-normal.min(initial=0.0), (friction - bound).max(initial=0.0)) / size,
        penetration=max(0.0, -gap.min(initial=0.0)) / length,
        complementarity=np.abs(normal * gap).max(initial=0.0) / (size * length),
        friction=max(0.0, unopposed) / (size * length),
        reaction=_reaction(state, whole, internal - applied, float(cancelling.max(initial=0.0))),
        imbalance=state.balance().imbalance,
    )


def _reaction(state: AnyState, whole: Whole, lacking: np.ndarray, scale: float) -> float:
    """Return how far the reactions at nodes are from what is lacking there, relative to a force."""
    held = np.where(whole.fixed, lacking, 0.0)
    return float(np.abs(state._nodal_forces.reaction - held).max(initial=0.0)) / (scale or 1.0)


def _forces(state: AnyState) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return normal forces, friction forces and their bounds from the scene's data, point by point."""
    torn, contact = state.torn, state.contact
    bound = np.zeros(torn.points.count)
    press = np.maximum(contact.normal_force[torn.frictional], 0.0)
    bound[torn.frictional] = torn.groups.slips.tresca_bound + torn.groups.slips.coefficient * press
    return contact.normal_force, contact.friction_force, bound


def _size(state: AnyState) -> float:
    """Return the largest normal force, at least a part of 1e-10 of all forces: less than that is none.

    No force closes a gap between two supports.
    """
    problem, multiplier = state.system.problem, state.solution.multiplier
    contact = problem.layout.contact[~problem.between_supports[problem.layout.contact]]
    closing = (problem.rhs / problem.diagonal)[contact]
    least = 1e-10 * max(float(np.linalg.norm(multiplier)), float(np.linalg.norm(closing)))
    return max(float(np.abs(state.contact.normal_force).max(initial=0.0)), least) or 1.0


def _length(u: np.ndarray, gap: np.ndarray) -> float:
    return float(max(np.abs(u).max(), np.abs(gap).max(initial=0.0))) or 1.0


def _balance(whole: Whole, body: str, applied: np.ndarray, on_nodes: np.ndarray) -> float:
    """Return the wrench of all forces along motions that supports leave free, relative to its parts."""
    own = whole.nodes(body)
    ties = whole.torn.ties
    if ties.count and np.any(ties.jump[:, own].nnz):
        return 0.0  # tie forces are no part of the answer
    modes = rigid_body_modes(whole.torn.scene.bodies[body].mesh.points)
    resisted = resisted_motions(modes[whole.fixed[own]])
    wrench = np.einsum("ndm,nd->m", modes, applied[own])
    forces = np.abs(whole.load[own]) + np.abs(on_nodes[own])
    parts = np.abs(modes).transpose(2, 0, 1).reshape(modes.shape[2], -1) @ forces.ravel()
    free = wrench - resisted @ (resisted.T @ wrench)
    return float(np.abs(free).max() / (parts.max() or 1.0))

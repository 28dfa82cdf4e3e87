"""Whether every body is held, by conic feasibility on rigid motions before any factorisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product, zip_longest
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from fenics_contact._base.sparse import ROUNDING
from fenics_contact._pairing.points import ContactPoints
from fenics_contact._scene.body import Body
from fenics_contact._scene.foundations import ElasticFoundation
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._scene.plan import MOTION_ROUNDING, held_components, point_loads, resisted_motions
from fenics_contact.errors import ConvergenceError, InfeasibleError, together
from fenics_contact.errors.ranks import on_root_then_bcast
from fenics_contact.feti.factor import fixing_nodes
from fenics_contact.feti.foundations import foundation_stiffness, separated
from fenics_contact.feti.row_groups import Joint
from fenics_contact.feti.subdomain import kernel_of_body
from fenics_contact.feti.torn import TornSystem
from fenics_contact.mesh.cuts import parts_of
from fenics_contact.results.rigid_motions import UnheldMotion, motion_in_words

#: A load that needs all but this fraction of the friction is at the limit: how far the body slides would be
#: decided by rounding.
MARGIN = 1e-6
#: Loads count as balanced when less than this fraction of them remains; the conic solver is run to a
#: hundredth.
LEFT = 1e-8


def check_held(torn: TornSystem) -> None:
    """Reject a scene in which some body can move away under the load. Collective.

    Checks whether support reactions, reactions of the material itself (an elastic bed) and admissible contact
    forces (compressive, inside the friction cone or disc) exist that balance the load on every body. If not,
    the dual problem is infeasible: there is a rigid motion along which the load does more work than friction
    takes. If that takes all friction but a fraction `MARGIN`, forces exist, but the amount of sliding along
    that motion is undetermined.
    """
    comm = torn.numbering.comm
    with together(comm):
        bodies = rigid_bodies(torn, torn.scene.foundations)
    loads = comm.allreduce(np.array([body.load_wrench(torn) for body in bodies]))
    loads[np.abs(loads) <= ROUNDING * comm.allreduce(np.abs(torn.load).sum())] = 0.0
    with together(comm):
        floating = [index for index, body in enumerate(bodies) if not body.held]
        if comm.rank == 0 and floating:
            _check_balance(torn, [bodies[index] for index in floating], loads[floating])


def _check_balance(
    torn: TornSystem, bodies: list[RigidBody], loads: np.ndarray, largest: float = 1e7
) -> None:
    """Reject loads that nothing balances; `largest`: bounds relative to them that are as if infinite."""
    scale = float(np.abs(loads).max())
    if scale == 0.0:
        return
    support = sp.block_diag([body.support for body in bodies])
    tied = _of_joints(torn, bodies)
    reactions, right = sp.hstack([support, tied]), -loads.ravel() / scale
    contact = sp.vstack([body.contact_wrenches(torn) for body in bodies])
    bound = np.minimum(torn.groups.slips.tresca_bound / scale, largest)
    balance = _Balance(torn, reactions, contact, right, bound)
    left = balance.left(1.0 - MARGIN)
    if left is None:
        return
    without_margin = balance.left(1.0)
    part, left = (1.0, without_margin) if without_margin is not None else (1.0 - MARGIN, left)
    found = _Motion.of(balance, part, left, bodies)
    if found.slides and part == 1.0:
        found = _tipping(balance, bodies) or found
    # The certificate points against the right side, which is minus the load. The pushed body may take others
    # along: it is the one on which the load does most work.
    pushed = int(np.argmax(np.einsum("bm,bm->b", found.bodies, loads)))
    _require_closed(torn, bodies, found)
    words = (
        f"is held only just: the load uses up all friction against {found.words(pushed)}, and how far it "
        "slides is not determined. Support it, or raise the friction coefficient"
        if part < 1.0
        else f"can move away under the load: {found.words(pushed)} meets "
        f"{'too little friction' if found.rubs else 'no resistance'}. {found.advice(pushed, torn, bodies)}"
        f"{found.companions(pushed, bodies)}"
    )
    name = bodies[pushed].name
    raise InfeasibleError(
        f"every body must be held by supports, contact or friction, but body {name!r} {words}"
    )


def _tipping(balance: _Balance, bodies: list[RigidBody]) -> _Motion | None:
    """Return the motion that friction without any limit would not stop, None if it would stop all."""
    sticking = balance.sticking(bodies)
    left = sticking.left(1.0)
    return None if left is None else _Motion.of(sticking, 1.0, left, bodies)


def _require_closed(torn: TornSystem, bodies: list[RigidBody], found: _Motion) -> None:
    """Reject forces that draw parts together between which nothing resists."""
    least = MARGIN * np.abs(found.bodies).max()
    for joint in torn.groups.joints:
        along, _ = joint.released(torn.scene)
        if along.shape[1]:
            wrenches = [body.joint_wrenches(joint) @ along for body in bodies]
            moved = sum(wrench.T @ own for wrench, own in zip(wrenches, found.bodies, strict=True))
            joint.require_resisted(torn.scene, np.atleast_1d(moved), least)


def _of_joints(torn: TornSystem, bodies: list[RigidBody]) -> sp.csr_matrix:
    """Return the wrenches of joints on all bodies, but along those forces of theirs that are known."""
    parts = [sp.csr_matrix((sum(body.motions for body in bodies), 0))]
    for joint in torn.groups.joints:
        wrenches = sp.csr_matrix(np.vstack([body.joint_wrenches(joint) for body in bodies]))
        along, _ = joint.released(torn.scene)
        parts.append(wrenches - (wrenches @ along) @ along.T if along.shape[1] else wrenches)
    return sp.hstack(parts, format="csr")


def rigid_bodies(torn: TornSystem, foundations: Sequence[ElasticFoundation]) -> list[RigidBody]:
    """Return the bodies regarded as rigid; sections of preloads separate some into parts."""
    found = []
    for index, body in enumerate(torn.scene.bodies.values()):
        part = parts_of(body.mesh) if body.mesh.cuts else np.zeros(body.mesh.n_nodes, dtype=int)
        marks = (part == number for number in range(part.max() + 1))
        found += [RigidBody(torn, index, mark, foundations) for mark in marks]
    return found


class RigidBody:
    """A body regarded as rigid: its modes, and the wrenches of supports, ties, contacts and loads on it."""

    def __init__(
        self, torn: TornSystem, index: int, part: np.ndarray, foundations: Sequence[ElasticFoundation]
    ) -> None:
        tearing = torn.decomposition.tearing
        self.name = tearing.body_names[index]
        self._nodes = slice(int(tearing.node_offset[index]), int(tearing.node_offset[index + 1]))
        body = torn.scene.bodies[self.name]
        self._mesh, self._part = body.mesh, part
        self._points = body.mesh.points[part]
        self._modes = np.where(part[:, None, None], body.rigid_modes(), 0.0)
        supports = resisted_motions(held_components(torn.scene, self.name, self._modes))
        #: Wrenches that supports and material can exert in both directions, shape (n_modes, n).
        self.support = _both(supports, _resisted_by_material(body, self._modes))
        beds = [each for each in foundations if each.body == self.name]
        if beds:
            motions = self._modes.reshape(-1, self._modes.shape[2])
            held, _ = separated(foundation_stiffness(beds, body), motions)
            self.support = _both(self.support, held)

    @property
    def held(self) -> bool:
        """Whether supports and material alone resist every motion."""
        return self.support.shape[1] == self.support.shape[0]

    def has_part_of(self, surface: str) -> bool:
        """Whether nodes of a surface of its body belong to it, without a name all of them."""
        return not surface or bool(self._part[self._mesh.surfaces[surface]].any())

    def contact_wrenches(self, torn: TornSystem) -> sp.csr_matrix:
        """Wrenches of unit normal and tangential multipliers, (n_modes, n_contact + (dim - 1) n_friction)."""
        points, arms = torn.points, self.arms(torn.points)
        # The contact force on the slave is n λ_N − t τ; the master feels the opposite (negative weights).
        normal = np.einsum("nd,ndm->mn", points.normal, arms)
        slip = -np.einsum("nad,ndm->mna", points.tangents[torn.frictional], arms[torn.frictional])
        return sp.csr_matrix(np.hstack([normal, slip.reshape(len(normal), -1)]))

    def joint_wrenches(self, joint: Joint) -> np.ndarray:
        """Wrenches of unit forces of a joint, shape (n_modes, n)."""
        return joint.wrenches(self._modes, self._nodes)

    @property
    def motions(self) -> int:
        """Number of rigid motions."""
        return int(self._modes.shape[2])

    def load_wrench(self, torn: TornSystem) -> np.ndarray:
        """Wrench of the loads on this rank's part of the body, shape (n_modes,)."""
        count = self._modes.shape[2]
        wrench = np.zeros(count)
        for subdomain in torn.subdomains:
            if subdomain.mesh.body == self.name:
                wrench += subdomain.load @ self._modes[subdomain.mesh.nodes].reshape(-1, count)
        if torn.decomposition.comm.rank == 0:
            wrench += point_loads(torn.scene, self.name, self._modes)
            for joint in torn.groups.joints:
                along, forces = joint.released(torn.scene)
                if len(forces):
                    wrench += self.joint_wrenches(joint) @ (along @ forces)
        return wrench

    def arms(self, points: ContactPoints) -> np.ndarray:
        """Return the jump at each point when the body alone moves, shape (n, dim, n_modes)."""
        return points.relative(self._modes, self._nodes)

    def axis(self, motion: np.ndarray) -> str:
        """Return in words what a motion with a rotation, shape (n_modes,), turns the body about."""
        dim = self._points.shape[1]
        centre = self._points.mean(axis=0)
        size = np.abs(self._points - centre).max()
        turning = np.zeros(3)
        turning[3 - len(motion[dim:]) :] = motion[dim:]
        across = np.cross(turning, np.pad(motion[:dim], (0, 3 - dim)))[:dim]
        at = _in_words(centre + size * across / (turning @ turning), size)
        return at if dim == 2 else f"the axis through {at} along {_in_words(_digits(turning), 1.0)}"


def _resisted_by_material(body: Body, modes: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the rigid motions that cost energy, shape (n_modes, n)."""
    count = modes.shape[2]
    flat = modes.reshape(-1, count)
    kernel = kernel_of_body(body, body.mesh.points, body.materials).reshape(len(flat), -1)
    if kernel.shape[1] == count:
        return np.zeros((count, 0))
    free, _ = np.linalg.qr(np.linalg.lstsq(flat, kernel, rcond=None)[0])
    basis, _, _ = np.linalg.svd(np.identity(count) - free @ free.T)
    return np.asarray(basis[:, : count - kernel.shape[1]])


def _both(supports: np.ndarray, material: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the motions that either resists."""
    if not material.shape[1]:
        return supports
    basis, size, _ = np.linalg.svd(np.hstack([supports, material]), full_matrices=False)
    return np.asarray(basis[:, size > MOTION_ROUNDING])


@dataclass(frozen=True)
class _Left:
    """The direction of what no forces balance, (n_wrenches,), and the forces that come closest, (n,)."""

    motion: np.ndarray
    forces: np.ndarray


@dataclass(frozen=True)
class _Balance:
    """Forces that are to balance a load on rigid bodies.

    `support`: wrenches that act in both directions; `contact`: wrenches of unit contact forces; `right`: the
    wrench to balance.
    """

    torn: TornSystem
    support: sp.spmatrix
    contact: sp.spmatrix
    right: np.ndarray
    tresca_bound: np.ndarray

    def left(self, part: float, speed: np.ndarray | float = 0.0, small: float = 1e-9) -> _Left | None:
        """Minimise ‖[support contact] x − right‖ + Σ μ s λ_N over x = (reactions, λ_N, τ) in its cones.

        The smallest distance, unlike feasibility, is well determined also where forces only just suffice.
        Returns None if the load is balanced, else the direction of what is left. `speed`: sliding speeds s
        for the associated law to be freed of lift-off; `small`: weight of the normal forces relative to the
        unbalanced load: it bounds the forces of bodies that grip each other, and leaves nothing unbalanced
        where forces below its inverse times the load suffice.
        """
        import clarabel  # only needed if some loaded body floats

        torn, right = self.torn, self.right
        forces, admissible, limit, cones = _admissible(self.support.shape[1], torn, (part, self.tresca_bound))
        # Unknowns: x, the distance t and the remainder y; ‖y‖ ≤ t.
        size, left = forces.size, np.arange(len(right))
        cost = small * forces
        cost[self.support.shape[1] + torn.frictional] += part * torn.groups.slips.coefficient * speed
        balance = sp.hstack(
            [self.support, self.contact, sp.csr_matrix((len(left), 1)), sp.identity(len(left))]
        )
        distance = sp.hstack([sp.csr_matrix((1 + len(left), size)), -sp.identity(1 + len(left))])
        admissible = sp.hstack([admissible, sp.csr_matrix((admissible.shape[0], 1 + len(left)))])
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 0.01 * LEFT
        solution = clarabel.DefaultSolver(
            sp.csc_matrix((balance.shape[1],) * 2),
            np.concatenate([cost, [1.0], np.zeros(len(left))]),
            sp.vstack([balance, admissible, distance], format="csc"),
            np.concatenate([right, limit, np.zeros(1 + len(left))]),
            [clarabel.ZeroConeT(len(left)), *cones, clarabel.SecondOrderConeT(1 + len(left))],
            settings,
        ).solve()
        if solution.status not in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved):
            raise ConvergenceError(
                f"the check whether bodies are held ended with {solution.status}: check the scale of lengths"
            )
        if solution.x[size] <= LEFT:
            return None
        return _Left(np.array(solution.z[: len(left)]), np.array(solution.x[:size]))

    def sticking(self, bodies: list[RigidBody]) -> _Balance:
        """Return the balance with tangential forces of any size at all contact points."""
        points = self.torn.points
        turned = [np.einsum("nad,ndm->mna", points.tangents, body.arms(points)) for body in bodies]
        grip = sp.csr_matrix(np.vstack([each.reshape(len(each), -1) for each in turned]))
        return replace(self, support=sp.hstack([self.support, grip]))

    def motion(self, part: float, left: _Left) -> _Left:
        """Return the motion on which bodies set off, and the forces against it.

        The direction v of what is left obeys the associated law, v_N ≥ μ (|v_T| − s), by which what slides
        lifts off where s = 0. Where s = |v_T|, v_N ≥ 0 ⊥ λ_N and what slides stays on: a fixed point in v.

        Reference: V. Acary, F. Cadoux, G. Goeleven, J. Malick, *A formulation of the linear discrete Coulomb
        friction problem via convex optimization*, ZAMM 91 (2011) 155–175.
        """
        torn, before = self.torn, None
        slip = self.contact[:, torn.points.count :]
        for _ in range(50):  # most settle within five times
            if (digits := _digits(left.motion).tolist()) == before:
                break
            velocity = (slip.T @ left.motion).reshape(len(torn.frictional), torn.components - 1)
            before, left = digits, self.left(part, np.linalg.norm(velocity, axis=1)) or left
        return left


@dataclass(frozen=True)
class _Motion:
    """How bodies set off.

    `pressed`: normal forces meanwhile, relative to the load; `slides`: whether more friction would: something
    slides that is pressed.
    """

    bodies: np.ndarray
    pressed: np.ndarray
    rubs: bool
    slides: bool

    @classmethod
    def of(cls, balance: _Balance, part: float, left: _Left, bodies: list[RigidBody]) -> _Motion:
        """Return the motion of what is left of a balance with a part of the friction."""
        left, points = balance.motion(part, left), balance.torn.points
        motion = left.motion.reshape(len(bodies), -1)
        normal, tangential = np.split(left.forces[balance.support.shape[1] :], [points.count])
        lost = tangential @ (balance.contact[:, points.count :].T @ left.motion)
        jump = sum(body.arms(points) @ own for body, own in zip(bodies, motion, strict=True))
        slip = jump - np.einsum("nd,nd->n", jump, points.normal)[:, None] * points.normal
        least = MARGIN * abs(float(balance.right @ left.motion))
        rubs = bool(abs(lost) > least)
        return cls(motion, normal, rubs, rubs or float(normal @ np.linalg.norm(slip, axis=1)) > least)

    def words(self, body: int) -> str:
        """Return the motion of a body in words."""
        return motion_in_words(_digits(self.bodies[body]))

    def companions(self, body: int, bodies: list[RigidBody]) -> str:
        """Return words on other bodies that set off with one, of which some have no support of their own."""
        moving = np.abs(self.bodies).max(axis=1) > MARGIN * np.abs(self.bodies).max()
        others = {each.name for each, moves in zip(bodies, moving, strict=True) if moves} - {
            bodies[body].name
        }
        if not others:
            return ""
        free = {each.name for each in bodies if not each.support.shape[1]}
        names = " and ".join(repr(name) for name in sorted(others & free or others))
        held = "has no support of its own" if others & free else "is not held in this direction either"
        return f". With it goes {names}, which {held}: support that"

    def advice(self, body: int, torn: TornSystem, bodies: list[RigidBody]) -> str:
        """Return what would stop the motion of a body."""
        touch = "let it touch something in the direction of the load"
        if self.slides:
            more = "raise the friction coefficient" if len(torn.frictional) else "give its contact friction"
            return f"Support it, {touch}, or {more}"
        own = np.abs(bodies[body].arms(torn.points)).any(axis=(1, 2)) & (self.pressed > MARGIN)
        if not _digits(self.bodies[body])[torn.components :].any() or not own.any():
            return f"Support it, or {touch}"
        places = " and ".join(torn.scene.contacts[pair].place for pair in np.unique(torn.points.pair[own]))
        axis = bodies[body].axis(self.bodies[body])
        return (
            f"It turns about {axis}, pressed by {places}, and no friction would stop that: support it, let "
            f"that contact reach further, or {touch}"
        )


def _admissible(
    reactions: int, torn: TornSystem, friction: tuple[float, np.ndarray]
) -> tuple[np.ndarray, sp.csr_matrix, np.ndarray, list[Any]]:
    """Return which unknowns are normal forces, and A, b and cones with b − A x in the cones."""
    import clarabel

    part, tresca_bound = friction
    # Surfaces that supports hold apart cannot be pressed together, whatever the supports could carry.
    pressed = ~torn.groups.normal.held(torn.decomposition.fixed)[torn.frictional]
    coefficient = part * pressed * torn.groups.slips.coefficient
    n_normal, discs, width = torn.points.count, len(torn.frictional), torn.components
    size = reactions + n_normal + (width - 1) * discs
    coulomb = torn.groups.slips.tresca_bound == 0.0
    # Rows −(Ψ, τ) of each disc, with Ψ = μ λ_N or a given bound.
    disc = width * np.arange(discs)
    tau = reactions + n_normal + np.arange((width - 1) * discs).reshape(-1, width - 1)
    rows = np.concatenate([disc[coulomb], (disc[:, None] + 1 + np.arange(width - 1)).ravel()])
    columns = np.concatenate([reactions + torn.frictional[coulomb], tau.ravel()])
    values = np.concatenate([-coefficient[coulomb], -np.ones(tau.size)])
    cone = sp.csr_matrix((values, (rows, columns)), shape=(width * discs, size))
    bound = np.zeros((discs, width))
    bound[:, 0] = part * tresca_bound
    normal = np.zeros(size)
    normal[reactions : reactions + n_normal] = 1.0
    press = -sp.identity(size, format="csr")[normal > 0]
    limit = np.concatenate([np.zeros(n_normal), bound.ravel()])
    cones = [clarabel.NonnegativeConeT(n_normal), *[clarabel.SecondOrderConeT(width)] * discs]
    return normal, sp.vstack([press, cone], format="csr"), limit, cones


def _digits(motion: np.ndarray) -> np.ndarray:
    """Return what words say of a motion, relative to its largest part."""
    return np.round(motion / np.abs(motion).max(), 3) + 0.0  # no -0


def _in_words(place: np.ndarray, size: float) -> str:
    """Return coordinates to a thousandth of a size."""
    rounded = np.round(place / size, 3) * size + 0.0
    return f"({', '.join(f'{x:.3g}' for x in rounded)})"


#: Wrenches that are reduced at a time.
CHUNK = 4096


def unresisted_motions(
    torn: TornSystem, foundations: Sequence[ElasticFoundation]
) -> tuple[UnheldMotion, ...]:
    """Return the rigid motions that no support, tie, contact or material resists at rest. Collective.

    Contact counts wherever its surfaces face each other, also across a gap, and in both directions. Surfaces
    with friction and obstacles that move may meet anywhere later: they count against all motions.
    """
    return on_root_then_bcast(torn.numbering.comm, lambda: _unresisted(torn, foundations))


def require_resisted(motions: tuple[UnheldMotion, ...], torn: TornSystem, prescribed: np.ndarray) -> None:
    """Reject scenes in which a body that nothing resists is loaded or moved. Collective.

    Stress would drive it, if only by rounding. Bodies at which nothing happens may stay until they are met.
    """
    if not motions:
        return
    tearing = torn.decomposition.tearing
    acted = np.zeros(len(tearing.body_names))
    for part in torn.subdomains:
        acted[tearing.body_names.index(part.mesh.body)] += np.abs(part.load).sum()
    acted = torn.numbering.comm.allreduce(acted)
    moved = np.nan_to_num(prescribed)
    busy = {
        name
        for number, name in enumerate(tearing.body_names)
        if acted[number] or moved[tearing.node_offset[number] : tearing.node_offset[number + 1]].any()
    }
    driven = [motion for motion in motions if busy & set(motion.bodies)]
    if driven:
        raise InfeasibleError(unresisted_in_words(driven))


def unresisted_in_words(motions: list[UnheldMotion] | tuple[UnheldMotion, ...]) -> str:
    """Return the message of an error that names motions and says what to do."""
    each = ", and ".join(f"body {motion}" for motion in motions)
    return (
        "every motion of every body must be resisted where materials are nonlinear, also if no load drives "
        f"it, but nothing resists {each}: support it there (a symmetric part on its plane of symmetry), or "
        "give its contacts friction"
    )


def _unresisted(torn: TornSystem, foundations: Sequence[ElasticFoundation]) -> tuple[UnheldMotion, ...]:
    bodies = rigid_bodies(torn, foundations)
    if all(body.held for body in bodies):
        return ()
    supports = sp.block_diag([body.support for body in bodies])
    ties = _of_joints(torn, bodies)
    wrenches = sp.hstack([supports, ties, *_of_contact(torn, bodies)], format="csc")
    basis, resistance = np.zeros((wrenches.shape[0], 0)), np.zeros(0)
    for start in range(0, wrenches.shape[1], CHUNK):  # each is on two bodies at most, so all are many zeros
        more = wrenches[:, start : start + CHUNK].toarray()
        basis, resistance, _ = np.linalg.svd(np.hstack([basis * resistance, more]), full_matrices=False)
    rank = np.count_nonzero(resistance > MOTION_ROUNDING * resistance.max(initial=0.0))
    rest = scipy.linalg.null_space(basis[:, :rank].T) if rank else np.eye(len(basis))
    return _separate(rest, [body.name for body in bodies])


def _of_contact(torn: TornSystem, bodies: list[RigidBody]) -> list[sp.csc_matrix]:
    """Return the wrenches of the contact of each pair on all bodies, shape (n_wrenches, n) each."""
    normal = sp.vstack([body.contact_wrenches(torn) for body in bodies]).tocsc()
    found = []
    for number, pair in enumerate(torn.scene.contacts):
        if pair.has_friction or pair.moving:
            found += _of_any(torn, pair, bodies)
        else:
            found.append(normal[:, np.flatnonzero(torn.points.pair == number)])
    return found


def _of_any(torn: TornSystem, pair: ContactPair, bodies: list[RigidBody]) -> list[sp.csc_matrix]:
    """Return the wrenches of any forces between all parts of bodies that have a part of a pair's surfaces."""
    slave = torn.scene.bodies[pair.slave.body]
    at = slave.mesh.points[fixing_nodes(slave.mesh.points)]
    size = slave.rigid_modes(at).shape[2]
    length = len(at) * slave.components
    sides = [
        [number for number, body in enumerate(bodies) if body.name == name and body.has_part_of(side)]
        for name, side in zip_longest(pair.bodies, (each.name for each in pair.surfaces), fillvalue="")
    ]
    found = []
    for meeting in product(*sides):
        result = np.zeros((len(bodies), size, length))
        for number, sign in zip(meeting, (1.0, -1.0), strict=False):
            modes = torn.scene.bodies[bodies[number].name].rigid_modes(at)
            result[number] += sign * modes.reshape(length, size).T
        found.append(sp.csc_matrix(result.reshape(-1, length)))
    return found


def _separate(motions: np.ndarray, names: list[str]) -> tuple[UnheldMotion, ...]:
    """Return motions, as columns, each in terms of its own mode, so that most are of one body."""
    count = motions.shape[1]
    if count == 0:
        return ()
    order = scipy.linalg.qr(motions.T, mode="r", pivoting=True)[-1]
    motions = motions @ np.linalg.inv(motions[order[:count]])
    motions = motions / np.abs(motions).max(axis=0)
    motions[np.abs(motions) <= MOTION_ROUNDING] = 0.0
    parts = motions.T.reshape(count, len(names), -1)
    return tuple(
        UnheldMotion({name: own for name, own in zip(names, part, strict=True) if own.any()})
        for part in parts
    )

"""Is a refusal right? Its reason is looked for once more, by other means."""

from __future__ import annotations

import re
from collections.abc import Callable

import clarabel
import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from scipy.optimize import linprog

from fenics_contact import ContactPair, Coulomb, FrictionTable, Surface, Tresca
from fenics_contact._pairing.points import ContactPoints
from fenics_contact._scene.sectors import AnyTie
from fenics_contact.errors import FenicsContactError, InfeasibleError, InvalidInputError
from fenics_contact.feti import TornSystem, build_torn_system, decompose
from fenics_contact.feti.torn import with_points
from tools.random_scenes.generator import Sample
from tools.random_scenes.kinematics import Side, above, own_distance
from tools.random_scenes.verifier import loose, moving
from tools.random_scenes.whole import Whole, on_axis, rigid_motions

#: Corners of the polygon that stands for the disc of friction, inside of it.
CORNERS = 16
#: A load is balanced when less than this part of it is left.
LEFT = 1e-7
#: Part of the friction that may be used: at its limit how far a body slides is not determined.
FRICTION = 0.99
#: Friction may press surfaces together itself: this part of the times that a refusal names is tried.
WEDGED = 0.9


def unjust(error: FenicsContactError, made: Sample) -> str:
    """Say why a scene should not have been refused, nothing if the reason holds."""
    if isinstance(error, InfeasibleError) and "all contacts stay open" in str(error):
        return _some_contact_closes(made)
    if isinstance(error, InfeasibleError) and "friction needs surfaces that are pressed" in str(error):
        return _pressed_enough(made, str(error))
    if isinstance(error, InfeasibleError) and "friction carries only" in str(error):
        return _borne_after_all(made)
    if isinstance(error, InfeasibleError):
        return _held_after_all(made)
    assert isinstance(error, InvalidInputError), error
    for pattern, holds in REASONS.items():
        if re.search(pattern, str(error)):
            return "" if holds(made, str(error)) else "the reason of this refusal does not hold"
    return "no reason that is known"


def _contradicting(made: Sample, message: str) -> bool:
    """Two supports prescribe different values for a component of a node."""
    seen: dict[tuple[str, int, int], float] = {}
    for support in made.scene.supports:
        for node in np.unique(made.scene.bodies[support.body].mesh.surfaces[support.surface]):
            for component, value in enumerate(support.value):
                if value is not None:
                    assert not callable(value)
                    if seen.setdefault((support.body, int(node), component), value) != value:
                        return True
    return False


def _off_axis(made: Sample, message: str) -> bool:
    """Some node on the axis of revolution is to move away from it."""
    for support in made.scene.supports:
        mesh = made.scene.bodies[support.body].mesh
        nodes = np.unique(mesh.surfaces[support.surface])
        if made.scene.axisymmetric and support.value[0] and on_axis(mesh.points)[nodes].any():
            return True
    return False


def _named_pair(made: Sample, message: str) -> ContactPair | AnyTie:
    found = re.match(r"(ContactPair|Tie) (\d+)", message)
    assert found, message
    return (made.scene.contacts if found[1] == "ContactPair" else made.scene.ties)[int(found[2])]


def _meets_nothing(made: Sample, message: str) -> bool:
    """No movable node of the slave faces the master."""
    pair, whole = _named_pair(made, message), Whole(made.scene)
    side = Side.of(whole, pair.slave)
    nodes = np.unique(side.facets)
    movable = nodes[whole.free[nodes].any(axis=1)]
    if isinstance(pair.master, Surface):
        master = Side.of(whole, pair.master)
        return not (side.flat and master.flat) or len(above(whole, movable, side, master)) == 0
    normals = own_distance(pair.master, whole.points[movable])[1]
    return bool(np.all(np.einsum("nd,nd->n", side.mean[movable], normals) > -1e-6))


def _overlapping(made: Sample, message: str) -> bool:
    """Some node of a slave lies inside the master."""
    whole = Whole(made.scene)
    for pair in made.scene.contacts:
        side = Side.of(whole, pair.slave)
        nodes = np.unique(side.facets)
        if not isinstance(pair.master, Surface):
            if own_distance(pair.master, whole.points[nodes])[0].min() < 0:
                return True
            continue
        master = Side.of(whole, pair.master)
        if not master.flat:
            return True  # round ones are looked at by nobody
        height = (whole.points[nodes] - whole.points[master.facets[0, 0]]) @ master.normals[0]
        if height.min() < 0:
            return True
    return False


def _pressed_by_supports(made: Sample, message: str) -> bool:
    """Some node of a slave is prescribed, and not at rest."""
    whole = Whole(made.scene)
    return bool(np.nanmax(np.abs(whole.prescribed)) > 0.0)


#: What a message says -> whether it is so.
REASONS: dict[str, Callable[[Sample, str], bool]] = {
    "supports must agree where they meet": _contradicting,
    "radial displacement is zero on the axis": _off_axis,
    "needs slave nodes that face the master": _meets_nothing,
    "bodies must not overlap at the start": _overlapping,
    "supports must leave room between surfaces": _pressed_by_supports,
}


def _some_contact_closes(made: Sample) -> str:
    """Bend the bodies by what supports can balance of their loads, without contact, and look at the gaps."""
    scene, whole = made.scene, Whole(made.scene)
    u = np.nan_to_num(whole.prescribed).ravel()
    force = whole.load.ravel() - whole.K @ u
    for name in scene.bodies:
        nodes = whole.nodes(name)
        free = whole.free[nodes].ravel()
        dofs = np.arange(whole.components * nodes.start, whole.components * nodes.stop)[free]
        Q, K = loose(rigid_motions(scene, name), free), whole.K[dofs][:, dofs].toarray()
        balanced = force[dofs] - Q @ (Q.T @ force[dofs])
        u[dofs] += np.linalg.solve(K + np.abs(np.diag(K)).max() * Q @ Q.T, balanced)
    points = _torn(made).points
    moved = points.jump @ u.reshape(-1, whole.components)
    reach = [0.0 if pair.closure is None else pair.closure.reach for pair in scene.contacts]
    gap = points.gap + np.einsum("nd,nd->n", moved, points.normal) - np.array([*reach, 0.0])[points.pair]
    return f"a contact closes by {-gap.min():.1e}" if gap.min() < -1e-3 * np.abs(moved).max() else ""


def _borne_after_all(made: Sample) -> str:
    """Press the bodies together without friction, and balance the loads by nearly what it then bears."""
    whole, torn = Whole(made.scene), _torn(made)
    left = _left_over(whole, torn, WEDGED * _frictionless(whole, torn), WEDGED)
    return f"{WEDGED:g} times the friction leaves {left:.1e} of the loads" if left <= LEFT else ""


def _pressed_enough(made: Sample, message: str) -> str:
    """Press the bodies together without friction, and balance the loads by many times what it then bears."""
    whole, torn = Whole(made.scene), _torn(made)
    told = re.search(r"even (\d+) times the forces", message)
    assert told, message
    times = WEDGED * float(told[1])
    left = _left_over(whole, torn, times * _frictionless(whole, torn), times)
    return f"{times:g} times the friction leaves {left:.1e} of the loads" if left <= LEFT else ""


def _frictionless(whole: Whole, torn: TornSystem) -> np.ndarray:
    """Return the normal forces without friction, of bodies held in all motions that only friction resists."""
    free, dim = whole.free.ravel(), whole.components
    motions = np.zeros((free.size, 0))
    for name in whole.scene.bodies:
        nodes = whole.nodes(name)
        own = np.arange(dim * nodes.start, dim * nodes.stop)
        own = own[free[own]]
        basis = loose(rigid_motions(whole.scene, name), free[dim * nodes.start : dim * nodes.stop])
        column = np.zeros((free.size, basis.shape[1]))
        column[own] = basis
        motions = np.hstack([motions, column])
    normal = _along(torn.points.jump, -torn.points.normal)
    tied = _tied(torn.ties, whole).T.tocsr()
    _, size, basis = np.linalg.svd(sp.vstack([normal, tied]) @ motions)
    rank = int((size > 1e-8 * size.max(initial=0.0)).sum())
    unheld = motions @ basis[rank:].T
    held = np.nan_to_num(whole.prescribed).ravel()
    force = whole.load.ravel() - whole.K @ held
    force = (force - unheld @ (unheld.T @ force))[free]
    scale = whole.K.diagonal().max()
    K = whole.K[free][:, free] / scale + 1e-9 * sp.csr_matrix(motions[free] @ motions[free].T)
    length = np.abs(force).max() / scale or 1.0
    cones = [clarabel.ZeroConeT(tied.shape[0]), clarabel.NonnegativeConeT(normal.shape[0])]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    # The energy of one body may hide the forces on another.
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-13
    right = np.concatenate([-(tied @ held), torn.points.gap - normal @ held]) / length
    rows = sp.vstack([tied, normal], format="csc")[:, free]
    solver = clarabel.DefaultSolver(
        sp.triu(K, format="csc"), -force / (scale * length), sp.csc_matrix(rows), right, cones, settings
    )
    return np.maximum(np.array(solver.solve().z[tied.shape[0] :]), 0.0) * scale * length


def _torn(made: Sample) -> TornSystem:
    """Return bodies in one piece with the contact points whose gaps supports leave open to change."""
    scene = made.scene
    one = {name: np.zeros(body.mesh.n_cells, dtype=np.int64) for name, body in scene.bodies.items()}
    torn = build_torn_system(scene, decompose(scene, one, MPI.COMM_SELF), overlap=True)
    points = torn.points
    kept = np.flatnonzero(moving(points, Whole(scene)))
    return with_points(torn, points.part(kept))


def _held_after_all(made: Sample) -> str:
    """Balance the loads on rigid bodies by reactions and contact forces, a linear programme."""
    left = _left_over(Whole(made.scene), _torn(made))
    return f"all but {left:.1e} of the loads can be balanced" if left <= LEFT else ""


def _left_over(
    whole: Whole, torn: TornSystem, normal: np.ndarray | None = None, part: float = FRICTION
) -> float:
    """Return the part of the load that nothing balances, with so much of the friction.

    Where normal forces are given, friction is what they let it bear.
    """
    modes = _modes(whole)
    load = modes @ whole.load.ravel()
    size = float((abs(modes) @ np.abs(whole.load).ravel()).max())
    if size == 0.0:
        return 0.0
    held = modes[:, np.flatnonzero(~whole.free.ravel())]
    reactions = sp.hstack([held, modes @ whole.springs @ modes.T])
    tied = modes @ _tied(torn.ties, whole)
    pressed, dragged, bound = _contact(torn.points, list(whole.scene.contacts), normal, part)
    slack = sp.identity(len(load))
    parts = [reactions, -reactions, tied, -tied, modes @ pressed, modes @ dragged, slack, -slack]
    forces = sp.hstack(parts, format="csr")
    cost = np.zeros(forces.shape[1])
    cost[-2 * len(load) :] = 1.0
    # The forces on the corners of a disc, one behind the other, add up to its bound at most.
    sides = dragged.shape[1] // len(bound) if len(bound) else 0
    disc = sp.kron(sp.identity(len(bound)), np.ones((1, sides))) if sides else sp.csr_matrix((0, 0))
    before, behind = sum(part.shape[1] for part in parts[:5]), 2 * len(load)
    limit = sp.hstack([sp.csr_matrix((len(bound), before)), disc, sp.csr_matrix((len(bound), behind))])
    answer = linprog(cost, A_ub=limit, b_ub=bound / size, A_eq=forces, b_eq=-load / size)
    return float(answer.fun) if answer.status == 0 else np.inf


def _modes(whole: Whole) -> sp.csr_matrix:
    """Return the wrench of nodal forces on each body, (modes of all bodies, dofs)."""
    blocks = [rigid_motions(whole.scene, name).T for name in whole.scene.bodies]
    return sp.block_diag(blocks, format="csr")


def _tied(ties: ContactPoints, whole: Whole) -> sp.csr_matrix:
    """Return unit forces on tied points, (dofs, rows), but for what supports hold of the slave."""
    free = np.array([tie.sliding for tie in whole.scene.ties], dtype=bool)[ties.pair]
    bonded = sp.kron(ties.jump[~free], np.eye(whole.components)).tocsr()
    rows = [bonded[whole.free[ties.slave[~free]].ravel()], _along(ties.jump[free], ties.normal[free])]
    return sp.vstack(rows).T.tocsr()


def _along(jump: sp.csr_matrix, direction: np.ndarray) -> sp.csr_matrix:
    """Return rows that put a unit force along a direction on slave and master, (n, dofs)."""
    return sp.vstack(
        [sp.kron(jump[row], direction[row][None]) for row in range(len(direction))]
        or [sp.csr_matrix((0, jump.shape[1] * direction.shape[1]))]
    ).tocsr()


def _least(law: Coulomb) -> float:
    """Return the friction coefficient at any pressure at least."""
    if law.shear_limit is not None:
        return 0.0
    mu = law.friction_coefficient
    return min(mu.coefficient) if isinstance(mu, FrictionTable) else float(mu)  # type: ignore[arg-type]


def _contact(
    points: ContactPoints, pairs: list[ContactPair], normal: np.ndarray | None, part: float
) -> tuple[sp.csr_matrix, sp.csr_matrix, np.ndarray]:
    """Return nodal forces of contact, a column each.

    Returns:
        Those on the normals and on the edges of the cones of Coulomb's friction, those on the corners of
        Tresca's discs, disc by disc, and the bounds of these discs.
    """
    dim = points.normal.shape[1]
    angles = np.linspace(0.0, 2 * np.pi, CORNERS, endpoint=False)
    ways = np.column_stack([np.cos(angles), np.sin(angles)]) if dim == 3 else np.array([[1.0], [-1.0]])
    nothing = _along(points.jump[:0], points.normal[:0])
    pressed, dragged, bounds = [_along(points.jump, points.normal)], [nothing], []
    for index, pair in enumerate(pairs):
        own = np.flatnonzero(points.pair == index)
        drag = np.einsum("wa,nad->nwd", ways, points.tangents[own])
        many = np.repeat(own, len(ways))
        match pair.friction:
            case Coulomb() as law if normal is not None:
                dragged.append(_along(points.jump[many], drag.reshape(-1, dim)))
                bounds.append(_least(law) * normal[own])
            case Coulomb() as law:
                edge = points.normal[own][:, None] + part * _least(law) * drag
                pressed.append(_along(points.jump[many], edge.reshape(-1, dim)))
            case Tresca(traction=traction):
                dragged.append(_along(points.jump[many], drag.reshape(-1, dim)))
                bounds.append(part * traction * points.area[own])
    return sp.vstack(pressed).T.tocsr(), sp.vstack(dragged).T.tocsr(), np.concatenate([np.zeros(0), *bounds])

"""Motions that nothing resists where bodies are at rest: nonlinear scenes with one have no way to begin."""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from fenics_contact.contact.static_admissibility import RigidBody
from fenics_contact.contact.unheld import ROUNDING, UnheldMotion
from fenics_contact.errors import InfeasibleError, together
from fenics_contact.feti import TornSystem, fixing_nodes
from fenics_contact.scene import RANK_TOLERANCE, ContactPair, MovingObstacle, Surface, rigid_body_modes

#: Wrenches that are reduced at a time.
CHUNK = 4096


def unresisted_motions(torn: TornSystem) -> tuple[UnheldMotion, ...]:
    """Return the rigid motions that no support, tie, contact or material resists at rest. Collective.

    Contact counts wherever its surfaces face each other, also across a gap, and in both directions. Surfaces
    with friction and obstacles that move may meet anywhere later: they count against all motions.

    Args:
        torn: The torn system of the undeformed bodies; its matrices are not used.
    """
    comm = torn.numbering.comm
    found: tuple[UnheldMotion, ...] = ()
    with together(comm):
        if comm.rank == 0:
            found = _unresisted(torn)
    return tuple(comm.bcast(found))


def require_resisted(motions: tuple[UnheldMotion, ...], torn: TornSystem, prescribed: np.ndarray) -> None:
    """Reject scenes in which a body that nothing resists is loaded or moved. Collective.

    Stress would drive it, if only by rounding. Bodies at which nothing happens may stay until they are met.

    Args:
        motions: What `unresisted_motions` returned.
        torn: The torn system with its load.
        prescribed: Prescribed components of all nodes, NaN where free, shape (n_nodes, dim), [length].

    Raises:
        InfeasibleError: With the bodies and their motions.
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


def _unresisted(torn: TornSystem) -> tuple[UnheldMotion, ...]:
    bodies = [RigidBody(torn, index) for index in range(len(torn.scene.bodies))]
    if all(body.held for body in bodies):
        return ()
    supports = sp.block_diag([body.support for body in bodies])
    ties = sp.vstack([body.tie_wrenches(torn) for body in bodies])
    wrenches = sp.hstack([supports, ties, *_of_contact(torn, bodies)], format="csc")
    basis, resistance = np.zeros((wrenches.shape[0], 0)), np.zeros(0)
    for start in range(0, wrenches.shape[1], CHUNK):  # each is on two bodies at most, so all are many zeros
        more = wrenches[:, start : start + CHUNK].toarray()
        basis, resistance, _ = np.linalg.svd(np.hstack([basis * resistance, more]), full_matrices=False)
    rank = np.count_nonzero(resistance > RANK_TOLERANCE * resistance.max(initial=0.0))
    rest = scipy.linalg.null_space(basis[:, :rank].T) if rank else np.eye(len(basis))
    return _separate(rest, [body.name for body in bodies])


def _of_contact(torn: TornSystem, bodies: list[RigidBody]) -> list[sp.csc_matrix]:
    """Return the wrenches of the contact of each pair on all bodies, shape (n_wrenches, n) each."""
    names = [body.name for body in bodies]
    normal = sp.vstack([body.contact_wrenches(torn) for body in bodies]).tocsc()
    found = []
    for number, pair in enumerate(torn.scene.contacts):
        if pair.has_friction or isinstance(pair.master, MovingObstacle):
            found.append(_of_any(torn, pair, names))
        else:
            found.append(normal[:, np.flatnonzero(torn.points.pair == number)])
    return found


def _of_any(torn: TornSystem, pair: ContactPair, names: list[str]) -> sp.csc_matrix:
    """Return the wrenches of any forces between the bodies of a pair."""
    mesh = torn.scene.bodies[pair.slave.body].mesh
    at = mesh.points[fixing_nodes(mesh.points)]
    size = rigid_body_modes(at).shape[2]
    result = np.zeros((len(names), size, at.size))
    for side, sign in ((pair.slave, 1.0), (pair.master, -1.0)):
        if isinstance(side, Surface):
            modes = rigid_body_modes(torn.scene.bodies[side.body].mesh.points, at)
            result[names.index(side.body)] += sign * modes.reshape(at.size, size).T
    return sp.csc_matrix(result.reshape(-1, at.size))


def _separate(motions: np.ndarray, names: list[str]) -> tuple[UnheldMotion, ...]:
    """Return motions, as columns, each in terms of its own mode, so that most are of one body."""
    count = motions.shape[1]
    if count == 0:
        return ()
    order = scipy.linalg.qr(motions.T, mode="r", pivoting=True)[-1]
    motions = motions @ np.linalg.inv(motions[order[:count]])
    motions = motions / np.abs(motions).max(axis=0)
    motions[np.abs(motions) <= ROUNDING] = 0.0
    parts = motions.T.reshape(count, len(names), -1)
    return tuple(
        UnheldMotion({name: own for name, own in zip(names, part, strict=True) if own.any()})
        for part in parts
    )

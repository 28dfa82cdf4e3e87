"""The forces on the nodes of all bodies by what exerts them: loads, supports, contact, ties, beds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.feti import TornSystem, nodal_sum
from fenics_contact.pairing import ContactPoints


@dataclass(frozen=True, eq=False)
class NodalForces:
    """Forces on nodes; all replicated, [force].

    The multipliers act on the torn bodies as f − Bᵀλ = K u. Summed over the copies of a node, gluing cancels,
    and −Bᵀλ is the reaction, where a component is prescribed, less what contacts and ties exert there (their
    rows of B leave prescribed components out).

    Attributes:
        places: Where the nodes of all bodies are for moments: undeformed, on bodies that deform much
            deformed, shape (n_nodes, dim), [length].
        load: f, shape (n_nodes, dim); thermal strain included, which has no resultant.
        reaction: Of supports, zero on free components, shape (n_nodes, dim).
        contact: On the slave at each contact point, shape (n_contact, dim).
        tie: On the slave at each tied point, shape (n_ties, dim).
        bed: What materials exert that resist rigid motions (elastic beds), shape (n_nodes, dim).
    """

    places: np.ndarray
    load: np.ndarray
    reaction: np.ndarray
    contact: np.ndarray
    tie: np.ndarray
    bed: np.ndarray


def nodal_forces(
    torn: TornSystem, multiplier: np.ndarray, displacement: np.ndarray
) -> NodalForces:
    """Return the forces on all nodes. Collective.

    Args:
        torn: The torn system.
        multiplier: λ, owned, [force].
        displacement: Torn displacement of this rank as the solver returned it, shape (torn_size,), [length].
    """
    decomposition = torn.decomposition
    contact, tie = _contact_forces(torn, multiplier), _tie_forces(torn, multiplier)
    joined = torn.points.jump.T @ contact + torn.ties.jump.T @ tie
    connecting = -nodal_sum(decomposition, torn.force(multiplier))
    return NodalForces(
        torn.scene.points,
        nodal_sum(decomposition, torn.load),
        np.where(decomposition.fixed, connecting - joined, 0.0),
        contact,
        tie,
        nodal_sum(decomposition, -_resisted(torn, displacement)),
    )


def _contact_forces(torn: TornSystem, multiplier: np.ndarray) -> np.ndarray:
    """Return the forces on the slave nodes of contacts, shape (n_contact, dim), [force]. Collective.

    They balance the others, also where a solver that ends at its tolerance leaves a pull.
    """
    points, frictional = torn.points, torn.frictional
    rows = np.concatenate([torn.normal_rows, torn.tangential_rows.ravel()])
    normal, friction = np.split(torn.numbering.gather(multiplier, rows), [points.count])
    force = normal[:, None] * points.normal
    tangential = friction.reshape(-1, torn.dim - 1)
    force[frictional] -= np.einsum("na,nad->nd", tangential, points.tangents[frictional])
    return force


def _tie_forces(torn: TornSystem, multiplier: np.ndarray) -> np.ndarray:
    """Return the forces on the slave nodes of ties, shape (n_ties, dim), replicated, [force]. Collective."""
    rows = torn.relations[0]
    of_ties = torn.numbering.gather(multiplier, np.arange(torn.n_gluing, torn.n_equality))
    # A row that supports determine is not in B.
    acting = np.where(rows.held(torn.decomposition.fixed), 0.0, of_ties)
    force = np.zeros((torn.ties.count, torn.dim))
    np.add.at(force, rows.which, -acting[:, None] * rows.directions)
    return force


def by_node(points: ContactPoints, force: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return the forces of chosen points on the nodes of slaves and masters, shape (n_nodes, dim).

    Args:
        points: Contact or tied points.
        force: Force on the slave at each of all points, shape (n, dim), [force].
        chosen: Numbers of the points.
    """
    return np.asarray(points.jump[chosen].T @ force[chosen])


def _resisted(torn: TornSystem, displacement: np.ndarray) -> np.ndarray:
    """Return K u of the subdomains whose material resists a rigid motion, zero on others, (torn_size,)."""
    motions = 3 * (torn.dim - 1)
    parts = np.split(displacement, np.cumsum([part.mesh.size for part in torn.subdomains])[:-1])
    return np.concatenate(
        [
            part.stiffness @ u if part.kernel.shape[1] < motions else np.zeros(part.mesh.size)
            for part, u in zip(torn.subdomains, parts, strict=True)
        ]
    )

"""The branch of the contact law on which a state is differentiated."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact.contact import State
from fenics_contact.feti.surface import edge_distance
from fenics_contact.qp import Face, classify, contact_step
from fenics_contact.scene import Surface

#: A contact point is weakly active when it is closer to the switch than this fraction of the force scale.
WEAK_TOLERANCE = 1e-7
#: A projection this close to the edge of its facet, in local coordinates, lies on it.
EDGE_TOLERANCE = 1e-6


class WeakChoice(Enum):
    """Which branch weakly active points take; either gives an element of the limiting coderivative."""

    RELEASED = "weak contacts count as open, weak discs as slipping"
    HELD = "weak contacts count as closed, weak discs as sticking"


@dataclass(frozen=True)
class WeakPoints:
    """How many points lie on a switch of the contact law, over all ranks.

    Attributes:
        contacts: Points with neither force nor gap.
        discs: Friction discs at their bound without slip.
        edges: Closed points that project on an edge between facets; they count as inside the facet found.
        choice: The branch that contacts and discs were given.
    """

    contacts: int
    discs: int
    edges: int
    choice: WeakChoice


@dataclass(frozen=True, eq=False)
class LinearisedFace:
    """Face of a state with the two bases of its linearised contact law.

    Attributes:
        face: Closed, sticking and slipping points.
        tested: Z_s, directions along which the rows are tested, shape (n_owned, n_face).
        moving: Z_u, directions along which the multiplier moves: a slipping friction force grows with its
            normal force by μ d, shape (n_owned, n_face).
        slip_direction: d at the slipping discs, zero elsewhere, shape (n_friction, 2), owned.
        weak: What lay on a switch.
    """

    face: Face
    tested: sp.csr_matrix
    moving: sp.csr_matrix
    slip_direction: np.ndarray
    weak: WeakPoints


def linearise_face(state: State, choice: WeakChoice, *, coupling: bool = True) -> LinearisedFace:
    """Classify the contact points of a state and build both bases. Collective.

    Args:
        state: A converged state.
        choice: Branch for weakly active points.
        coupling: Leave out the growth of friction with the normal force if False; the derivative is then
            that of Tresca friction.
    """
    system, solution = state.dual, state.dual_solution
    layout, comm = system.problem.layout, system.problem.comm
    step = contact_step(layout, system.problem.diagonal)
    trial = solution.multiplier - step * solution.residual
    scale = comm.allreduce(float(np.abs(solution.multiplier[layout.normal]).max(initial=0.0)), op=MPI.MAX)
    slack, bound = WEAK_TOLERANCE * scale, solution.slip_bound
    coefficient = system.torn.friction_coefficient[system.owned_discs()]
    length = np.linalg.norm(trial[layout.tangential], axis=1)
    contact = np.abs(trial[layout.normal]) <= slack
    vanishing = contact[layout.friction_of] & (coefficient > 0)
    disc = (bound > 0) & ~vanishing & (np.abs(length - bound) <= slack)
    counts = comm.allreduce(np.array([np.count_nonzero(contact), np.count_nonzero(disc)]))

    known = classify(layout, bound, solution.multiplier, solution.residual, step)
    direction = _directions(known.direction, trial[layout.tangential], length, disc | vanishing)
    held, at_rest = choice is WeakChoice.HELD, length <= slack
    face = replace(
        known,
        closed=np.where(contact, held, known.closed),
        stick=np.where(vanishing, held & at_rest, np.where(disc, held, known.stick)),
        slip=~vanishing & np.where(disc, not held, known.slip),
        direction=direction,
        overshoot=np.where(disc, 1.0, known.overshoot),
    )
    starting = vanishing & held & ~at_rest
    tested = face.restriction
    moving = tested + _growth(face, starting, coefficient) if coupling else tested
    slip_direction = np.where(face.slip[:, None], direction, 0.0)
    weak = WeakPoints(int(counts[0]), int(counts[1]), _points_on_edges(state), choice)
    return LinearisedFace(face, tested, moving.tocsr(), slip_direction, weak)


def _points_on_edges(state: State) -> int:
    """Count the closed points over an edge of their master facet, where the normal field has a kink."""
    points = state.torn.points
    total = 0
    for index, pair in enumerate(state.scene.contacts):
        if isinstance(pair.master, Surface):
            closed = (points.pair == index) & (state.contact.normal_force > 0)
            corners = state.scene.facets(pair.master).shape[1]
            distance = np.abs(edge_distance(points.local[closed], corners))
            total += int(np.count_nonzero(distance < EDGE_TOLERANCE))
    return total


def _growth(face: Face, starting: np.ndarray, coefficient: np.ndarray) -> sp.csr_matrix:
    """Return how slipping forces grow with their normal forces, and those that start to.

    A Coulomb disc has no radius where its contact is weak. When the contact closes, its force grows along the
    slip: it has a direction and no offset, hence no column of its own; such columns come last.
    """
    return replace(face, slip=face.slip | starting).growth(coefficient)[:, : face.n_face]


def _directions(known: np.ndarray, trial: np.ndarray, length: np.ndarray, weak: np.ndarray) -> np.ndarray:
    found = trial / np.where(length > 0, length, 1.0)[:, None]
    return np.where(weak[:, None], found, known)

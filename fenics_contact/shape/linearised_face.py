"""The branch of the contact law on which a state is differentiated."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact.contact import State
from fenics_contact.qp import Face, classify, contact_step

#: A contact point is weakly active when its distance from the switch is below this fraction of the force scale.
WEAK_TOLERANCE = 1e-7


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
        choice: The branch they were given.
    """

    contacts: int
    discs: int
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
    system, solution = state.system, state.solution
    layout, comm = system.problem.layout, system.problem.comm
    step = contact_step(layout, system.problem.diagonal)
    face = classify(layout, solution.slip_bound, solution.multiplier, solution.residual, step)
    trial = solution.multiplier - step * solution.residual
    scale = comm.allreduce(float(np.abs(solution.multiplier[layout.normal]).max(initial=0.0)), op=MPI.MAX)
    weak_contact = np.abs(trial[layout.normal]) <= WEAK_TOLERANCE * scale
    length = np.linalg.norm(trial[layout.tangential], axis=1)
    bound = solution.slip_bound
    weak_disc = (bound > 0) & (np.abs(length - bound) <= WEAK_TOLERANCE * scale)
    held = choice is WeakChoice.HELD
    closed = np.where(weak_contact, held, face.closed)
    stick = np.where(weak_disc, held, face.stick)
    slip = np.where(weak_disc, not held, face.slip)
    if not held:
        overshoot = np.where(weak_disc, 1.0, face.overshoot)
        direction = _directions(face.direction, trial[layout.tangential], length, weak_disc)
        face = replace(face, overshoot=overshoot, direction=direction)
    face = replace(face, closed=closed, stick=stick, slip=slip)
    counts = comm.allreduce(np.array([np.count_nonzero(weak_contact), np.count_nonzero(weak_disc)]))
    tested = face.restriction
    moving = tested + _friction_growth(state, face) if coupling else tested
    slip_direction = np.where(face.slip[:, None], face.direction, 0.0)
    weak = WeakPoints(int(counts[0]), int(counts[1]), choice)
    return LinearisedFace(face, tested, moving.tocsr(), slip_direction, weak)


def _directions(known: np.ndarray, trial: np.ndarray, length: np.ndarray, weak: np.ndarray) -> np.ndarray:
    found = trial / np.where(length > 0, length, 1.0)[:, None]
    return np.where(weak[:, None], found, known)


def _friction_growth(state: State, face: Face) -> sp.csr_matrix:
    """Entries μ d in the tangential rows of a slipping disc, in the column of its normal multiplier."""
    layout, system = face.layout, state.system
    coefficient = system.torn.friction_coefficient[system.owned_discs()]
    column_of_contact = np.full(layout.n_contact, -1)
    n_equality = len(layout.equality)
    column_of_contact[face.closed] = n_equality + np.arange(np.count_nonzero(face.closed))
    column = column_of_contact[layout.friction_of]
    growing = np.flatnonzero(face.slip & (column >= 0) & (coefficient > 0))
    rows = layout.tangential[growing]
    values = coefficient[growing, None] * face.direction[growing]
    columns = np.broadcast_to(column[growing, None], rows.shape)
    return sp.csr_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape=face.restriction.shape)


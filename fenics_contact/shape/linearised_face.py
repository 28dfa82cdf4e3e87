"""The branch of the contact law on which a state is differentiated."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import scipy.sparse as sp

from fenics_contact.contact import State
from fenics_contact.qp import ContactLayout, DualProblem, DualSolution, Face, classify, contact_step
from fenics_contact.scene import Surface
from fenics_contact.surfaces import edge_distance

#: A contact point is weakly active when it is closer to the switch than this many times the state's residual.
UNCERTAINTY = 3.0
#: What rounding alone leaves of the forces, and of those that would close the gaps.
ROUNDING = 1e-13
#: Weak points further from the switch than this fraction of the forces lean to a side, and are taken there.
LEANING = 1e-5
#: A projection this close to the edge of its facet, in local coordinates, lies on it.
EDGE_TOLERANCE = 1e-6


class WeakChoice(Enum):
    """Which branch weakly active points take, all of them the same.

    Each branch of each point is an element of the limiting coderivative of its contact law, and the adjoint
    of such a choice is what the inclusion for coderivatives of a composition gives. Of a single weak point
    either is a Clarke subgradient. Of several it need not be one: designs nearby may close some points only
    while others open, and no design has all of them open, or all of them closed.
    """

    RELEASED = "weak contacts count as open, weak discs as slipping"
    HELD = "weak contacts count as closed, weak discs as sticking"


@dataclass(frozen=True)
class WeakPoints:
    """How many points lie on a switch of the contact law as far as the state can tell, over all ranks.

    Attributes:
        contacts: Points with neither force nor gap.
        discs: Friction discs at their bound without slip.
        edges: Closed points that project on an edge between facets; they count as inside the facet found.
        choice: The branch that contacts and discs were given. Those of a loose state that are clearly on one
            side, only not beyond doubt, are taken there.
    """

    contacts: int
    discs: int
    edges: int
    choice: WeakChoice

    @property
    def count(self) -> int:
        """All of them."""
        return self.contacts + self.discs + self.edges

    @property
    def doubtful(self) -> bool:
        """Whether the branch of all of them together may be one that no design nearby has.

        Where one weak contact closes, its friction may slip: it alone must not be held.
        """
        return self.count > 1 or (self.contacts > 0 and self.choice is WeakChoice.HELD)


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
    layout, bound = system.problem.layout, solution.slip_bound
    step = contact_step(layout, system.problem.diagonal)
    trial = solution.multiplier - step * solution.residual
    coefficient = system.torn.friction_coefficient[system.owned_discs()]
    length = np.linalg.norm(trial[layout.tangential], axis=1)
    told, closest = _told_apart(system.problem, solution, step)
    counted = _on_switch(layout, trial, bound, coefficient, told)
    weak = _on_switch(layout, trial, bound, coefficient, closest)

    known = classify(layout, bound, solution.multiplier, solution.residual, step)
    direction = _directions(known.direction, trial[layout.tangential], length, weak.disc | weak.vanishing)
    held, at_rest = choice is WeakChoice.HELD, length <= closest[layout.tangential[:, 0]]
    face = replace(
        known,
        closed=np.where(weak.contact, held, known.closed),
        stick=np.where(weak.vanishing, held & at_rest, np.where(weak.disc, held, known.stick)),
        slip=~weak.vanishing & np.where(weak.disc, not held, known.slip),
        direction=direction,
        overshoot=np.where(weak.disc, 1.0, known.overshoot),
    )
    starting = weak.vanishing & held & ~at_rest
    tested = face.restriction
    moving = tested + _growth(face, starting, coefficient) if coupling else tested
    slip_direction = np.where(face.slip[:, None], direction, 0.0)
    contacts, discs = system.problem.comm.allreduce(counted.counts)
    points = WeakPoints(int(contacts), int(discs), _points_on_edges(state), choice)
    return LinearisedFace(face, tested, moving.tocsr(), slip_direction, points)


@dataclass(frozen=True)
class _OnSwitch:
    """Marks of this rank's points that lie on a switch.

    Attributes:
        contact: Neither force nor gap, shape (n_contact,).
        vanishing: Discs whose radius vanishes with the normal force of such a contact, shape (n_friction,).
        disc: Other discs at their bound without slip, shape (n_friction,).
    """

    contact: np.ndarray
    vanishing: np.ndarray
    disc: np.ndarray

    @property
    def counts(self) -> np.ndarray:
        """Number of contacts and of discs."""
        return np.array([np.count_nonzero(self.contact), np.count_nonzero(self.disc)])


def _on_switch(
    layout: ContactLayout, trial: np.ndarray, bound: np.ndarray, coefficient: np.ndarray, slack: np.ndarray
) -> _OnSwitch:
    """Return which points are no further from a switch than their slack, [force]."""
    contact = np.abs(trial[layout.normal]) <= slack[layout.normal]
    vanishing = contact[layout.friction_of] & (coefficient > 0)
    beyond = np.linalg.norm(trial[layout.tangential], axis=1) - bound
    disc = (bound > 0) & ~vanishing & (np.abs(beyond) <= slack[layout.tangential[:, 0]])
    return _OnSwitch(contact, vanishing, disc)


def _told_apart(
    problem: DualProblem, solution: DualSolution, step: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance from a switch at which the sides can be told apart, owned, [force]. Collective.

    That is what the residuals of the state can make of λ − ρ r, with ρ the ``step``: those of the contact
    law are forces already, jumps between subdomains become forces as slips and gaps do.

    Returns:
        The distance, and that below which points of a loose state lean to neither side, shapes (size,).
    """
    residuals = solution.residuals
    forces, jumps = residuals.natural * residuals.force_scale, residuals.gluing * residuals.gluing_scale
    moved = np.where(problem.between_supports, 0.0, step * problem.rhs)  # no multiplier moves the others
    rounding = ROUNDING * max(problem.norm(solution.multiplier), problem.norm(moved))
    told = np.asarray(UNCERTAINTY * (forces + step * jumps) + rounding)
    return told, np.minimum(told, LEANING * residuals.force_scale + rounding)


def _points_on_edges(state: State) -> int:
    """Count the closed points over an edge of their master facet, where the normal field has a kink.

    Points of mortar contact stand for a mean over facets and lie on none.
    """
    points = state.torn.points
    total = 0
    for index, pair in enumerate(state.scene.contacts):
        if isinstance(pair.master, Surface):
            closed = (points.pair == index) & (points.facet >= 0) & (state.contact.normal_force > 0)
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

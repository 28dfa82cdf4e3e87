"""The branch of the contact law on which a state is differentiated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import scipy.sparse as sp

from fenics_contact._libraries import MPI
from fenics_contact.contact import RowValues, State
from fenics_contact.display import displayed
from fenics_contact.linalg import ROUNDING
from fenics_contact.qp import ContactLayout, Face, classify, global_sum
from fenics_contact.scene import Surface
from fenics_contact.surfaces import edge_distance

#: A contact point is weakly active if it is closer to a switch of the contact law than this many residuals.
UNCERTAINTY = 3.0
#: Weak points further from the switch than this fraction of the forces are assigned to the closer side.
LEANING = 1e-5
#: A projection within this distance of a facet's edge, in local coordinates, counts as on the edge.
EDGE_TOLERANCE = 1e-6


class WeakChoice(Enum):
    """The branch that all weakly active points are given.

    Each branch of each point is an element of the limiting coderivative of its contact law, and the adjoint
    of a choice is an element of the inclusion for coderivatives of a composition. With a single weak point
    either branch gives a Clarke subgradient. With several it need not: nearby designs may close some points
    only while others open, so that no design has all of them open, or all closed.
    """

    RELEASED = "weak contacts count as open, weak discs as slipping"
    HELD = "weak contacts count as closed, weak discs as sticking"


@dataclass(frozen=True)
class WeakPoints:
    """Numbers of points on a switch of the contact law, to the accuracy of the state, over all ranks.

    Attributes:
        contacts: Points with neither force nor gap.
        discs: Friction discs at their bound without slip.
        edges: Closed points that project on an edge between facets; they count as inside the facet they
            project on.
        choice: The branch that contacts and discs were given. Those of an inaccurate state that are probably
            on one side are assigned to that side.
    """

    contacts: int
    discs: int
    edges: int
    choice: WeakChoice

    @classmethod
    def joined(cls, several: Sequence[WeakPoints]) -> WeakPoints:
        """Return the weak points of several states together."""
        counts = ((each.contacts, each.discs, each.edges) for each in several)
        contacts, discs, edges = (sum(column) for column in zip(*counts, strict=True))
        return cls(contacts, discs, edges, several[0].choice)

    @property
    def count(self) -> int:
        """Number of all weak points."""
        return self.contacts + self.discs + self.edges

    @property
    def may_be_invalid(self) -> bool:
        """Whether the derivative may not be a subgradient: no nearby design may have all these branches.

        Where one weak contact closes, its friction may slip: only that single point must not be held.
        """
        return self.count > 1 or (self.contacts > 0 and self.choice is WeakChoice.HELD)


@displayed
@dataclass(frozen=True, eq=False)
class LinearisedFace:
    """Face of a state with the two bases of its linearised contact law.

    Attributes:
        face: Closed, sticking and slipping points.
        tested: Z_s, test directions of the rows, shape (n_owned, n_face).
        moving: Z_u, directions along which the multiplier varies: a slipping friction force grows with its
            normal force by μ d, shape (n_owned, n_face).
        slip_direction: d at the slipping discs, zero elsewhere, shape (n_friction, dim − 1), owned.
        growing: Discs whose force grows with its normal force, shape (n_friction,), owned.
        weak: Points on a switch.
    """

    face: Face
    tested: sp.csr_matrix
    moving: sp.csr_matrix
    slip_direction: np.ndarray
    growing: np.ndarray
    weak: WeakPoints


def linearise_face(state: State, choice: WeakChoice, *, coupling: bool = True) -> LinearisedFace:
    """Classify the contact points of a state and build both bases. Collective.

    Args:
        choice: Branch for weakly active points.
        coupling: If False, the growth of friction with the normal force is omitted; the derivative is then
            that of Tresca friction.
    """
    torn, rows = state.torn, state.rows
    layout, bound, step = torn.layout, rows.slip_bound, rows.step
    trial = rows.multiplier - step * rows.residual
    coefficient = torn.friction_coefficient[torn.owned_discs]
    length = np.linalg.norm(trial[layout.tangential], axis=1)
    # Two slacks: every point that may be weak is counted, but only one that leans to no side is reassigned.
    uncertainty, closest = _uncertainty(torn.decomposition.comm, rows)
    counted = _on_switch(layout, trial, bound, coefficient, uncertainty)
    weak = _on_switch(layout, trial, bound, coefficient, closest)

    known = classify(layout, bound, rows.multiplier, rows.residual, step)
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
    tested, growing = face.restriction, face.slip | starting
    moving = tested + growth_of(face, growing, coefficient) if coupling else tested
    slip_direction = np.where(face.slip[:, None], direction, 0.0)
    contacts, discs = torn.decomposition.comm.allreduce(counted.counts)
    points = WeakPoints(int(contacts), int(discs), _points_on_edges(state), choice)
    return LinearisedFace(face, tested, moving.tocsr(), slip_direction, growing, points)


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
    """Return which points are within their slack, [force], of a switch."""
    contact = np.abs(trial[layout.normal]) <= slack[layout.normal]
    vanishing = contact[layout.friction_of] & (coefficient > 0)
    beyond = np.linalg.norm(trial[layout.tangential], axis=1) - bound
    disc = (bound > 0) & ~vanishing & (np.abs(beyond) <= slack[layout.tangential[:, 0]])
    return _OnSwitch(contact, vanishing, disc)


def _uncertainty(
    comm: MPI.Comm, rows: RowValues
) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance from a switch beyond which a point's side is certain, owned, [force]. Collective.

    It is the uncertainty of λ − ρ r due to the residuals of the state, with ρ the step: those of the
    contact law are forces already, jumps between subdomains become forces as slips and gaps do.

    Returns:
        The distance, and that below which a point of an inaccurate state is assigned to no side, shapes
        (size,).
    """
    residuals = rows.residuals
    forces, jumps = residuals.natural * residuals.force_scale, residuals.gluing * residuals.gluing_scale
    moved = np.where(rows.between_supports, 0.0, rows.step * rows.opening)  # none changes the others
    squares = [float(global_sum(comm, x @ x)[0]) for x in (rows.multiplier, moved)]
    rounding = ROUNDING * float(np.sqrt(max(squares)))
    uncertainty = np.asarray(UNCERTAINTY * (forces + rows.step * jumps) + rounding)
    return uncertainty, np.minimum(uncertainty, LEANING * residuals.force_scale + rounding)


def _points_on_edges(state: State) -> int:
    """Count the closed points over an edge of their master facet, where the normal field has a kink.

    Points of mortar contact represent a mean over facets and lie on none.
    """
    points = state.torn.points
    total = 0
    for index, pair in enumerate(state.scene.contacts):
        if isinstance(pair.master, Surface):
            closed = (points.pair == index) & (points.facet >= 0) & (state.contact.normal_force > 0)
            mesh = state.scene.bodies[pair.master.body].mesh.linear
            corners = mesh.surfaces[pair.master.name].shape[1]
            distance = np.abs(edge_distance(points.local[closed], corners))
            total += int(np.count_nonzero(distance < EDGE_TOLERANCE))
    return total


def growth_of(face: Face, growing: np.ndarray, coefficient: np.ndarray) -> sp.csr_matrix:
    """Return the growth of slipping forces with their normal forces, and that of incipient ones.

    A Coulomb disc has zero radius where its contact is weak. When the contact closes, its force grows along
    the slip: it has a direction but no offset, hence no column of its own; such columns come last.
    """
    return replace(face, slip=growing).growth(coefficient)[:, : face.n_face]


def _directions(known: np.ndarray, trial: np.ndarray, length: np.ndarray, weak: np.ndarray) -> np.ndarray:
    directions = trial / np.where(length > 0, length, 1.0)[:, None]
    return np.where(weak[:, None], directions, known)

"""Random friction problems of rigid bodies: W = H M⁻¹ Hᵀ, q = H v and μ of one time step, from a seed.

Stacks of boxes, boxes in grooves, piles and capsules on each other: few bodies with many contacts, so that
W is singular and forces are not unique, and friction coefficients up to 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from fenics_contact.qp import DualProblem
from fenics_contact.qp.coarse import CoarseSpace
from fenics_contact.qp.layout import ContactLayout

GRAVITY = np.array([0.0, 0.0, -0.1, 0.0, 0.0, 0.0])


def frame(normal: np.ndarray) -> np.ndarray:
    """Return a unit normal and two tangents, in rows."""
    normal = normal / np.linalg.norm(normal)
    tangent = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    tangent /= np.linalg.norm(tangent)
    return np.array([normal, tangent, np.cross(normal, tangent)])


def spin(arm: np.ndarray) -> np.ndarray:
    """Return the matrix of v = ω × arm, as a function of ω."""
    x, y, z = arm
    return np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])


@dataclass(frozen=True, eq=False)
class RigidBodies:
    """Boxes that grow by `body` and touch by `contact`, below them the floor, which does not move."""

    rng: np.random.Generator
    centres: list[np.ndarray] = field(default_factory=list)
    mobilities: list[np.ndarray] = field(default_factory=list)
    velocities: list[np.ndarray] = field(default_factory=list)
    contacts: list[tuple[int, int | None, np.ndarray, np.ndarray]] = field(default_factory=list)

    def body(self, centre: object, mass: float, edges: object, speed: float) -> int:
        """Add a box with a random velocity and return its number."""
        squares = np.square(np.asarray(edges, dtype=float))
        inertia = mass / 12 * (squares.sum() - squares)
        self.centres.append(np.asarray(centre, dtype=float))
        self.mobilities.append(np.concatenate([np.full(3, 1 / mass), 1 / inertia]))
        self.velocities.append(GRAVITY + 0.05 * speed * self.rng.standard_normal(6))
        return len(self.centres) - 1

    def contact(self, upper: int, lower: int | None, point: np.ndarray, normal: np.ndarray) -> None:
        """Let two bodies, or a body and the floor, touch; the normal points into the upper one."""
        self.contacts.append((upper, lower, point, frame(normal)))

    def patch(
        self, upper: int, lower: int | None, middle: np.ndarray, normal: np.ndarray, count: int, half: float
    ) -> None:
        """Let two bodies touch in random points of a square."""
        for x in self.rng.uniform(-half, half, (count, 2)):
            self.contact(upper, lower, middle + x @ frame(normal)[1:], normal)

    def problem(self, mu_f: float) -> tuple[DualProblem, np.ndarray]:
        """Return the dual problem F = W, d = −q, and μ."""
        H = np.zeros((3 * len(self.contacts), 6 * len(self.centres)))
        for number, (upper, lower, point, axes) in enumerate(self.contacts):
            rows = H[3 * number : 3 * number + 3]
            for sign, body in ((1.0, upper), (-1.0, lower)):
                if body is not None:
                    arm = point - self.centres[body]
                    rows[:, 6 * body : 6 * body + 6] = sign * np.hstack([axes, axes @ spin(arm)])
        W, q = H * np.concatenate(self.mobilities) @ H.T, H @ np.concatenate(self.velocities)
        rows = np.arange(len(q)).reshape(-1, 3)
        layout = ContactLayout.build(len(q), normal=rows[:, 0], tangential=rows[:, 1:])
        free = CoarseSpace(MPI.COMM_SELF, sp.csr_matrix((0, len(q))), np.zeros(0))
        dual = DualProblem(MPI.COMM_SELF, lambda x: W @ x, -q, free, layout, np.diagonal(W).copy())
        return dual, np.full(len(rows), mu_f)


def stack(bodies: RigidBodies) -> None:
    """Boxes on each other, with up to nine contacts each, some of them heavy on light."""
    rng, height, below = bodies.rng, 0.0, None
    count, heavy = int(rng.choice([4, 6, 9])), rng.uniform(0.0, 1.0)
    for _ in range(rng.integers(2, 9)):
        edge = rng.uniform(0.5, 1.5)
        aside = 0.1 * rng.standard_normal(2)
        box = bodies.body([*aside, height + edge / 2], 10 ** rng.uniform(-heavy, heavy), [1, 1, edge], 1.0)
        bodies.patch(box, below, np.array([0.0, 0.0, height]), np.array([0.0, 0.0, 1.0]), count, 0.45)
        below, height = box, height + edge


def groove(bodies: RigidBodies) -> None:
    """Boxes in a row between two slopes, which touch each other."""
    rng = bodies.rng
    for number in range(rng.integers(1, 4)):
        centre = np.array([2.0 * number, 0.0, 0.0])
        box = bodies.body(centre, rng.uniform(0.5, 3.0), rng.uniform(0.5, 1.5, 3), 3.0)
        slope = rng.uniform(0.2, 1.2)
        for side in (-1.0, 1.0):
            normal = np.array([0.0, side * np.cos(slope), np.sin(slope)])
            bodies.patch(box, None, centre - 0.5 * normal, normal, int(rng.integers(3, 9)), 0.5)
        if number:
            bodies.patch(box, box - 1, centre - [1.0, 0.0, 0.0], np.array([1.0, 0.0, 0.0]), 4, 0.4)


def pile(bodies: RigidBodies) -> None:
    """Bodies at random places, each of which touches its neighbours and the lowest the floor."""
    rng, count = bodies.rng, int(bodies.rng.integers(4, 13))
    size = count ** (1 / 3)
    centres = rng.uniform(-size, size, (count, 3)) * [1.2, 1.2, 1.0]
    for number, centre in enumerate(centres):
        body = bodies.body(centre, rng.uniform(0.5, 2.0), rng.uniform(0.5, 1.5, 3), 2.0)
        if number == np.argmin(centres[:, 2]) or centre[2] < -0.3 * size:
            below = centre - [0.0, 0.0, 0.5]
            bodies.patch(body, None, below, np.array([0.0, 0.0, 1.0]), int(rng.integers(1, 5)), 0.4)
    for number, centre in enumerate(centres):
        near = np.argsort(np.linalg.norm(centres - centre, axis=1))[1:5]
        for other in near[near > number]:
            apart = centre - centres[other]
            normal = apart / np.linalg.norm(apart) + 0.1 * rng.standard_normal(3)
            middle = 0.5 * (centre + centres[other])
            bodies.patch(number, int(other), middle, normal, int(rng.integers(1, 5)), 0.3)


def capsules(bodies: RigidBodies) -> None:
    """Capsules in rows of three on each other and between a floor and a wall, two contacts each."""
    rng = bodies.rng
    for number in range(rng.integers(3, 9)):
        row, place = divmod(number, 3)
        centre = np.array([0.9 * place + 0.45 * (row % 2), 0.1 * rng.standard_normal(), 0.3 + 0.55 * row])
        body = bodies.body(centre, 1.0, [0.6, 0.6, 2.0], 1.0)
        axis = np.array([0.2 * rng.standard_normal(), 1.0, 0.0])
        below = [other for other in (number - 3, number - 2) if row and other < number]
        beside = [number - 1] if place else []
        for end in (-0.8 * axis, 0.8 * axis):
            for other in (*below, *beside):
                apart = centre - bodies.centres[other]
                bodies.contact(body, other, centre - 0.5 * apart + end, apart)
            if not row:
                bodies.contact(body, None, centre - [0.0, 0.0, 0.3] + end, np.array([0.0, 0.0, 1.0]))
            if not place:
                bodies.contact(body, None, centre - [0.3, 0.0, 0.0] + end, np.array([1.0, 0.0, 0.0]))


KINDS: tuple[Callable[[RigidBodies], None], ...] = (stack, groove, pile, capsules)


def rigid_problem(seed: int) -> tuple[DualProblem, np.ndarray]:
    """Return the dual problem of a random scene, without any body that floats, and μ."""
    bodies = RigidBodies(np.random.default_rng(seed))
    mu_f = bodies.rng.uniform(0.2, 1.0)
    KINDS[seed % len(KINDS)](bodies)
    return bodies.problem(mu_f)

"""What Newton's methods on faces share: named steps on frozen states, forcing terms and damping.

Two methods are built on it: `FaceNewton` on a dual problem, whose operator is constant, and `TangentNewton`
of large deformations, whose tangents change. Only operators and rules for a failed step differ.

References:
    S. C. Eisenstat, H. F. Walker, Choosing the forcing terms in an inexact Newton method, SIAM J. Sci.
    Comput. 17 (1996). Z. Dostál, Optimal Quadratic Programming Algorithms, Springer (2009).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

import numpy as np

from fenics_contact.qp.face import Face
from fenics_contact.qp.reductions import Vector
from fenics_contact.qp.solution import Residuals

#: Fractions of a step that are tried where its end is worse than its start and the point before that.
FRACTIONS = (0.5, 0.25, 0.1)

State = TypeVar("State")
Answer = TypeVar("Answer", covariant=True)
Point = TypeVar("Point")


class NewtonMethod(Protocol[State, Answer]):
    """An inexact semismooth Newton method whose data pass from step to step in a frozen state.

    1. `terminate`: the answer where all residuals are small; an error where steps are used up.
    2. `step`: (a) the forcing term η, from how residuals fell, (b) the face that the natural map selects,
       (c) the linear system of the face, solved to η, (d) the step, damped where its end is worse,
       (e) progress, and what to do without.
    """

    def terminate(self, state: State) -> Answer | None:
        """Return the answer, None if a further step is needed. Collective."""

    def step(self, state: State) -> State:
        """Take one step. Collective."""


def run_newton(method: NewtonMethod[State, Answer], state: State) -> Answer:
    """Take steps until the method terminates. Collective."""
    while (answer := method.terminate(state)) is None:
        state = method.step(state)
    return answer


@dataclass(frozen=True)
class Forcing:
    """Forcing terms η, by choice 1 or 2 of Eisenstat and Walker.

    Attributes:
        largest: Largest tolerance relative to the residual.
        loosest: Largest absolute tolerance.
        tolerance: That of the whole solve: no face is solved much more accurately.
    """

    largest: float
    loosest: float
    tolerance: float

    def at_most(self, largest: float, loosest: float) -> Forcing:
        """Return forcing terms that are no larger than these."""
        return replace(self, largest=min(self.largest, largest), loosest=min(self.loosest, loosest))

    def by_prediction(self, residuals: Residuals, mismatch: float | None, care: float) -> float:
        """Return the weighted residual at which a face is solved, by choice 1.

        Args:
            residuals: Those of the iterate.
            mismatch: Difference of the last residual from the one that its face predicted, relative to the
                residual before; None if the face has changed.
            care: Factor on the relative tolerance, at most one.
        """
        term = self.largest if mismatch is None else min(self.largest, mismatch)
        wanted = min(self.loosest, care * term * residuals.worst)
        return max(wanted, 0.3 * self.tolerance)

    def by_reduction(self, worst: float, before: float | None, last: float, care: float) -> float:
        """Return the residual of a linear system relative to its start, by choice 2 with γ = 0.9.

        Args:
            worst: The residual.
            before: That before the last step, None before the first.
            last: The last forcing term.
            care: Factor on all of them, at most one.
        """
        term = self.largest
        if before and before < 1.0:
            safeguard = 0.9 * last**2
            term = min(term, max(0.9 * (worst / before) ** 2, safeguard if safeguard > 0.1 else 0.0))
        return care * max(term, 0.3 * self.tolerance / max(worst, self.tolerance))


@dataclass(frozen=True, eq=False)
class Damped(Generic[Point]):
    """The point that is taken and the fraction of the step that led to it."""

    point: Point
    fraction: float


def damp(
    full: Point,
    at: Callable[[float], Point],
    measured: Callable[[Point], Residuals],
    earlier: Iterable[Residuals | None],
    fractions: tuple[float, ...] = FRACTIONS,
) -> Damped[Point]:
    """Return the end of a step, or the best of a few points on it if that is worse. Collective.

    Where the active set alternates between two faces the solution lies between them. The way to the right
    face may lead over a worse one: a full step is taken if it improves on either of the last two points.

    Args:
        full: The end of the step.
        at: Returns the point at a fraction of it.
        measured: Returns the residuals by which points are compared.
        earlier: Those of the last two points, None without.
        fractions: Those that are tried.
    """
    end = measured(full)
    if any(old is not None and not end.is_worse_than(old) for old in earlier):
        return Damped(full, 1.0)
    tried = [Damped(full, 1.0), *(Damped(at(part), part) for part in fractions)]
    return min(tried, key=lambda each: measured(each.point).worst_beside(end))


def residual_weights(face: Face, residuals: Residuals, step: Vector) -> Vector:
    """Return the weights that turn a residual on a face into the natural and the gluing residual.

    Args:
        face: The face.
        residuals: The last residuals, for their scales.
        step: ρ of the natural map, 0 on equality rows, owned.
    """
    gluing = residuals.gluing_scale or 1.0
    weights = np.sqrt(face.restriction.power(2).T @ step**2) * face.damping**2
    weights /= residuals.force_scale or np.inf
    return np.where(weights > 0.0, weights, 1.0 / gluing)

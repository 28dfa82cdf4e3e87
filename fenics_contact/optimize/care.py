"""Doubtful subgradients: before the method stops on them, gradients at nearby points replace them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fenics_contact.optimize.evaluation import with_gradients_near
from fenics_contact.optimize.merit import merit_planes
from fenics_contact.optimize.objective import Evaluation
from fenics_contact.optimize.problem import PosedProblem
from fenics_contact.optimize.state import MethodState

Array = NDArray[np.float64]

_NEAR = 1e-2  # distance to a neighbour, in lengths of the problem
_ATTEMPTS = 8  # directions that are tried until one yields half the distance


def verified(problem: PosedProblem, given: Evaluation, number: int) -> Evaluation:
    """Return an evaluation whose subgradient is valid, as far as the function knows.

    At almost every point a locally Lipschitz function has a gradient, and limits of such gradients at points
    that tend to x are Clarke subgradients at x: the gradient near x in a generic direction approximates one
    of them.

    References:
        J. V. Burke, A. S. Lewis, M. L. Overton, A robust gradient sampling algorithm for nonsmooth, nonconvex
        optimization, SIAM J. Optim. 15 (2005) 751-779.
    """
    return (
        with_gradients_near(problem, given, neighbour(problem, given.x), number) if given.doubtful else given
    )


def with_verified_centre(problem: PosedProblem, state: MethodState) -> MethodState:
    """Return the state with a verified centre, without doubtful planes, careful from now on.

    A proximal parameter that wrong predictions have reduced is reset.
    """
    centre = verified(problem, state.centre, state.evaluations + 1)
    planes = merit_planes(problem, centre)
    bundle = state.bundle.refined(planes[0], 0.0)
    soft = [
        one.refined(plane).without_doubtful_planes()
        for one, plane in zip(state.soft, planes[1:], strict=True)
    ]
    trust = replace(state.trust, t=state.first_t) if state.trust.exhausted else state.trust
    remaining = bundle.chosen(np.flatnonzero(~bundle.doubtful))
    return replace(state, centre=centre, bundle=remaining, trust=trust, careful=True, soft=tuple(soft))


def neighbour(problem: PosedProblem, x: Array) -> Array:
    """Return a feasible point near x in a random direction, the same one for the same x.

    Steps that leave the box are reflected into it; of several points the one furthest from x is taken, x
    itself where no other is feasible.
    """
    allowed, scale = problem.allowed, problem.scale
    below, above = (allowed.lower - x) / scale, (allowed.upper - x) / scale
    length, best = _NEAR * problem.length, x
    random = np.random.default_rng(np.frombuffer(x.tobytes(), dtype=np.uint32))
    for _ in range(_ATTEMPTS):
        way = random.standard_normal(x.size)
        way *= length / np.linalg.norm(way)
        way = np.where((way < below) | (way > above), -way, way)
        point = allowed.project(x + scale * way)
        if _distance(point, x, scale) > _distance(best, x, scale):
            best = point
        if _distance(best, x, scale) > 0.5 * length:
            break
    return best


def _distance(point: Array, x: Array, scale: Array) -> float:
    return float(np.linalg.norm((point - x) / scale))

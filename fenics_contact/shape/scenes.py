"""Which scenes and objectives can be designed, and which scenes are load cases of one design."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np

from fenics_contact.contact import ContactProblem
from fenics_contact.errors import InvalidDesignError, InvalidInputError, safe_log
from fenics_contact.linalg import LAST_PLACES
from fenics_contact.scene import HistoryMaterial, Scene, has_mean_dilatation
from fenics_contact.shape.memory import DesignPoint
from fenics_contact.shape.objective import Objective

#: How far beside the first design an objective without a gradient is evaluated, by the size of the scene.
BESIDE = 1e-6

_LOG = logging.getLogger(__name__)


def checked_contact(contact: ContactProblem) -> ContactProblem:
    """Return the contact problem of a shape problem."""
    if not isinstance(contact, ContactProblem):
        raise InvalidInputError(
            f"ShapeProblem needs a ContactProblem, got {type(contact).__name__}: write "
            "ShapeProblem(ContactProblem(scene, comm), designs, objective)"
        )
    _check_differentiable(contact.scene)
    return contact


def _check_differentiable(scene: Scene) -> None:
    """Reject what of large deformations has no derivative by the shape."""
    if not scene.is_nonlinear:
        return
    reasons = {
        "materials without history": any(
            isinstance(each, HistoryMaterial) for body in scene.bodies.values() for each in body.materials
        ),
        "materials without mean_dilatation": any(
            has_mean_dilatation(each) for body in scene.bodies.values() for each in body.materials
        ),
        "pressures that do not follow their surfaces": bool(scene.following_pressures),
    }
    for needed, missing in reasons.items():
        if missing:
            raise InvalidInputError(
                f"designs of bodies that deform much need {needed}, this scene has others: optimise it with "
                "a tool that takes plain functions, see fenics_contact.outer"
            )


def require_influence(
    objective: Objective, scene: Scene, point: DesignPoint, evaluate: Callable[[np.ndarray], DesignPoint]
) -> None:
    """Reject an objective that no design variable changes, here or at a design nearby. Collective.

    Where the gradient is rounding the objective may be stationary, as a norm of the pressure is where that is
    even: then it has a gradient nearby.
    """
    size = float(np.ptp(scene.points))
    if _has_influence(point, size):
        return
    number = len(point.gradient)
    way = np.random.default_rng(0).standard_normal(number)
    try:
        if _has_influence(evaluate(point.alpha + BESIDE * size * way), size):
            safe_log(_LOG.info, "the objective is stationary at the first design, to rounding")
            return
    except InvalidDesignError:
        return  # not known
    raise InvalidInputError(
        f"an objective must change with the design, but {objective!r} is {point.value:.6g} and none of "
        f"{number} variables changes it: choose one that the moving surfaces affect (pressures "
        "need a pair in contact, movements a body that they load), or start from another design"
    )


def _has_influence(point: DesignPoint, size: float) -> bool:
    """Return whether a variable changes the objective over the size of the scene."""
    change = float(np.abs(point.gradient).max(initial=0.0) * size)
    return change > LAST_PLACES * abs(point.value)


def check_case(first: Scene, scene: Scene) -> None:
    """Check that a scene is a load case of the same designs."""
    if set(scene.bodies) != set(first.bodies):
        raise InvalidInputError(
            f"load cases must share their bodies, got {sorted(scene.bodies)} beside {sorted(first.bodies)}: "
            "take the scene from dataclasses.replace(scene, loads=...) or LoadStep.applied_to(scene)"
        )
    for name, body in scene.bodies.items():
        mate = first.bodies[name]
        if body.mesh is not mate.mesh or body.materials != mate.materials:
            raise InvalidInputError(
                f"load cases must share their bodies, but {name!r} has another mesh or material: take the "
                "scene from dataclasses.replace(scene, loads=...) or LoadStep.applied_to(scene)"
            )
        if not np.array_equal(scene.fixed(name), first.fixed(name)):
            raise InvalidInputError(
                f"load cases must hold the same components, their supports of {name!r} differ: give other "
                "values, or hold by RigidSurface what only some cases move"
            )

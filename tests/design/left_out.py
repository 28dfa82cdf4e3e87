"""Terms of the derivative, each left out on its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from fenics_contact.design import (
    adjoint,
    problem,
    sensitivity,
)
from fenics_contact.design import (
    contact_derivatives as contact_derivative,
)
from fenics_contact.design import (
    load_derivatives as work_derivative,
)
from fenics_contact.design import (
    surface_derivatives as projection_derivative,
)
from fenics_contact.design.adjoint import LinearisedFace
from tests.design.quotients import Patch


def without(*terms: str) -> Callable[[Patch], None]:
    """Drop derivatives of the contact points' geometry."""

    def drop(patch: Patch) -> None:
        whole = contact_derivative._by_point

        def by_point(*arguments: Any) -> Any:
            found = whole(*arguments)
            return replace(found, **{term: np.zeros_like(getattr(found, term)) for term in terms})

        patch.setattr(contact_derivative, "_by_point", by_point)

    return drop


def without_growth_of_friction(patch: Patch) -> None:
    patch.setattr(adjoint, "growth_of", lambda face, *_: 0.0 * face.restriction)


def without_turning_of_friction(patch: Patch) -> None:
    whole = problem.linearise_face  # type: ignore[attr-defined]

    def stiff(*arguments: Any) -> LinearisedFace:
        found = whole(*arguments)
        # No overshoot, no curvature: the slip may not leave its direction.
        return replace(found, face=replace(found.face, overshoot=np.ones_like(found.face.overshoot)))

    patch.setattr(problem, "linearise_face", stiff)


def without_stiffness(patch: Patch) -> None:
    whole = sensitivity.work_by_shape  # type: ignore[attr-defined]
    patch.setattr(sensitivity, "work_by_shape", lambda *given: np.zeros_like(whole(*given)))


def without_own(derivative: str) -> Callable[[Patch], None]:
    """Drop a derivative of the objective by the geometry."""

    def drop(patch: Patch) -> None:
        whole = problem.by_nodes  # type: ignore[attr-defined]

        def by_nodes(state: Any, adjoint: Any, partials: Any, *more: Any) -> Any:
            return whole(state, adjoint, replace(partials, **{derivative: 0.0}), *more)

        patch.setattr(problem, "by_nodes", by_nodes)

    return drop


def without_areas(patch: Patch) -> None:
    whole = contact_derivative.point_areas_pulled_back  # type: ignore[attr-defined]
    patch.setattr(
        contact_derivative, "point_areas_pulled_back", lambda *arguments: np.zeros_like(whole(*arguments))
    )


def without_weight(patch: Patch) -> None:
    patch.setattr(work_derivative, "moving_loads", lambda torn, moving: [])


def without_slopes(patch: Patch) -> None:
    """Let true surfaces keep their height over a facet when its nodes move."""
    whole = projection_derivative.slopes_pulled_back  # type: ignore[attr-defined]

    def none(*arguments: Any) -> Any:
        return tuple(np.zeros_like(part) for part in whole(*arguments))

    for module in (projection_derivative, contact_derivative):
        patch.setattr(module, "slopes_pulled_back", none)


TERMS: dict[str, Callable[[Patch], None]] = {
    "gap": without("gap"),
    "slopes": without_slopes,
    "normals": without("normal"),
    "tangents": without("tangents"),
    "weights": without("weight"),
    "all rows": without("normal", "tangents", "weight"),
    "growth of friction": without_growth_of_friction,
    "turning of friction": without_turning_of_friction,
}

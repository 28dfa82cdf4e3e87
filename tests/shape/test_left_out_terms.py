"""Every term of the derivative counts: leave one out, and the adjoint misses the difference quotient."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from fenics_contact.shape import contact_derivative, forms, problem, projection_derivative
from fenics_contact.shape.linearised_face import LinearisedFace
from tests.shape import moved_blocks as blocks
from tests.shape.chains import line
from tests.shape.objectives import objectives
from tests.shape.quotients import Line, Patch, miss_without

OBJECTIVES = objectives("link1")


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
    patch.setattr(problem, "linearise_face", partial(problem.linearise_face, coupling=False))  # type: ignore[attr-defined]


def without_turning_of_friction(patch: Patch) -> None:
    whole = problem.linearise_face  # type: ignore[attr-defined]

    def stiff(*arguments: Any) -> LinearisedFace:
        found = whole(*arguments)
        # No overshoot, no curvature: the slip may not leave its direction.
        return replace(found, face=replace(found.face, overshoot=np.ones_like(found.face.overshoot)))

    patch.setattr(problem, "linearise_face", stiff)


def without_stiffness(patch: Patch) -> None:
    whole = problem.work_by_shape  # type: ignore[attr-defined]
    patch.setattr(problem, "work_by_shape", lambda *given: np.zeros_like(whole(*given)))


def without_own_shape(patch: Patch) -> None:
    whole = problem.ShapeProblem._by_points

    def by_points(self: Any, state: Any, adjoint: Any, by_shape: np.ndarray, by_bound: np.ndarray) -> Any:
        return whole(self, state, adjoint, np.zeros_like(by_shape), by_bound)

    patch.setattr(problem.ShapeProblem, "_by_points", by_points)


def without_areas(patch: Patch) -> None:
    whole = contact_derivative.areas_pulled_back  # type: ignore[attr-defined]
    patch.setattr(
        contact_derivative, "areas_pulled_back", lambda *arguments: np.zeros_like(whole(*arguments))
    )


def without_weight(patch: Patch) -> None:
    patch.setattr(forms, "moving_loads", lambda torn, moving: [])


def without_slopes(patch: Patch) -> None:
    """Let true surfaces keep their height over a facet when its nodes move."""
    whole = projection_derivative.slopes_pulled_back  # type: ignore[attr-defined]

    def none(*arguments: Any) -> Any:
        return tuple(np.zeros_like(part) for part in whole(*arguments))

    patch.setattr(projection_derivative, "slopes_pulled_back", none)


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


def slanted(regime: str) -> Line:
    """Another way, along which all terms show in the energy."""
    here = line(regime)
    return replace(here, direction=np.random.default_rng(54).standard_normal(here.alpha.size))


@pytest.mark.parametrize("term", TERMS)
@pytest.mark.parametrize("objective", ["stress", "normal forces"])
def test_every_term_of_a_chain_with_sticking_and_slipping_points_counts(objective: str, term: str) -> None:
    here, judge = line("mixed"), OBJECTIVES[objective]
    assert here.miss(judge) < 1e-5
    assert miss_without(TERMS[term], here, judge) > 1e-3


@pytest.mark.parametrize(
    "term", ["gap", "slopes", "normals", "weights", "growth of friction", "turning of friction"]
)
def test_the_energy_alone_shows_most_of_them(term: str) -> None:
    here, judge = slanted("mixed"), OBJECTIVES["energy"]
    assert here.miss(judge) < 1e-5
    assert miss_without(TERMS[term], here, judge) > 1e-3


@pytest.mark.parametrize("term", [without_stiffness, without_own_shape])
def test_the_shape_derivatives_of_integrals_count(term: Callable[[Patch], None]) -> None:
    assert miss_without(term, line("mixed"), OBJECTIVES["stress"]) > 1e-3


def test_where_every_point_slips_friction_must_grow_with_its_normal_force() -> None:
    for objective in ("energy", "stress", "normal forces", "friction forces"):
        assert miss_without(without_growth_of_friction, line("slip"), OBJECTIVES[objective]) > 1e-3


def test_where_no_point_slips_friction_neither_grows_nor_turns() -> None:
    here, judge = line("stick"), OBJECTIVES["stress"]
    for term in (without_growth_of_friction, without_turning_of_friction):
        assert miss_without(term, here, judge) < 1e-5


def test_the_slip_bound_of_tresca_friction_changes_with_the_nodal_area() -> None:
    here = slanted("Tresca")
    for objective in ("energy", "stress", "normal forces", "friction forces"):
        assert here.miss(OBJECTIVES[objective]) < 1e-5
        assert miss_without(without_areas, here, OBJECTIVES[objective]) > 1e-3


def test_the_weight_of_a_body_changes_with_its_shape() -> None:
    here, judges = blocks.line("weight alone"), blocks.OBJECTIVES["weight alone"]
    for objective in ("energy", "normal forces"):
        assert here.miss(judges[objective]) < 1e-5
        assert miss_without(without_weight, here, judges[objective]) > 1e-3


def test_nothing_stays_patched() -> None:
    assert miss_without(lambda patch: None, line("mixed"), OBJECTIVES["energy"]) < 1e-5

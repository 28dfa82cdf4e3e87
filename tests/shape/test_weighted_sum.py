"""Objectives can be added and scaled."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from fenics_contact import Coulomb, State
from fenics_contact.design import Objective, Partials, TotalPotential
from fenics_contact.design.forms import ShapeForms
from fenics_contact.design.objective import WeightedSum
from fenics_contact.errors import InvalidInputError
from tests.shape.blocks import block_on_floor, problem
from tests.shape.objectives import objectives
from tests.shape.quotients import Remembering

ALL = objectives("block")
ENERGY, STRESS, FORCES = ALL["energy"], ALL["stress"], ALL["friction forces"]
DESIGN = 0.01 * np.random.default_rng(3).standard_normal(6)


@cache
def solved() -> Remembering:
    return problem(block_on_floor(Coulomb(0.4), load=(0.4, 0.1, -2.0)))


@cache
def alone(name: str) -> tuple[float, np.ndarray]:
    point = solved().evaluate_by(ALL[name], DESIGN)
    return point.value, point.gradient


class Own:
    """The energy, by a class that knows of no sums."""

    def value(self, state: State, forms: ShapeForms) -> float:
        return TotalPotential().value(state, forms)

    def partials(self, state: State, forms: ShapeForms) -> Partials:
        return TotalPotential().partials(state, forms)


SUMS: dict[str, tuple[Objective, dict[str, float]]] = {
    "sum": (ENERGY + 2.0 * STRESS, {"energy": 1.0, "stress": 2.0}),
    "three": (ENERGY + 2.0 * STRESS + 0.5 * FORCES, {"energy": 1.0, "stress": 2.0, "friction forces": 0.5}),
    "difference": (ENERGY - STRESS * 3, {"energy": 1.0, "stress": -3.0}),
    "negative": (-(ENERGY + STRESS), {"energy": -1.0, "stress": -1.0}),
    "product of a sum": (2.0 * (ENERGY + STRESS), {"energy": 2.0, "stress": 2.0}),
    "number of NumPy": (np.float64(2.0) * ENERGY, {"energy": 2.0}),
    "own class": (Own() + STRESS, {"energy": 1.0, "stress": 1.0}),
    "own class behind": (STRESS + Own(), {"energy": 1.0, "stress": 1.0}),
}


@pytest.mark.parametrize("name", SUMS)
def test_value_and_gradient_are_those_of_the_terms(name: str) -> None:
    objective, weights = SUMS[name]
    point = solved().evaluate_by(objective, DESIGN)
    assert point.value == pytest.approx(sum(w * alone(term)[0] for term, w in weights.items()), rel=1e-12)
    wanted = sum(w * alone(term)[1] for term, w in weights.items())
    assert np.linalg.norm(wanted) > 0.0
    np.testing.assert_allclose(point.gradient, wanted, atol=1e-6 * np.abs(wanted).max())
    assert solved().value_by(objective, DESIGN) == pytest.approx(point.value, rel=1e-12)


def test_the_terms_count() -> None:
    parts = [np.linalg.norm(weight * alone(term)[1]) for term, weight in SUMS["three"][1].items()]
    assert min(parts) > 1e-4 * max(parts), "a term without weight would not be missed"


@pytest.mark.parametrize("weight", [np.nan, np.inf, "2", None])
def test_a_weight_that_is_no_finite_number_is_refused(weight: object) -> None:
    with pytest.raises(InvalidInputError, match="multiplied by a finite number, got"):
        weight * ENERGY  # type: ignore[operator]


@pytest.mark.parametrize("other", [1.0, "energy", None])
def test_what_is_no_objective_is_not_added(other: object) -> None:
    with pytest.raises(InvalidInputError, match=f"got {type(other).__name__}: add an object with"):
        ENERGY + other  # type: ignore[operator]


def test_a_sum_of_nothing_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="WeightedSum needs a term, got none"):
        WeightedSum(())

"""Every term of the derivative counts: leave one out, and the adjoint misses the difference quotient."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.shape import moved_blocks as blocks
from tests.shape.aims import aims
from tests.shape.chains import line
from tests.shape.left_out import (
    TERMS,
    without_areas,
    without_growth_of_friction,
    without_own,
    without_stiffness,
    without_turning_of_friction,
    without_weight,
)
from tests.shape.objectives import objectives
from tests.shape.quotients import Line, Patch, miss_without

OBJECTIVES, AIMS = objectives("link1"), aims("link1", "contact")


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


@pytest.mark.parametrize("term", [without_stiffness, without_own("by_shape")])
def test_the_shape_derivatives_of_integrals_count(term: Callable[[Patch], None]) -> None:
    assert miss_without(term, line("mixed"), OBJECTIVES["stress"]) > 1e-3


@pytest.mark.parametrize(
    ("derivative", "aim"),
    [
        ("by_area", "largest pressure"),
        ("by_area", "pressure norm"),
        ("by_area", "unevenness"),
        ("by_area", "area"),
        ("by_jump", "friction work"),
        ("by_shape", "largest stress"),
        ("by_shape", "movement"),
        ("by_shape", "strain energy"),
    ],
)
def test_derivatives_of_objectives_by_the_geometry_count(derivative: str, aim: str) -> None:
    here, judge = line("mixed"), AIMS[aim]
    assert here.miss(judge) < 1e-5
    assert miss_without(without_own(derivative), here, judge) > 1e-3


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

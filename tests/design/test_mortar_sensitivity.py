"""Derivatives by both surfaces of mortar contact beside difference quotients, whole and without terms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import ContactProblem, ShapeProblem, Status
from fenics_contact.design import TotalPotential
from fenics_contact.design import contact_derivatives as mortar_derivative
from tests.design.blocks import designs_of
from tests.design.mortar_lines import BLOCKS, NAMES, OBJECTIVES, line
from tests.design.quotients import Patch, miss_without

#: Many states: what claims rest on.
pytestmark = [pytest.mark.slow, pytest.mark.claim]

CASES = [(name, objective) for name in NAMES for objective in OBJECTIVES[name]]


@pytest.mark.parametrize("name", NAMES)
def test_points_stick_slip_and_are_open_all_along_the_line(name: str) -> None:
    here = line(name)
    assert here.is_smooth()
    assert all(here.state().contact.count(status) > 1 for status in Status), here.counts()
    assert np.all(here.state().contact.points.facet == -1)


@pytest.mark.parametrize(("name", "objective"), CASES)
def test_the_adjoint_agrees_with_central_differences(name: str, objective: str) -> None:
    here, judge = line(name), OBJECTIVES[name][objective]
    assert here.point(judge).weak.count == 0
    assert here.steepness(judge) > 0.02
    assert here.miss(judge) < 1e-5


@pytest.mark.parametrize(("name", "objective"), CASES)
def test_taylor_remainders_are_quadratic(name: str, objective: str) -> None:
    assert line(name).taylor_rate(OBJECTIVES[name][objective]) > 1.9


def without_mortar(patch: Patch) -> None:
    def none(points: Any, *rest: Any) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros_like(points.slave.points), np.zeros_like(points.master.points)

    patch.setattr(mortar_derivative, "mortar_points_pulled_back", none)


def without(term: str) -> Callable[[Patch], None]:
    """Leave out a derivative by the results of the coupling."""

    def drop(patch: Patch) -> None:
        whole = mortar_derivative.mortar_points_pulled_back

        def part(points: Any, by: Any, comm: Any) -> Any:
            return whole(points, replace(by, **{term: np.zeros_like(getattr(by, term))}), comm)

        patch.setattr(mortar_derivative, "mortar_points_pulled_back", part)

    return drop


def without_heights(patch: Patch) -> None:
    """Take the gaps of true surfaces for those of facets."""

    def none(surface: Any, hit: Any, by_gap: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros((len(by_gap), surface.dim)), np.zeros_like(surface.points)

    patch.setattr(mortar_derivative, "_gaps_pulled_back", none)


@pytest.mark.parametrize(
    ("name", "term"),
    [
        ("hexahedra", without_mortar),
        ("hexahedra", without("left")),
        ("hexahedra", without("normal")),
        ("facets", without("gap")),
        ("Tresca", without("area")),
        ("chain", without_mortar),
        ("chain", without_heights),
        ("chain", without("left")),
    ],
)
def test_every_term_counts(name: str, term: Callable[[Patch], None]) -> None:
    here, judge = line(name), OBJECTIVES[name]["stress"]
    assert here.miss(judge) < 1e-5
    # Designs along the normal change weights and areas little.
    assert miss_without(term, here, judge) > 1e3 * max(here.miss(judge), 1e-8)


def test_default_settings_are_as_good() -> None:
    scene, here = BLOCKS["hexahedra"](), line("hexahedra")
    blocks = ShapeProblem(ContactProblem(scene, MPI.COMM_SELF), designs_of(scene), TotalPotential())
    slope = blocks(here.alpha)[1] @ here.direction
    ahead, behind = (blocks.value_of(here.alpha + sign * 1e-4 * here.direction) for sign in (1.0, -1.0))
    assert slope == pytest.approx((ahead - behind) / 2e-4, rel=1e-3)

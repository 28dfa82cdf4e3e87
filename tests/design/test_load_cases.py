"""One design under several loads: values, subgradients, what the cases share, and what is no case."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, Scene, Support, minimize
from fenics_contact.design import LoadCases
from fenics_contact.errors import InvalidInputError
from tests.design.blocks import RUBBER
from tests.design.load_cases_on_ranks import WEIGHTS, cases_of


@cache
def cases(weighted: bool) -> LoadCases:
    return cases_of(MPI.COMM_SELF, WEIGHTS if weighted else None)


def design(seed: int, size: float) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal(cases(True).size)


@pytest.mark.parametrize("weighted", [True, False])
def test_the_subgradient_agrees_with_central_differences(weighted: bool) -> None:
    both, alpha, v, step = cases(weighted), design(0, 0.003), design(1, 1.0), 1e-5

    def value(s: float) -> float:
        values = both.values_of(alpha + s * step * v)
        return (
            sum(WEIGHTS[name] * each for name, each in values.items()) if weighted else max(values.values())
        )

    found, gradient = both(alpha)
    assert found == pytest.approx(value(0.0), rel=1e-9)
    assert gradient @ v == pytest.approx((value(1.0) - value(-1.0)) / (2 * step), rel=1e-5)


def test_the_cases_of_a_design_share_meshes_matrices_and_factors() -> None:
    states = list(cases(True).states_of(design(2, 0.002)).values())
    pieces = [state.dual.inverse.operators for state in states]
    for other in pieces[1:]:
        assert all(mine is theirs for mine, theirs in zip(pieces[0], other, strict=True))
    assert states[0].torn.points is states[1].torn.points, "another load needs no search for contact"
    moved = cases(True).states_of(design(3, 0.002))["pressed"].dual.inverse.operators
    assert any(mine is not theirs for mine, theirs in zip(pieces[0], moved, strict=True))


def test_the_other_cases_are_told_with_their_gradients() -> None:
    both, alpha = cases(False), design(6, 0.002)
    value, _ = both(alpha)
    values, gradients = both.pieces(alpha)
    alone = sorted(both.values_of(alpha).values())
    assert [*sorted(values), value] == pytest.approx(alone, rel=1e-9)
    first = both.problems["pressed"].known(alpha)
    assert first is not None
    assert any(np.array_equal(first.gradient, each) for each in gradients) or first.value == value
    assert cases(True).pieces(alpha)[0].size == 0


def test_a_minimum_of_the_largest_case_lies_above_each_case_alone() -> None:
    both, bounds = cases(False), (-0.004, 0.004)
    start = both(np.zeros(both.size))[0]
    result = minimize(both, np.zeros(both.size), bounds=bounds)
    values = both.values_of(result.x)
    assert result.value == pytest.approx(max(values.values()), rel=1e-8)
    assert result.value < start - 1e-3 * abs(start)


def test_a_gradient_near_an_earlier_design_is_that_of_the_case_which_is_largest_there() -> None:
    known = cases(False).problems
    dragged = known["dragged"].case(known["dragged"].scene, 1.6 * known["dragged"].objective)
    either = LoadCases({"pressed": known["pressed"].case(known["pressed"].scene), "dragged": dragged})
    largest = []
    for seed in (1, 0, 8, 4):  # the second is neither the first design, nor the best, nor the last
        either(design(seed, 0.004))
        values = {name: each.value_of(design(seed, 0.004)) for name, each in either.problems.items()}
        largest.append(max(values, key=values.__getitem__))
    assert largest == ["dragged", "pressed", "dragged", "dragged"]
    alpha = design(0, 0.004)
    found = either.gradient_near(alpha, alpha + 1e-9 * design(10, 1.0))
    np.testing.assert_allclose(found, known["pressed"](alpha)[1], rtol=1e-4, atol=1e-6)


def test_what_was_stored_is_recalled() -> None:
    first = cases_of(MPI.COMM_SELF, None)
    first(design(4, 0.002))
    again = cases_of(MPI.COMM_SELF, None)
    again.recall(first.memory())
    assert first.fingerprint() == again.fingerprint()
    assert (again.products, again.evaluations) > (0, 0)
    value, gradient = again(design(5, 0.002))
    expected, known = first(design(5, 0.002))
    assert value == pytest.approx(expected, rel=1e-9)
    np.testing.assert_allclose(gradient, known, rtol=1e-6, atol=1e-9 * np.abs(known).max())


@pytest.mark.parametrize("weighted", [True, False])
def test_the_best_design_of_all_cases_is_kept_and_found_again(weighted: bool) -> None:
    both = cases_of(MPI.COMM_SELF, WEIGHTS if weighted else None)
    values = [both(design(seed, 0.003))[0] for seed in (0, 1, 2)]
    assert both.first is not None
    assert both.best is not None
    assert (both.first.value, both.best.value, both.evaluations) == (values[0], min(values), 3)
    assert both.best.parts.keys() == both.problems.keys()
    solved = both.products
    assert both.at(both.best.alpha) is both.best
    assert both.products == solved
    again = cases_of(MPI.COMM_SELF, WEIGHTS if weighted else None)
    again.recall(both.memory())
    assert again.evaluations == 3
    assert again.best is not None
    assert again.best.value == pytest.approx(min(values), rel=1e-9)
    np.testing.assert_array_equal(again.best.alpha, both.best.alpha)


def test_two_ranks_find_the_same(mpirun: Callable[..., str]) -> None:
    script = Path(__file__).with_name("load_cases_on_ranks.py")
    value, gradient = cases_of(MPI.COMM_SELF, None)(design(0, 0.002))
    found = np.array(mpirun(script, 2).split(), dtype=float)
    np.testing.assert_allclose(found, [value, *gradient], rtol=1e-6)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda s: {"bodies": {"lower": s.bodies["lower"]}, "loads": [], "contacts": []},
            "have the same bodies, got",
        ),
        (
            lambda s: {
                "bodies": {**s.bodies, "upper": Body(s.bodies["upper"].mesh, RUBBER.__class__(7.0, 0.1))}
            },
            "'upper' has others",
        ),
        (
            lambda s: {"supports": [Support("lower", "z0", (0.0, None, 0.0))]},
            "the same components of 'lower'",
        ),
    ],
)
def test_what_is_no_load_case_is_refused(change: Callable[[Scene], Any], words: str) -> None:
    first = cases(True).problems["pressed"]
    with pytest.raises(InvalidInputError, match=words):
        first.case(replace(first.scene, **change(first.scene)))


def test_cases_that_share_nothing_are_refused() -> None:
    own, other = cases(True).problems["pressed"], cases(False).problems["dragged"]
    with pytest.raises(InvalidInputError, match=r"not so 'other': use problem\.case"):
        LoadCases({"own": own, "other": other})
    with pytest.raises(InvalidInputError, match="LoadCases needs a problem"):
        LoadCases({})
    with pytest.raises(InvalidInputError, match=r"must name the cases \['own'\], got \['one'\]"):
        LoadCases({"own": own}, {"one": 1.0})
    with pytest.raises(InvalidInputError, match="must be finite numbers"):
        LoadCases({"own": own}, {"own": float("nan")})

"""A scene or a design is a function of its parameters, for tools that know nothing of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Coulomb, DesignResponse, Scene, SceneResponse, Support
from fenics_contact.errors import InfeasibleError, InvalidDesignError, InvalidInputError
from fenics_contact.gallery import rectangle
from tests.design.blocks import block_on_floor, problem
from tests.study.pushed import NOMINAL, PUSH, QUANTITIES, response, scene


def test_parameters_may_be_named_or_come_in_an_array_or_stay_nominal() -> None:
    block = response()
    assert block.parameters == ("friction", "load", "modulus")
    by_name, by_array = block(load=900.0), block([0.3, 900.0, 2e5])
    assert block({"load": 700.0}, load=900.0).parameters == by_name.parameters == by_array.parameters
    assert by_name["force"] == pytest.approx(900.0, rel=1e-5)
    assert by_name["friction force"] == pytest.approx(PUSH, rel=1e-5)
    np.testing.assert_allclose(by_array.array, by_name.array, rtol=1e-5)
    assert block()["force"] == pytest.approx(NOMINAL["load"], rel=1e-5)


def test_a_warm_start_finds_the_same_with_less_work_whatever_changes() -> None:
    warm, cold = response(tolerance=1e-9), response(tolerance=1e-9, warm=False)
    samples = [{}, {"load": 1010.0}, {"friction": 0.29}, {"modulus": 1e5}, {"load": 990.0, "friction": 0.31}]
    answers = [(warm(sample), cold(sample)) for sample in samples]
    for near, far in answers:
        np.testing.assert_allclose(near.array, far.array, rtol=1e-6)
    assert len({round(near["largest pressure"], 3) for near, _ in answers}) > 3, "nothing depends on them"
    assert warm.products < cold.products
    assert (warm.evaluations, cold.evaluations) == (5, 5)


def test_a_table_holds_the_answers_to_its_rows() -> None:
    samples = np.array([[0.3, 1000.0, 2e5], [0.4, 800.0, 2e5]])
    table = response().table(samples)
    assert table.shape == (2, len(QUANTITIES))
    np.testing.assert_allclose(table[:, 0], samples[:, 1], rtol=1e-5)
    assert response().table(np.zeros((0, 3))).shape == (0, len(QUANTITIES))


def test_a_state_that_does_not_exist_raises_or_is_nan_and_the_next_one_is_found() -> None:
    with pytest.raises(InfeasibleError, match="every body must be held by supports, contact or friction"):
        response()(friction=0.19)
    block = response(failures="nan")
    before, slid, after = block(friction=0.21), block(friction=0.19), block(friction=0.21)
    assert np.isnan(slid.array).all()
    assert "must be held" in slid.failure
    assert (before.failure, after.failure) == ("", "")
    np.testing.assert_allclose(after.array, before.array, rtol=1e-5)


def test_another_mesh_or_support_is_decomposed_anew() -> None:
    meshes = {n: rectangle((0, 0), (2, 1), (n, 4)) for n in (6, 10)}

    def build(cells: float, held: float) -> Scene:
        template = scene(0.3, 1000.0, 2e5)
        body = template.bodies["block"]
        supports = [Support("block", "x0", (0.0, None))] if held else []
        return Scene(
            {"block": type(body)(meshes[int(cells)], body.material)},
            supports,
            template.loads,
            template.contacts,
        )

    block = SceneResponse(build, {"cells": 6, "held": 0}, QUANTITIES, MPI.COMM_SELF)
    assert block()["friction force"] == pytest.approx(PUSH, rel=1e-5)
    assert block(cells=10)["friction force"] == pytest.approx(PUSH, rel=1e-5)
    assert block(held=1)["friction force"] < 0.99 * PUSH


def test_a_design_gives_its_objective_with_a_subgradient() -> None:
    moving = problem(block_on_floor(Coulomb(0.3), load=(0.6, 0.1, -4.0)))
    judged = DesignResponse(moving, {"peak": lambda state: state.contact.pressure.max()}, failures="nan")
    assert judged.quantities == ("objective", "peak")
    alpha = 0.01 * np.random.default_rng(3).standard_normal(moving.size)
    answer = judged(alpha)
    value, gradient = moving(alpha)
    assert answer["objective"] == pytest.approx(value, rel=1e-8)
    np.testing.assert_allclose(answer.subgradients["objective"], gradient, rtol=1e-5, atol=1e-8)
    assert np.abs(gradient).max() > 1e-3
    assert answer["peak"] > 0.0
    assert answer.products > 0
    assert judged(alpha, **{"alpha 0": 0.02}).parameters["alpha 0"] == 0.02
    failed = judged(np.linspace(-9.0, 9.0, moving.size))
    assert np.isnan(failed["objective"])
    assert failed.subgradients == {}
    with pytest.raises(InvalidDesignError, match="the design cannot be meshed"):
        DesignResponse(moving)(np.linspace(-9.0, 9.0, moving.size))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"parameters": [1.0]},
            r"must have shape \(3,\), one number for each of .* got \(1,\)",
        ),
        ({"parameters": {"mu": 0.3}}, r"must be some of \['friction', 'load', 'modulus'\], got \['mu'\]"),
        ({"load": np.nan}, "must be finite, got nan for 'load'"),
    ],
)
def test_parameters_that_are_none_are_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        response(failures="nan")(**arguments)


def test_a_response_that_cannot_answer_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="failures must be 'raise' or 'nan', got 'ignore'"):
        response(failures="ignore")
    with pytest.raises(InvalidInputError, match="needs at least one parameter, got none: name them"):
        SceneResponse(scene, {}, QUANTITIES, MPI.COMM_SELF)
    with pytest.raises(InvalidInputError, match="needs at least one quantity of interest, got none"):
        SceneResponse(scene, NOMINAL, {}, MPI.COMM_SELF)
    vector = SceneResponse(scene, NOMINAL, {"all": lambda state: state.contact.pressure}, MPI.COMM_SELF)
    with pytest.raises(InvalidInputError, match=r"one number, 'all' has shape \(9,\): take its"):
        vector()
    with pytest.raises(InvalidInputError, match=r"samples must have shape \(n, 3\), .* got \(3,\)"):
        response().table([0.3, 1.0, 2.0])

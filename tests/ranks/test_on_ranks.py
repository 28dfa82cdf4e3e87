"""What fails on one rank alone, or is another one there, ends on all ranks with one error."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import run_on_ranks
from tests.ranks.on_ranks import CASES  # type: ignore[attr-defined]

SCRIPT = Path(__file__).with_name("on_ranks.py")
BUG = "failed with RuntimeError: a bug on one rank ("
EXIT = "failed with SystemExit: a bug on one rank ("
SAME = "all ranks must be given the same, but on rank 0 and rank {last} differ "
#: Class and part of the message on every rank.
EXPECTED = {
    "support_raises": ("UserCodeError", f"component 0 of the support of surface 'x0' {BUG}"),
    "support_is_nan": ("InvalidInputError", "surface 'x0' must return finite numbers of shape (8,)"),
    "support_differs": ("InvalidInputError", f"{SAME}scene.supports[0] at some nodes (float64 array"),
    "traction_raises": ("UserCodeError", f"the function given as Traction on body 'block' {BUG}"),
    "traction_exits": ("UserCodeError", f"the function given as Traction on body 'block' {EXIT}"),
    "traction_is_interrupted": ("KeyboardInterrupt", "a bug on one rank"),
    "traction_has_another_shape": ("InvalidInputError", "of shape (8, 3) for points of shape (8, 3), got"),
    "traction_differs_as_a_function": ("InvalidInputError", f"{SAME}scene.loads[0] at some nodes"),
    "body_force_raises": ("UserCodeError", f"the function given as BodyForce on body 'block' {BUG}"),
    "temperature_raises": ("UserCodeError", f"the function given as ThermalStrain on body 'block' {BUG}"),
    "ufl_raises": ("UserCodeError", f"the function given as Ufl of Pressure on body 'block' {BUG}"),
    "ufl_exits": ("UserCodeError", f"the function given as Ufl of Pressure on body 'block' {EXIT}"),
    "ufl_differs": ("InvalidInputError", f"{SAME}the form of pressure, UFL, hexahedron ("),
    "friction_raises": (
        "UserCodeError",
        f"the function given as friction of block z0 on rigid plane {BUG}",
    ),
    "friction_differs_as_a_function": (
        "InvalidInputError",
        f"{SAME}friction given as functions of position (float64 array",
    ),
    "path_raises": ("UserCodeError", f"the path of MovingObstacle {BUG}"),
    "path_raises_where_a_step_is_cut": ("UserCodeError", f"the path of MovingObstacle {BUG}"),
    "distance_raises": ("UserCodeError", f"the normals of DistanceObstacle {BUG}"),
    "distance_is_nan": (
        "InvalidInputError",
        "the distance of DistanceObstacle must be one finite number per point",
    ),
    "distance_differs": ("InvalidInputError", f"{SAME}what ContactPair 0 asks its obstacle, Distance"),
    "gradient_raises": ("UserCodeError", f"the normals of DistanceObstacle {BUG}"),
    "gradient_is_nan": ("InvalidInputError", "with a gradient of length one, got nan at"),
    "gradient_has_another_shape": ("InvalidInputError", "must have shape (12, 3), got (12,)"),
    "own_obstacle_raises": ("UserCodeError", f"the normals of OwnFloor {BUG}"),
    "own_obstacle_is_nan": ("InvalidInputError", "the normals of OwnFloor must be finite numbers"),
    "kernel_raises": ("UserCodeError", f"the kernel of material OwnMaterial {BUG}"),
    "kernel_exits": ("UserCodeError", f"the kernel of material OwnMaterial {EXIT}"),
    "kernel_is_nan": ("InvalidInputError", "kernel(points) of OwnMaterial must return finite modes"),
    "late_kernel_raises": ("UserCodeError", f"the kernel of material OwnMaterial {BUG}"),
    "stress_raises": ("UserCodeError", f"the UFL of material OwnMaterial {BUG}"),
    "stress_is_nan": ("InvalidInputError", "numbers in UFL must be finite, got nan in the form of stiffness"),
    "parameters_differ": ("InvalidInputError", f"{SAME}parameters of OwnMaterial in body 'block'[0] (121."),
    "energy_raises": ("UserCodeError", f"the UFL of material OwnEnergy {BUG}"),
    "stress_of_a_field_raises": ("UserCodeError", f"the UFL of material LateStress {BUG}"),
    "log_handler_raises": ("nothing", "True"),
    "load_differs": ("InvalidInputError", f"{SAME}scene.loads[0].value[2] (-1.0, -2.0)"),
    "friction_differs": (
        "InvalidInputError",
        f"{SAME}scene.contacts[0].friction.friction_coefficient (0.3, 0.4)",
    ),
    "modulus_differs": (
        "InvalidInputError",
        f"{SAME}scene.bodies['block'].material.young_modulus (210.0, 211.0)",
    ),
    "coordinates_differ": ("InvalidInputError", f"{SAME}scene.bodies['block'].mesh.points (float64 array"),
    "topology_differs": ("InvalidInputError", f"{SAME}scene.bodies['block'].mesh.points (float64 array"),
    "partition_differs": ("InvalidInputError", f"{SAME}partitions['block'] (int64 array"),
    "tolerance_differs": ("InvalidInputError", f"{SAME}tolerance (1e-08, 0.0001)"),
    "solver_differs": ("InvalidInputError", f"{SAME}solver.max_products (900, 7)"),
    "bodies_are_in_another_order": (
        "InvalidInputError",
        f"{SAME}the order of entries (scene.bodies['block'],",
    ),
    "scene_is_refused": ("InvalidInputError", "needs shape (27,), got (26,)"),
    "checkpoint_cannot_be_written": ("CheckpointError", "could not be written: No such file"),
    "checkpoint_on_one_rank_only": ("InvalidInputError", f"{SAME}steps['checkpoint (every, resume)'] (None,"),
    "steps_differ": ("InvalidInputError", f"{SAME}scene.loads[0].value[2] (-2.0, -3.0)"),
    "a_step_is_missing": ("InvalidInputError", f"{SAME}steps['count'] (2, 1)"),
    "a_step_is_refused": ("InvalidInputError", "Traction names surface 'nowhere' of body 'block'"),
    "quantity_raises": ("UserCodeError", f"quantity 'force' of a response {BUG}"),
    "quantity_raises_before_others_gather": ("UserCodeError", f"quantity 'force' of a response {BUG}"),
    "quantity_writes_on_one_rank": ("UserCodeError", "response failed with OSError: no space on one rank ("),
    "quantity_stops_the_run": ("Enough", "this will do"),
    "quantity_exits": ("SystemExit", "a bug on one rank"),
    "quantity_is_no_number": ("InvalidInputError", "must be one number, 'force' is 'none': return a float"),
    "response_is_not_built": ("UserCodeError", f"the function that builds the scene of a response {BUG}"),
    "parameters_of_a_response_differ": ("InvalidInputError", f"{SAME}scene.loads[0].value[2] (-2.0, -3.0)"),
    "response_goes_on_after_a_failure": ("nothing", "0.47"),
    "contact_objective_raises": ("UserCodeError", f"ContactForces.function {BUG}"),
    "contact_objective_is_nan": ("InvalidInputError", "must return finite numbers, got others"),
    "integrand_raises": ("UserCodeError", f"the integrand of 'squares' {BUG}"),
    "own_objective_raises": ("UserCodeError", f"the objective {BUG}"),
    "curvatures_raise": ("UserCodeError", f"the curvatures of OwnFloor {BUG}"),
    "variables_differ": ("InvalidInputError", f"{SAME}alpha (float64 array of shape (4,)"),
    "variables_are_nan": ("InvalidInputError", "alpha must be finite, got nan in entry 0"),
    "callback_raises": ("UserCodeError", f"the callback of a minimisation {BUG}"),
    "callback_exits": ("SystemExit", "a bug on one rank"),
    "starts_differ": ("InvalidInputError", f"{SAME}alpha (float64 array of shape (4,)"),
}
#: On three ranks two hear of the third, and two agree where the third differs.
ON_THREE = (
    "traction_exits",
    "ufl_raises",
    "distance_is_nan",
    "late_kernel_raises",
    "log_handler_raises",
    "modulus_differs",
    "bodies_are_in_another_order",
    "a_step_is_missing",
    "quantity_raises_before_others_gather",
    "callback_raises",
)
#: Seconds that a case may take, also where forms are compiled and cores are shared.
SECONDS = 30.0

Found = dict[str, list[dict[str, Any]]]


def found_on(ranks: int, *cases: str) -> Found:
    """Run cases and return what each rank has met."""
    lines = run_on_ranks(SCRIPT, ranks, *cases, timeout=600.0, fresh=True).splitlines()
    return dict(json.loads(line) for line in lines if line.startswith('["'))


@pytest.fixture(scope="module")
def on_two() -> Found:
    return found_on(2)


@pytest.fixture(scope="module")
def on_three() -> Found:
    return found_on(3, *ON_THREE)


def check(case: str, every: list[dict[str, Any]]) -> None:
    """All ranks met the same, within seconds; only the others say whose it was."""
    kinds, text = EXPECTED[case]
    last = len(every) - 1
    assert {met["kind"] for met in every} == set(kinds.split())
    assert all(text.format(last=last) in met["text"] for met in every), every
    assert max(met["seconds"] for met in every) < SECONDS
    if kinds == "UserCodeError":
        assert [met["text"].endswith(f"(met on rank {last})") for met in every] == [True] * last + [False]
        assert every[last]["cause"] != "NoneType", "the cause is chained where there is one"


def test_every_case_is_expected() -> None:
    assert set(CASES) == set(EXPECTED)
    assert len(CASES) > 27


@pytest.mark.parametrize("case", EXPECTED)
def test_all_ranks_end_with_the_same_error(on_two: Found, case: str) -> None:
    check(case, on_two[case])


@pytest.mark.parametrize("case", ON_THREE)
def test_three_ranks_end_with_the_same_error(on_three: Found, case: str) -> None:
    check(case, on_three[case])

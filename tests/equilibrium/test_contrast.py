"""Stiff beside soft: the work does not grow with the contrast of the materials."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    RigidPlane,
    Scene,
    State,
    Status,
    Support,
    Surface,
    Traction,
    box_partition,
    solve_scene,
)
from fenics_contact.gallery import rectangle_lattice
from fenics_contact.materials import PlaneStrain
from fenics_contact.qp import FaceNewton
from tests.equilibrium.checks import assert_solved
from tests.equilibrium.contrast import FRICTION, Blocks, Regions

CONTRASTS = (1.0, 30.0, 1000.0)


BLOCKS = [
    *(Blocks(soft, slave, law) for soft in ("lower", "upper") for slave in ("lower", "upper")
      for law in (None, FRICTION)),
    *(Blocks(soft, "upper", FRICTION, "mortar") for soft in ("lower", "upper")),
]  # fmt: skip
REGIONS = [
    Regions(soft, axis, inside, law)
    for law in (None, FRICTION) for axis in (2, 0) for inside in (False, True) for soft in "ab"
]  # fmt: skip
Case = Blocks | Regions


@cache
def solved(case: Case, contrast: float) -> State:
    scene = case.scene(contrast)
    cuts = {name: box_partition(body.mesh, (2, 2, 2)) for name, body in scene.bodies.items()}
    return solve_scene(scene, MPI.COMM_SELF, partitions=cuts, tolerance=1e-6 if scene.contacts else 1e-10)


def products(case: Case) -> list[int]:
    even = replace(case, soft="lower" if isinstance(case, Blocks) else "a")  # nothing is soft at contrast 1
    states = [solved(even, 1.0), *(solved(case, contrast) for contrast in CONTRASTS[1:])]
    return [state.counts["f_products"] for state in states]


@pytest.mark.parametrize("case", BLOCKS, ids=str)
def test_work_does_not_grow_with_the_contrast_of_two_bodies(
    case: Blocks, record_property: Callable[[str, object], None]
) -> None:
    work = products(case)
    record_property("F-products for contrasts 1, 30, 1000", work)
    assert 5 < work[0] < 40
    assert max(work) <= 2.5 * work[0]


@pytest.mark.parametrize("case", REGIONS, ids=str)
def test_work_hardly_grows_with_the_contrast_of_two_regions(
    case: Regions, record_property: Callable[[str, object], None]
) -> None:
    work = products(case)
    record_property("F-products for contrasts 1, 30, 1000", work)
    assert 5 < work[0] < 40
    # Subdomains half soft, half stiff side by side on a floor: the first active sets are far off.
    hard = case.inside and case.axis == 0 and case.friction is not None
    assert max(work) <= (7.0 if hard else 2.5) * work[0]


@pytest.mark.parametrize("case", [*BLOCKS, *REGIONS], ids=str)
def test_the_answer_at_the_largest_contrast_is_right(case: Case) -> None:
    state = solved(case, CONTRASTS[-1])
    assert_solved(state, 1e-6)
    if case.friction is not None:
        contact = state.contact
        up = contact.force.sum(axis=0)[2] * (-1 if isinstance(case, Blocks) and case.slave == "lower" else 1)
        assert up == pytest.approx(0.01 * (0.81 if isinstance(case, Blocks) else 1.0), rel=1e-4)
        assert contact.count(Status.STICK) + contact.count(Status.SLIP) > 10


@pytest.mark.parametrize("slave", ["lower", "upper"])
def test_a_stiff_body_on_one_a_million_times_softer_takes_no_more_work(slave: str) -> None:
    """Contact with the soft one alone holds the stiff one: rows of so little stiffness still are rows."""
    case = Blocks("lower", slave, FRICTION)
    state = solved(case, 1e6)
    assert_solved(state, 1e-6)
    assert state.counts["f_products"] < 2.5 * solved(case, 1.0).counts["f_products"]


def test_jumps_of_soft_parts_are_sharpened_and_contact_forces_left_as_sharp_as_they_are() -> None:
    """At a contrast of 1e6 jumps need five more digits than contact forces can have."""
    scene = Regions("b", 0, True, FRICTION).scene(1e6)
    cuts = {name: box_partition(body.mesh, (2, 3, 2)) for name, body in scene.bodies.items()}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cuts, solver=FaceNewton(tolerance=1e-9))
    assert_solved(state, 1e-9)
    assert state.counts["f_products"] < 100


def test_a_stiff_body_acts_on_a_soft_one_as_a_rigid_one() -> None:
    """The answer nears that on a rigid plane, and its distance falls as the contrast grows."""
    case = Blocks("upper", "upper", None)
    scene = case.scene(1.0)
    floor = ContactPair(Surface("upper", "z0"), RigidPlane((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)))
    supports = [support for support in scene.supports if support.body == "upper"]
    upper = scene.bodies["upper"]
    rigid = Scene({"upper": upper}, supports, scene.loads, [floor])
    expected = solve_scene(
        rigid, MPI.COMM_SELF, partitions={"upper": box_partition(upper.mesh, (2, 2, 2))}, tolerance=1e-6
    )
    u = expected.gather_displacement("upper")
    states = [solved(case, contrast) for contrast in (1.0, 100.0, 1000.0)]
    errors = [np.abs(state.gather_displacement("upper") - u).max() / np.abs(u).max() for state in states]
    assert errors[0] > 0.2
    assert errors[2] < 0.002
    assert errors[1] / errors[2] == pytest.approx(10.0, rel=0.2)


@pytest.mark.parametrize("contrast", [1e2, 3629.4, 1e4, 1e6])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_soft_and_stiff_parts_held_side_by_side_have_an_answer(cell: str, contrast: float) -> None:
    """All rows are those of supports, where nothing moves: jumps are last digits of the soft part."""
    mesh = rectangle_lattice(([0.0, 1.0687, 2.4541], [0.0, 0.6813, 1.9366]), cell)
    top, middle = mesh.surfaces["y1"], mesh.points[mesh.cells].mean(axis=1)
    stiff = (middle[:, 0] < 1.0687) & (middle[:, 1] > 0.6813)
    over = {"over": top[mesh.points[top].mean(axis=1)[:, 0] < 1.0687]}
    regions = {"soft": np.flatnonzero(~stiff), "stiff": np.flatnonzero(stiff)}
    mesh = BodyMesh(mesh.points, mesh.cells, mesh.surfaces | over, regions=regions)
    materials = {"soft": PlaneStrain(2e4, 0.13), "stiff": PlaneStrain(contrast * 2e4, 0.13)}
    pushed = Traction("a", "over", lambda x: (1.0 + 0.56 * x[:, :1]) * np.array([5.17, -19.9]))
    scene = Scene({"a": Body(mesh, materials)}, [Support("a", "x0", (0.0, 0.0))], [pushed])
    state = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-8).solve(adjoint=True)
    assert_solved(state, 1e-8)
    force = 1.0687 * (1.0 + 0.28 * 1.0687) * np.array([5.17, -19.9])
    np.testing.assert_allclose(state.reactions()["a x0"].force, -force, rtol=1e-10)

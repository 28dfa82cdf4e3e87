"""Stiff beside soft: the work does not grow with the contrast of the materials."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.contact import State, Status, solve_scene
from fenics_contact.gallery import block
from fenics_contact.partition import box_partition
from fenics_contact.scene import (
    Body,
    ContactPair,
    Coulomb,
    Discretisation,
    IsotropicElasticity,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Traction,
)
from tests.contact.checks import assert_solved
from tests.contact.gallery import crowned

CONTRASTS = (1.0, 10.0, 100.0, 1000.0)
#: Cells along an edge of a block, which is cut into 2 x 2 x 2 subdomains.
CELLS = 6
FRICTION = Coulomb(0.4)


def elastic(young: float) -> IsotropicElasticity:
    return IsotropicElasticity(young, 0.3)


@dataclass(frozen=True)
class Blocks:
    """A crowned block on a clamped one, pressed so that the soft one yields by a hundredth.

    Attributes:
        soft: Which block is soft.
        slave: Which block is the slave.
        friction: With friction the upper block is pushed as well, without it guides hold it.
        discretisation: Of the contact pair.
    """

    soft: str
    slave: str
    friction: Coulomb | None
    discretisation: Discretisation = "node"

    def scene(self, contrast: float) -> Scene:
        law = {name: elastic(1.0 if name == self.soft else contrast) for name in ("lower", "upper")}
        counts = (CELLS,) * 3
        lower, upper = block((0, 0, 0), (1, 1, 1), counts), block((0.05, 0.05, 1), (0.95, 0.95, 1.9), counts)
        bodies = {"lower": Body(lower, law["lower"]), "upper": Body(crowned(upper, 0.005), law["upper"])}
        faces = Surface("upper", "z0"), Surface("lower", "z1")
        pair = ContactPair(*faces[:: 1 if self.slave == "upper" else -1], self.friction, self.discretisation)  # type: ignore[call-arg]
        supports = [Support("lower", "z0")]
        if self.friction is None:
            supports += [Support("upper", "x0", (0.0, None, None)), Support("upper", "y0", (None, 0.0, None))]
        push = 0.0 if self.friction is None else 0.003
        return Scene(bodies, supports, [Traction("upper", "z1", (push, 0.0, -0.01))], [pair])


@dataclass(frozen=True)
class Regions:
    """A block of two materials, clamped, or on a rigid floor with friction that alone holds it.

    Attributes:
        soft: Which half is soft: the lower one, or where halves stand side by side the left one, is "a".
        axis: Normal of the plane between them.
        inside: Whether the plane runs through subdomains, and not between them.
        friction: Law on the floor; None clamps the block.
    """

    soft: str
    axis: int
    inside: bool
    friction: Coulomb | None

    def scene(self, contrast: float) -> Scene:
        mesh = block((0, 0, 0), (1, 1, 1), (CELLS,) * 3)
        middle = mesh.points[mesh.cells].mean(axis=1)[:, self.axis]
        first = middle < 0.5 + self.inside / CELLS
        mesh = replace(mesh, regions={"a": np.flatnonzero(first), "b": np.flatnonzero(~first)})
        body = Body(mesh, {region: elastic(1.0 if region == self.soft else contrast) for region in "ab"})
        load = Traction("block", "z1", (0.002, 0.0, -0.01))
        if self.friction is None:
            return Scene({"block": body}, [Support("block", "z0")], [load])
        floor = ContactPair(
            Surface("block", "z0"), RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), self.friction
        )
        return Scene({"block": body}, [], [load], [floor])


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
    return [solved(case, contrast).counts["f_products"] for contrast in CONTRASTS]


@pytest.mark.parametrize("case", BLOCKS, ids=str)
def test_work_does_not_grow_with_the_contrast_of_two_bodies(
    case: Blocks, record_property: Callable[[str, object], None]
) -> None:
    work = products(case)
    record_property("F-products for contrasts 1, 10, 100, 1000", work)
    assert 5 < work[0] < 40
    assert max(work) <= 2.5 * work[0]


@pytest.mark.parametrize("case", REGIONS, ids=str)
def test_work_hardly_grows_with_the_contrast_of_two_regions(
    case: Regions, record_property: Callable[[str, object], None]
) -> None:
    work = products(case)
    record_property("F-products for contrasts 1, 10, 100, 1000", work)
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
    states = [solved(case, contrast) for contrast in CONTRASTS]
    errors = [np.abs(state.gather_displacement("upper") - u).max() / np.abs(u).max() for state in states]
    assert errors[0] > 0.2
    assert errors[3] < 0.002
    assert errors[2] / errors[3] == pytest.approx(10.0, rel=0.2)

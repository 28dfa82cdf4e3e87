"""Quantities by name, and the resultants among them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    LinearState,
    RigidPlane,
    Scene,
    Status,
    Support,
    Surface,
    Tie,
    Traction,
    contact_area,
    goal_error,
    quantity,
)
from fenics_contact._adaptive.quantities import QUANTITIES
from fenics_contact._adaptive.resultants import PairForce, StickArea, SupportForce, TouchingArea
from fenics_contact.design import (
    ContactArea,
    FrictionWork,
    LargestStress,
    Movement,
    MovementNear,
    Objective,
    PeakPressure,
    StrainEnergy,
    StressNear,
    TotalPotential,
)
from fenics_contact.design.adjoint import WeakChoice, linearise_face, solve_adjoint
from fenics_contact.design.forms import ShapeForms
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import rectangle
from tests.adaptive.goals import RUBBER, on_floor, on_waves, punched, solved

FLOOR, PUNCH = on_floor(4), punched(1)
KNOWN: list[tuple[str, Scene, dict[str, Any], Objective]] = [
    ("peak_pressure", FLOOR, {}, PeakPressure()),
    ("peak_pressure", PUNCH, {"surface": "upper y0"}, PeakPressure(0)),
    ("contact_force", FLOOR, {"direction": (0, 1)}, PairForce(0, (0.0, 1.0))),
    ("contact_area", PUNCH, {"surface": "upper y0 on lower y1"}, TouchingArea(0)),
    ("effective_area", PUNCH, {}, ContactArea()),
    ("stick_area", FLOOR, {}, StickArea(0)),
    ("friction_work", FLOOR, {}, FrictionWork()),
    (
        "reaction",
        PUNCH,
        {"surface": "lower y0", "direction": (0, 1)},
        SupportForce("lower", "y0", (0.0, 1.0)),
    ),
    (
        "displacement",
        FLOOR,
        {"surface": "block y1", "direction": (1, 0)},
        Movement("block", "y1", (1.0, 0.0)),
    ),
    (
        "displacement",
        FLOOR,
        {"at": (1, 0.5), "direction": (1, 0)},
        MovementNear("block", (1.0, 0.5), 0.1, direction=(1.0, 0.0)),
    ),
    ("stress", FLOOR, {}, LargestStress("block")),
    (
        "stress",
        PUNCH,
        {"body": "lower", "at": (0, -1), "component": "yy", "radius": 0.5},
        StressNear("lower", (0.0, -1.0), 0.5, "yy"),
    ),
    ("strain_energy", FLOOR, {}, StrainEnergy()),
    ("potential", FLOOR, {}, TotalPotential()),
]


@pytest.mark.parametrize(("name", "scene", "where", "expected"), KNOWN)
def test_names_mean_objectives(name: str, scene: Scene, where: dict[str, Any], expected: Objective) -> None:
    assert quantity(name, scene, **where) == expected


def test_every_name_has_a_case_here() -> None:
    assert {name for name, *_ in KNOWN} == set(QUANTITIES)


REFUSED: list[tuple[str, Scene, dict[str, Any], str]] = [
    ("pressure", FLOOR, {}, r"a quantity needs a name out of peak_pressure, .* got 'pressure'"),
    ("peak_pressure", PUNCH, {"surface": "upper y9"}, r"which has 'upper y0 on lower y1'; got 'upper y9'"),
    (
        "reaction",
        FLOOR,
        {"direction": (1, 0)},
        r"this quantity needs a surface, one of 'block .*give surface=",
    ),
    (
        "displacement",
        FLOOR,
        {"surface": "top", "direction": (1, 0)},
        r"a surface of the scene, got 'top', which",
    ),
    ("stress", PUNCH, {"at": (0, 0)}, r"this quantity needs a body, one of 'upper', 'lower'"),
    ("stress", PUNCH, {"body": "left", "at": (0, 0)}, r"a body of the scene, got 'left', which has 'upper'"),
    ("contact_force", FLOOR, {}, r"this quantity needs a direction, such as \(1, 0\) or \(0, 1\)"),
    ("strain_energy", FLOOR, {"body": "block"}, r"strain_energy takes nothing else, got body: leave it out"),
]


@pytest.mark.parametrize(("name", "scene", "where", "message"), REFUSED)
def test_what_is_missing_unknown_or_not_taken_is_refused(
    name: str, scene: Scene, where: dict[str, Any], message: str
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        quantity(name, scene, **where)


def glued() -> Scene:
    """A block on a floor with another one tied on top, whose meshes do not match; one side holds both."""
    scene = on_floor(4)
    top = Body(rectangle((0.0, 1.0), (2.0, 1.5), (5, 2)), RUBBER)
    load = Traction("top", "y1", (5.0, -20.0))
    return replace(
        scene,
        bodies={**scene.bodies, "top": top},
        supports=[*scene.supports, Support("top", "x0", (0.0, None))],
        loads=[load],
        ties=[Tie(Surface("top", "y0"), Surface("block", "y1"))],
    )


def sloping() -> Scene:
    """A block on a slope, held at a side whose lowest node presses on the slope, too."""
    scene = on_floor(4)
    mesh = scene.bodies["block"].mesh
    x, y = mesh.points.T
    pair = replace(scene.contacts[0], master=RigidPlane((0.0, 0.0), (0.2, 1.0)))
    moved = Body(mesh.moved(np.column_stack([x, y - 0.2 * x])), RUBBER)
    return replace(scene, bodies={"block": moved}, contacts=[pair])


SCENES = {"slope": sloping, "floor": lambda: on_floor(4), "punch": lambda: punched(1), "glued": glued}
FORCES: list[tuple[str, Any]] = [
    ("floor", PairForce(0, (0.6, 0.8))),
    ("floor", SupportForce("block", "x0", (1.0, 0.0))),
    ("slope", SupportForce("block", "x0", (1.0, 0.0))),
    ("punch", PairForce(0, (0.0, 1.0))),
    ("punch", SupportForce("upper", "y1", (0.6, 0.8))),
    ("glued", SupportForce("block", "x0", (1.0, 0.0))),
    ("glued", SupportForce("top", "x0", (1.0, 0.0))),
]


@cache
def state(name: str) -> LinearState:
    return solved(SCENES[name]())


def without_shape(state: LinearState) -> ShapeForms:
    return ShapeForms.at_rest(state.torn)


@pytest.mark.parametrize(("name", "force"), FORCES)
def test_resultants_are_sums_over_multipliers(name: str, force: Any) -> None:
    found = state(name)
    partials = force.partials(found, without_shape(found))
    assert abs(partials.value) > 0.1
    assert partials.by_multiplier @ found.rows.multiplier == pytest.approx(partials.value, rel=1e-7)


def test_forces_of_pairs_and_supports_balance() -> None:
    forms = without_shape(state("punch"))
    forces = [SupportForce(*place, (0, 1)) for place in (("upper", "y1"), ("lower", "y0"))]
    above, below = (force.value(state("punch"), forms) for force in forces)
    assert above == pytest.approx(-below)
    assert PairForce(0, (0, 1)).value(state("punch"), forms) == pytest.approx(below)


@pytest.mark.parametrize("force", [PairForce(0, (0.6, 0.8)), SupportForce("block", "x0", (1.0, 0.0))])
def test_adjoints_of_resultants_agree_with_differences_by_the_load(force: Any) -> None:
    """dJ = w · df where loads grow: some points stick and some slip."""
    here, step = state("floor"), 1e-4
    assert {Status.STICK, Status.SLIP} <= set(here.contact.status)
    forms, (load,) = without_shape(here), here.scene.loads
    adjoint = solve_adjoint(here, force.partials(here, forms), linearise_face(here, WeakChoice.RELEASED))
    sides = [
        replace(load, value=lambda x, part=part: load.value(x) + part * np.array([1.0, -2.0]))
        for part in (step, -step)
    ]
    more, less = (solved(replace(here.scene, loads=[side]), tolerance=1e-11) for side in sides)
    quotient = (force.value(more, forms) - force.value(less, forms)) / (2.0 * step)
    slope = adjoint.displacement @ (more.torn.load - less.torn.load) / (2.0 * step)
    assert abs(quotient) > 0.1
    assert slope == pytest.approx(quotient, rel=1e-5)


def test_forces_have_no_derivatives_by_the_shape() -> None:
    for force in (PairForce(0, (0, 1)), SupportForce("block", "x0", (1, 0))):
        with pytest.raises(InvalidInputError, match="has no derivative by the shape: take ContactForces"):
            force.partials(state("floor"), ShapeForms(MPI.COMM_SELF))


def test_forces_of_what_is_not_there_are_refused() -> None:
    forms = without_shape(state("floor"))
    with pytest.raises(
        InvalidInputError, match="SupportForce needs a supported surface, got 'block y1': the"
    ):
        SupportForce("block", "y1", (1, 0)).value(state("floor"), forms)
    with pytest.raises(InvalidInputError, match=r"PairForce.pair must be the number of a contact pair"):
        PairForce(3, (1, 0)).value(state("floor"), forms)


def test_the_area_that_sticks_has_no_adjoint() -> None:
    here = state("floor")
    contact, found = here.contact, goal_error(here, StickArea(0))
    area = contact.area[contact.status == Status.STICK].sum()
    assert found.value == pytest.approx(area, abs=0.2)
    assert 0.0 < found.value < 2.0
    assert found.without_adjoint.startswith("an area changes by the statuses")
    assert (found.known, np.isnan(found.total)) == (0.0, True)
    assert np.all(found.by_cell("block") > 0.0)
    with pytest.raises(InvalidInputError, match="StickArea has no derivatives"):
        StickArea(0).partials(here, without_shape(here))
    with pytest.raises(InvalidInputError, match="StickArea needs friction, contact pair 0 has none"):
        goal_error(solved(on_waves(4)), StickArea(0))


def test_the_area_that_touches_is_that_of_results() -> None:
    here = solved(on_waves(6))
    found = goal_error(here, TouchingArea())
    assert found.value == contact_area(here)
    assert 0.0 < found.value < ContactArea().value(here, without_shape(here)) * 1.5
    assert found.value == goal_error(here, TouchingArea(0)).value
    assert found.without_adjoint.startswith("an area changes by the statuses")
    with pytest.raises(InvalidInputError, match=r"TouchingArea has no derivatives.*take ContactArea"):
        TouchingArea().partials(here, without_shape(here))
    with pytest.raises(InvalidInputError, match=r"TouchingArea.pair must be the number of a contact pair"):
        TouchingArea(3).value(here, without_shape(here))

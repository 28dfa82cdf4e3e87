"""How accurately states of designs are solved, and which designs may overlap before they are loaded."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    AutomaticSteps,
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    RigidPlane,
    Scene,
    SceneResponse,
    ShapeProblem,
    Support,
    Surface,
    SurfaceDesign,
    TangentNewton,
    minimize,
)
from fenics_contact.design import BundleTrust, LoadCases, Movement, Remeshed
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import Material, NeoHooke, PlaneStrain
from fenics_contact.qp import FaceNewton
from fenics_contact.shapes import Plane

STEEL, RUBBER = PlaneStrain(100.0, 0.3), NeoHooke(1.0, 0.3)
#: A design whose middle lies inside the floor, by more than facets explain.
DEEP = np.array([0.0, 0.2, 0.0])


def pressed(material: Material, floor: float = 0.0) -> Scene:
    """A block pressed and dragged on a floor."""
    pair = ContactPair(Surface("b", "y0"), RigidPlane((0.0, floor), (0.0, 1.0)), Coulomb(0.3))
    support = Support("b", "y1", (0.08, -0.1))
    return Scene({"b": Body(rectangle((0, 0), (2, 1), (8, 4)), material)}, [support], [], [pair])


def designed(scene: Scene, **more: object) -> ShapeProblem:
    contact = ContactProblem(scene, MPI.COMM_SELF, **more)  # type: ignore[arg-type]
    return ShapeProblem(contact, SurfaceDesign("b", "y0", net=3), Movement("b", "x1", (1.0, 0.3)))


@pytest.mark.parametrize(
    ("settings", "wanted"),
    [
        ({}, 1e-8),
        ({"steps": AutomaticSteps(TangentNewton(tolerance=1e-12))}, 1e-12),
        ({"steps": AutomaticSteps(TangentNewton(tolerance=1e-12)), "tolerance": 1e-4}, 1e-4),
    ],
)
def test_states_of_rubber_are_solved_to_newtons_tolerance(settings: dict[str, object], wanted: float) -> None:
    problem = designed(pressed(RUBBER), **settings)
    assert problem.evaluate(0.1 * DEEP).tolerance == wanted == problem.contact.number()
    assert problem.last.state.solution.residuals.worst < wanted  # type: ignore[union-attr]


def test_other_states_are_solved_to_the_tolerance_of_their_solver() -> None:
    assert designed(pressed(STEEL)).evaluate(0.1 * DEEP).tolerance == FaceNewton().tolerance
    assert designed(pressed(STEEL), solver=FaceNewton(1e-9)).evaluate(0.1 * DEEP).tolerance == 1e-9
    response = SceneResponse(
        lambda floor: pressed(RUBBER, floor), {"floor": 0.0},
        {"force": lambda state: state.contact.normal_force.sum()}, MPI.COMM_SELF,
    )  # fmt: skip
    assert response()["force"] > 0.0
    assert response.state is not None
    assert response.state.solution.residuals.worst < TangentNewton().tolerance


def test_a_new_mesh_is_solved_as_the_first_one() -> None:
    problem = designed(pressed(RUBBER), steps=AutomaticSteps(TangentNewton(tolerance=1e-11)))
    far = Remeshed(problem, share=0.95)
    far.evaluate(DEEP)
    assert len(far.remeshings) > 0
    assert {each.contact.number() for each in far.problems} == {1e-11}


@pytest.mark.parametrize("material", [STEEL, RUBBER], ids=["steel", "rubber"])
def test_designs_may_overlap_whichever_is_the_first(material: Material) -> None:
    settings = {"tolerance": 1e-10}
    one, other = (designed(pressed(material), **settings) for _ in range(2))
    one.evaluate(np.zeros(3))
    value = one.evaluate(DEEP).value
    assert other.evaluate(DEEP).value == pytest.approx(value, rel=1e-7)
    assert other.scene_of(DEEP).points[:, 1].min() < -0.05


@pytest.mark.parametrize("first", [np.zeros(3), -1.5 * DEEP], ids=["as given", "apart"])
def test_a_shape_that_is_given_may_not_overlap_whichever_design_is_the_first(first: np.ndarray) -> None:
    floor = pressed(STEEL, floor=0.1)
    with pytest.raises(InvalidInputError, match=r"bodies must not overlap at the start: .* of 'b' lie up to"):
        designed(floor).evaluate(first)
    apart = designed(pressed(STEEL))
    apart.evaluate(first)
    with pytest.raises(InvalidInputError, match=r"bodies must not overlap at the start"):
        apart.case(replace(apart.scene, contacts=floor.contacts)).evaluate(first)


def test_overlaps_are_told_of_the_last_design_alone(caplog: pytest.LogCaptureFixture) -> None:
    scene = replace(pressed(STEEL), supports=[Support("b", "y1", (0.0, -0.002))])
    problem = designed(scene)
    method = BundleTrust(tolerance=1e-2, max_evaluations=4, raise_on_failure=False)
    with caplog.at_level(logging.WARNING):
        result = minimize(problem, DEEP / 2, method, bounds=(0.05 * DEEP - 1e-3, 0.6 * DEEP + 1e-3))
    overlaps = [record.getMessage() for record in caplog.records if "overlap" in record.getMessage()]
    assert result.evaluations > 1
    assert len(overlaps) == 1
    assert overlaps[0].startswith("at the end of the minimisation: surfaces of b y0 on rigid plane overlap")
    cases = LoadCases({"one": problem, "two": problem.case(scene)})
    assert set(cases.remarks(result.x)) == set(problem.remarks(result.x))
    assert problem.remarks(-DEEP) == ()


@pytest.mark.parametrize("material", [STEEL, RUBBER], ids=["steel", "rubber"])
@pytest.mark.parametrize("given", [{}, {"gap": 0.0}])
def test_doubts_about_a_surface_are_told_of_the_shape_given_alone(
    given: dict[str, float], material: Material, caplog: pytest.LogCaptureFixture
) -> None:
    scene = pressed(material)
    off = scene.bodies["b"].mesh.with_shapes({"y0": Plane((0.0, -1e-4), (0.0, -1.0))})
    pair = replace(scene.contacts[0], **given)  # type: ignore[arg-type]
    problem = designed(replace(scene, bodies={"b": Body(off, material)}, contacts=[pair]))
    with caplog.at_level(logging.WARNING):
        for size in (0.05, 0.1, 0.15):
            problem.evaluate(size * DEEP)
    words = [record.getMessage() for record in caplog.records if "off its shape" in record.getMessage()]
    assert len(words) == 1

"""Plane bodies with a thickness: forces are those of all of it, stresses as in the plate."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    ElasticFoundation,
    PointForce,
    Pressure,
    Scene,
    State,
    Support,
    Surface,
    ThermalStrain,
    TotalForce,
    Traction,
    box_partition,
    solve_scene,
)
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import Material, OrthotropicPlaneStress, PlaneStrain, PlaneStress
from fenics_contact.results.linear_state import as_linear
from tests.materials.bodies import bent, in_halves
from tests.materials.elements import PLANE, load_by_node, whole
from tests.scenes import Load

THIN, THICK = 0.5, 2.0


def halves(material: Any, cell: str = "quadrilateral", counts: tuple[int, int] = (4, 2)) -> Body:
    """A bar of 2 x 1, its left half thin and its right half thick."""
    mesh = in_halves(rectangle((0, 0), (2, 1), counts, cell))
    return Body(mesh, {"left": material(THIN), "right": material(THICK)})


def solved(body: Body, *loads: Load, boxes: tuple[int, int] = (1, 1), **more: Any) -> State:
    scene = Scene({"bar": body}, [Support("bar", "x0", (0.0, 0.0))], loads)
    pieces = {"bar": box_partition(body.mesh, boxes)}
    return solve_scene(scene, MPI.COMM_SELF, partitions=pieces, tolerance=1e-11, **more)


@pytest.mark.parametrize("boxes", [(1, 1), (2, 2), (4, 1)])
@pytest.mark.parametrize("cell", PLANE)
@pytest.mark.parametrize(
    "material",
    [
        lambda t: PlaneStress(100.0, 0.0, thickness=t),
        lambda t: PlaneStrain(100.0, 0.0, thickness=t),
        lambda t: OrthotropicPlaneStress((100.0, 100.0), 0.0, 50.0, 0.0, thickness=t),
    ],
    ids=["plane stress", "plane strain", "orthotropic"],
)
def test_a_bar_of_two_thicknesses_has_two_stresses_and_one_force(
    material: Any, cell: str, boxes: tuple[int, int]
) -> None:
    state = solved(halves(material, cell), TotalForce("bar", "x1", (3.0, 0.0)), boxes=boxes)
    tip = state.gather_displacement("bar")[state.scene.bodies["bar"].mesh.surfaces["x1"], 0]
    np.testing.assert_allclose(tip, 3.0 / 100.0 * (1 / THIN + 1 / THICK), rtol=1e-8)
    stress = state.gather_stress("bar")[:, 0, 0]
    wanted = 3.0 / state.scene.bodies["bar"].thickness_of_cells
    np.testing.assert_allclose(stress, wanted, rtol=1e-7)
    np.testing.assert_allclose(state.reactions()["bar x0"].force, [-3.0, 0.0], atol=1e-7)


@pytest.mark.parametrize("cell", PLANE)
def test_loads_act_on_all_of_the_thickness(cell: str) -> None:
    """Per area and volume: times the thickness behind it; at nodes and as a resultant: as given."""
    body = halves(lambda t: PlaneStress(100.0, 0.3, thickness=t), cell)
    mesh = replace(body.mesh, surfaces={**body.mesh.surfaces}, node_sets={"corner": np.array([0])})
    body = replace(body, mesh=mesh)

    def resultant(load: Load) -> np.ndarray:
        return load_by_node(whole(body, (load,))).sum(axis=0)

    np.testing.assert_allclose(
        resultant(Pressure("cell", "y1", 3.0)), [0.0, -3.0 * (THIN + THICK)], atol=1e-13
    )
    np.testing.assert_allclose(
        resultant(Traction("cell", "x1", (3.0, 1.0))), [3.0 * THICK, THICK], atol=1e-13
    )
    np.testing.assert_allclose(
        resultant(BodyForce("cell", (0.0, 3.0))), [0.0, 3.0 * (THIN + THICK)], atol=1e-13
    )
    by_region = resultant(BodyForce("cell", (0.0, 3.0), "left"))
    np.testing.assert_allclose(by_region, [0.0, 3.0 * THIN], atol=1e-13)
    np.testing.assert_allclose(resultant(TotalForce("cell", "x0", (3.0, 1.0))), [3.0, 1.0], atol=1e-13)
    np.testing.assert_allclose(resultant(PointForce("cell", "corner", (3.0, 1.0))), [3.0, 1.0], atol=1e-13)


@pytest.mark.parametrize("model", [PlaneStress, PlaneStrain])
def test_one_thickness_multiplies_forces_and_energies_alone(model: Any) -> None:
    """Against the same plate per unit of thickness, on cells that are no parallelograms."""
    mesh = bent(rectangle((0, 0), (2, 1), (4, 2)))

    def state(thickness: float | None) -> State:
        loads = [Traction("bar", "x1", (0.3, 0.1)), BodyForce("bar", (0.1, -0.2)), ThermalStrain("bar", 10.0)]
        return solved(Body(mesh, model(100.0, 0.3, 1e-4, thickness)), *loads)

    unit, thick = state(None), state(THICK)
    wanted = unit.gather_displacement("bar")
    np.testing.assert_allclose(thick.gather_displacement("bar"), wanted, atol=1e-9 * np.abs(wanted).max())
    np.testing.assert_allclose(thick.gather_stress("bar"), unit.gather_stress("bar"), atol=1e-8)
    force, energy = (each.reactions()["bar x0"].force for each in (unit, thick)), unit.energies.strain
    np.testing.assert_allclose(*[f * t for f, t in zip(force, (THICK, 1.0), strict=True)], rtol=1e-7)
    assert thick.energies.strain == pytest.approx(THICK * energy, rel=1e-8)
    ways = [
        as_linear(each, "errors").estimate_errors(geometry=False).discretisation for each in (unit, thick)
    ]
    assert ways[1] == pytest.approx(ways[0], rel=1e-6)


def test_a_free_bar_of_two_thicknesses_expands_without_stress() -> None:
    body = halves(lambda t: PlaneStress(100.0, 0.3, 1e-3, t))
    scene = Scene(
        {"bar": body},
        [Support("bar", "x0", (0.0, None)), Support("bar", "y0", (None, 0.0))],
        [ThermalStrain("bar", 5.0)],
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-11)
    np.testing.assert_allclose(state.gather_displacement("bar"), 5e-3 * body.mesh.points, atol=1e-10)
    assert np.abs(state.gather_stress("bar")).max() < 1e-7


def blocks(upper: float, lower: float) -> Scene:
    """A block on another one, with 6 N on top."""

    def body(low: float, high: float, thickness: float) -> Body:
        mesh: BodyMesh = rectangle((0, low), (2, high), (4, 2))
        return Body(mesh, PlaneStress(100.0, 0.0, thickness=thickness))

    return Scene(
        {"low": body(0, 1, lower), "up": body(1, 2, upper)},
        [Support("low", "y0"), Support("up", "x0", (0.0, None))],
        [TotalForce("up", "y1", (0.0, -6.0))],
        [ContactPair(Surface("up", "y0"), Surface("low", "y1"))],
    )


def test_the_contact_pressure_is_that_on_the_slave() -> None:
    state = solve_scene(blocks(THIN, THICK), MPI.COMM_SELF, tolerance=1e-11)
    np.testing.assert_allclose(state.contact.normal_force.sum(), 6.0, rtol=1e-8)
    np.testing.assert_allclose(state.contact.pressure, 6.0 / (2.0 * THIN), rtol=1e-7)
    np.testing.assert_allclose(state.gather_stress("low")[:, 1, 1], -6.0 / (2.0 * THICK), rtol=1e-7)
    assert state.scene.dimension_record == {"dimension": 2, "thickness": True}
    np.testing.assert_allclose(state.contact.points.sizes.sum(), 2.0, rtol=1e-12)


def test_what_has_no_thickness_is_refused() -> None:
    thick: Material = PlaneStress(100.0, 0.3, thickness=THICK)
    with pytest.raises(InvalidInputError, match=r"thickness must be a positive number, got -1"):
        PlaneStress(100.0, 0.3, thickness=-1.0)
    mesh = in_halves(rectangle((0, 0), (2, 1), (4, 2)))
    with pytest.raises(InvalidInputError, match=r"all materials of a body must have a thickness or none"):
        Body(mesh, {"left": thick, "right": PlaneStress(100.0, 0.3)})
    scene = blocks(THIN, THICK)
    bodies = {**scene.bodies, "low": replace(scene.bodies["low"], material=PlaneStress(1.0, 0.0))}
    with pytest.raises(
        InvalidInputError, match=r"must have a thickness or none, got \['.*'\] but not \['low'\]"
    ):
        replace(scene, bodies=bodies)
    with pytest.raises(InvalidInputError, match=r"an ElasticFoundation of plane bodies needs materials"):
        replace(scene, foundations=[ElasticFoundation("low", "y0", 1.0)])
    with pytest.raises(
        InvalidInputError, match=r"the surface of a TotalForce must have one thickness, .*0.5, 2"
    ):
        solved(halves(lambda t: PlaneStress(100.0, 0.3, thickness=t)), TotalForce("bar", "y1", (0.0, 1.0)))
    several = halves(lambda t: PlaneStress(100.0, 0.3, thickness=t))
    with pytest.raises(
        InvalidInputError, match=r"the slave of .* must have one thickness, surface 'y0' has 0.5, 2"
    ):
        replace(scene, bodies={**scene.bodies, "up": several})

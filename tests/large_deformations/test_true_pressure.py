"""True pressures of bodies that deform much are those of the Cauchy stress beside them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    BodyMesh,
    ContactPair,
    DeformedState,
    RigidPlane,
    Scene,
    State,
    Status,
    Support,
    Surface,
    contact_area,
    solve_scene,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import Material, NeoHooke, PlaneStrain
from fenics_contact.mesh import quadratic
from fenics_contact.pictures.curves import contact_trace
from tests.large_deformations.scenes import RUBBER, pressed, rounded

MODULUS, PART = 1.0, 0.6


def between_plates(mesh: BodyMesh, material: Material, faces: tuple[str, ...] = ()) -> State:
    """A block of height 1 between lubricated plates, pressed to 0.6 of its height, on one face or several."""
    dim = mesh.dim
    supports = [Support("block", "x0", (0.0, *[None] * (dim - 1)))]
    if dim == 3:
        supports.append(Support("block", "y0", (None, 0.0, None)))
    low, high = ("y0", "y1") if dim == 2 else ("z0", "z1")
    supports.append(Support("block", high, (*[None] * (dim - 1), PART - 1.0)))
    floor = RigidPlane((0.0,) * dim, (*[0.0] * (dim - 1), 1.0))
    pairs = [ContactPair(Surface("block", face), floor) for face in faces or (low,)]
    scene = Scene({"block": Body(mesh, material)}, supports, contacts=pairs)
    return solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)


@cache
def squeezed() -> State:
    rubber = NeoHooke(MODULUS, 0.4999, mean_dilatation=True)
    return between_plates(rectangle((0, 0), (2, 1), (6, 3)), rubber)


def cauchy(state: State, body: str) -> np.ndarray:
    """Cauchy's normal traction -n·σ·n at the slave nodes, from the stress around them."""
    stress, normal = state.gather_nodal_stress(body)[0], state.contact.points.normal
    dim = normal.shape[1]
    own = stress[state.contact.points.slave, :dim, :dim]
    return np.asarray(-np.einsum("nd,nde,ne->n", normal, own, normal))


def test_an_incompressible_block_presses_with_its_stress() -> None:
    """It is 1/λ times as wide and presses with E/3 (1/λ² − λ²) where λ is left of its height."""
    state = squeezed()
    contact, exact = state.contact, MODULUS / 3.0 * (PART**-2 - PART**2)
    np.testing.assert_allclose(contact.pressure, cauchy(state, "block"), rtol=1e-7)
    np.testing.assert_allclose(contact.pressure, exact, rtol=1e-3)
    np.testing.assert_allclose(contact.nominal_pressure * PART, contact.pressure, rtol=1e-3)
    assert contact.area.sum() == pytest.approx(2.0 / PART, rel=1e-3)
    assert contact.nominal_area.sum() == pytest.approx(2.0, rel=1e-12)
    assert contact_area(state) == pytest.approx(contact.area.sum(), rel=1e-9)


def test_quadratic_cells_press_with_their_stress_at_midpoints() -> None:
    mesh = quadratic(block((0, 0, 0), (2, 1, 1), (2, 1, 1), "tetrahedron"))
    state = between_plates(mesh, RUBBER)
    contact, stress = state.contact, state.gather_stress("block")[:, 2, 2]
    np.testing.assert_allclose(stress, stress[0], rtol=1e-7)
    np.testing.assert_allclose(contact.pressure, -stress[0], rtol=1e-7)
    assert contact.area.sum() > 1.2 * contact.nominal_area.sum()
    assert contact_area(state) == pytest.approx(contact.area.sum(), rel=1e-7)


def test_a_node_on_the_edge_of_two_pairs_has_the_deformed_area_of_both() -> None:
    mesh = rectangle((0, 0), (2, 1), (6, 3))
    edges = mesh.surfaces["y0"]
    halves = replace(mesh, surfaces={**mesh.surfaces, "left": edges[:2], "right": edges[2:]})
    contact = between_plates(halves, RUBBER, ("left", "right")).contact
    whole = between_plates(mesh, RUBBER).contact
    np.testing.assert_allclose(contact.pressure, whole.pressure[0], rtol=1e-7)
    np.testing.assert_allclose(contact.area.sum(), whole.area.sum(), rtol=1e-9)


def test_fields_pictures_and_words_tell_both_pressures() -> None:
    state = squeezed()
    contact, fields = state.contact, state.gather_fields("block").points
    assert contact.nominal_pressure.max() > 1.6 * contact.pressure.max()
    mine = contact.points.slave
    np.testing.assert_array_equal(fields["contact_pressure"][mine], contact.pressure)
    np.testing.assert_array_equal(fields["contact_nominal_pressure"][mine], contact.nominal_pressure)
    assert isinstance(state, DeformedState)
    found = state.contact_nominal_pressure["block"].x.array
    assert found.max() == pytest.approx(contact.nominal_pressure.max(), rel=1e-12)
    assert contact_trace(state, 0).pressure.max() == pytest.approx(contact.pressure.max(), rel=1e-12)
    words = f"pressure up to {contact.pressure.max():.5g}, nominal {contact.nominal_pressure.max():.5g}"
    assert words in str(state)


def test_friction_has_true_and_nominal_tractions() -> None:
    contact = solve_scene(pressed(rounded(3), 0.4, 0.1, friction=0.1), MPI.COMM_SELF).contact
    stretch, slips = contact.area / contact.nominal_area, contact.status == Status.SLIP
    assert stretch.max() > 1.03
    size = np.linalg.norm(contact.traction, axis=1)
    assert np.count_nonzero(slips) > 3
    np.testing.assert_allclose(size[slips], 0.1 * contact.pressure[slips], rtol=1e-6)
    np.testing.assert_allclose(contact.traction * stretch[:, None], contact.nominal_traction, rtol=1e-12)


def sector(through: int, around: int) -> BodyMesh:
    """The right half of a ring with the radii 17.5 and 35."""
    radii, angles = (
        np.linspace(17.5, 35.0, through + 1),
        np.linspace(-np.pi / 2, np.pi / 2, around + 1),
    )
    points = radii[:, None, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    number = np.arange((through + 1) * (around + 1)).reshape(through + 1, around + 1)
    here, ahead = number[:, :-1], number[:, 1:]
    cells = np.stack([here[:-1], here[1:], ahead[1:], ahead[:-1]], axis=-1).reshape(-1, 4)
    surfaces = {
        "inner": np.stack([ahead[0], here[0]], axis=-1),
        "outer": np.stack([here[-1], ahead[-1]], axis=-1),
        "first": np.stack([number[:-1, 0], number[1:, 0]], axis=-1),
        "last": np.stack([number[1:, -1], number[:-1, -1]], axis=-1),
    }
    return BodyMesh(points.reshape(-1, 2), cells, surfaces)


def test_a_rubber_roller_presses_with_its_stress_the_better_the_finer() -> None:
    """A thick tyre on a hub that goes down by almost half of its thickness: pressures of two kinds differ."""
    misses = []
    for cells in ((5, 36), (10, 72)):
        rubber = NeoHooke(0.275, 0.475, mean_dilatation=True)
        supports = [Support("roller", side, (0.0, None)) for side in ("first", "last")]
        supports.append(Support("roller", "inner", (0.0, -8.0)))
        floor = ContactPair(Surface("roller", "outer"), RigidPlane((0.0, -35.0), (0.0, 1.0)))
        scene = Scene({"roller": Body(sector(*cells), rubber)}, supports, contacts=[floor])
        state = solve_scene(scene, MPI.COMM_SELF)
        contact, stress = state.contact, cauchy(state, "roller")
        well_in = contact.pressure > 0.2 * contact.pressure.max()
        misses.append(np.abs(contact.pressure - stress)[well_in].max() / stress.max())
        assert contact.nominal_pressure.max() > 1.5 * stress.max()
        force = contact.normal_force.sum()
        assert contact.pressure @ contact.area == pytest.approx(force, rel=1e-12)
        assert contact.nominal_pressure @ contact.nominal_area == pytest.approx(force, rel=1e-12)
        assert -state.reactions()[2].force[1] == pytest.approx(force, rel=1e-6)
    assert misses[1] < 0.006
    assert misses[0] > 3.0 * misses[1]


def overhanging(upper: Material, lower: Material, depth: float, left: float = -0.53) -> Scene:
    """A slave that is wider than its master on both sides, by mortar, on meshes that do not match."""
    bodies = {
        "upper": Body(rectangle((left, 0), (left + 2.94, 1), (9, 3)), upper),
        "lower": Body(rectangle((0, -1), (2, 0), (7, 3)), lower),
    }
    supports = [Support("upper", "y1", (0.0, -depth)), Support("lower", "y0", (0.0, 0.0))]
    pair = ContactPair(Surface("upper", "y0"), Surface("lower", "y1"), None, "mortar")
    return Scene(bodies, supports, contacts=[pair])


def test_pressures_at_the_rim_of_the_master_are_those_of_small_strain() -> None:
    """Points that face the master with over half of their area have that part, whatever the material."""
    rubber, hooke, depth = NeoHooke(1.0, 0.3), PlaneStrain(1.0, 0.3), 1e-7
    large, small = (
        solve_scene(overhanging(material, material, depth), MPI.COMM_SELF, tolerance=1e-12).contact
        for material in (rubber, hooke)
    )
    _, here, there = np.intersect1d(large.points.slave, small.points.slave, return_indices=True)
    share = small.area[there] / large.points.area[here]
    most, some = share > 0.5, (share > 0.5) & (share < 0.95)
    assert np.count_nonzero(some) == 1
    for pressure in (large.pressure, large.nominal_pressure):
        np.testing.assert_allclose(pressure[here][most], small.pressure[there][most], rtol=1e-5)
    np.testing.assert_array_equal(small.pressure, small.nominal_pressure)


@pytest.mark.parametrize("part", [1e-2, 1e-4])
def test_nodes_hardly_over_the_rim_of_the_master_have_no_peak_of_pressure(part: float) -> None:
    """Their force does not vanish with the part of their facet that faces the master."""
    cell = 2.94 / 9
    scene = overhanging(NeoHooke(1.0, 0.3), NeoHooke(1.0, 0.3), 0.02, left=-cell * (2.0 - part))
    contact = solve_scene(scene, MPI.COMM_SELF).contact
    assert contact.area.min() == pytest.approx(cell / 4, rel=0.05), "half of what the last node has"
    assert contact.pressure.max() < 2.0 * np.median(contact.pressure)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_pressure_on_a_slave_of_small_strain_is_nominal(discretisation: str) -> None:
    """As the stress in it is, beside rubber that deforms much."""
    scene = overhanging(PlaneStrain(2.0, 0.3), NeoHooke(1.0, 0.3), 0.1)
    pair = replace(scene.contacts[0], discretisation=discretisation)  # type: ignore[arg-type]
    contact = solve_scene(replace(scene, contacts=[pair]), MPI.COMM_SELF).contact
    assert contact.pressure.max() > 0.01
    np.testing.assert_array_equal(contact.pressure, contact.nominal_pressure)

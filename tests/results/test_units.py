"""Answers are the same in all units and far from the origin, stresses too."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    DistanceObstacle,
    Pressure,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    ThermalStrain,
    Tie,
    Traction,
    Tresca,
    solve_scene,
)
from fenics_contact.feti import DualSystem, TornSystem, build_torn_system, decompose
from fenics_contact.feti.inverse import LocalKind
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain, PlaneStress
from fenics_contact.results.deformed_state import AnyState
from tests.results.stress_cases import PEAK, composite, cylinder, lame, line_contact, punched
from tests.results.stress_cases import SCENES as STRESSED
from tests.results.stress_cases import solved as solved_stress
from tests.scenes import (
    SOFT,
    STIFF,
    block_on_plane,
    crowned,
    partitions,
    pressed_block,
    stack,
    two_blocks,
)
from tools.hard_cases.transform import in_units, turned

#: Units of length and force in which stiffness and moduli become as small and as large as can be.
UNITS = [(1e12, 1e-12), (1e-12, 1e12), (1e-12, 1e-12)]


def plates() -> Scene:
    """Two plane bodies, mortar contact."""
    lower, upper = rectangle((0.0, 0.0), (2.1, 0.7), (5, 3)), rectangle((0.2, 0.7), (1.8, 1.3), (7, 3))
    return Scene(
        {"lower": Body(lower, PlaneStrain(100.0, 0.3)), "upper": Body(upper, PlaneStress(200.0, 0.2))},
        [Support("lower", "y0", (0.0, 0.0))],
        [Traction("upper", "y1", (0.1, -1.0))],
        [ContactPair(Surface("upper", "y0"), Surface("lower", "y1"), Coulomb(0.3), "mortar")],
    )


def tied() -> Scene:
    blocks = two_blocks(None)
    pair = blocks.contacts[0]
    assert isinstance(pair.master, Surface)
    return replace(blocks, contacts=[], ties=[Tie(pair.slave, pair.master)])


def alone() -> Scene:
    """One body that supports hold: found directly."""
    held = pressed_block(None)
    return Scene(held.bodies, held.supports, [Pressure("block", "x1", 1.0)])


SCENES = {
    "two blocks": two_blocks(Coulomb(0.38)),
    "tetrahedra": two_blocks(Coulomb(0.38), "tetrahedron"),
    "a floor": block_on_plane(Tresca(1.2)),
    "a stack": stack(Coulomb(0.4), Coulomb(0.5)),
    "plates": plates(),
    "tied": tied(),
    "alone": alone(),
}


def solved(scene: Scene) -> AnyState:
    return solve_scene(scene, MPI.COMM_SELF)


@pytest.mark.parametrize("name", SCENES)
def test_forces_displacements_and_errors_are_the_same_in_all_units(name: str) -> None:
    scene = SCENES[name]
    known, last = solved(scene), list(scene.bodies)[-1]
    displacement, expected = known.gather_displacement(last), known.estimate_errors()
    for length, force in UNITS:
        found = solved(in_units(scene, length, force))
        np.testing.assert_array_equal(found.contact.status, known.contact.status)
        for mine, others, unit in (
            (found.gather_displacement(last), displacement, length),
            (found.contact.force, known.contact.force, force),
            (found.gather_von_mises(last), known.gather_von_mises(last), force / length ** (scene.dim - 1)),
        ):
            assert np.abs(mine / unit - others).max(initial=0.0) < 1e-8 * np.abs(others).max(initial=1e-300)
        assert found.solution.products == known.solution.products
        errors = found.estimate_errors()
        assert errors.discretisation == pytest.approx(expected.discretisation, rel=1e-6)
        assert errors.algebraic == pytest.approx(expected.algebraic, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("kind", [LocalKind.IMPLICIT, LocalKind.EXPLICIT])
def test_subdomains_are_factored_alike_in_all_units(kind: LocalKind) -> None:
    def system(length: float, force: float) -> DualSystem:
        scene = in_units(SCENES["two blocks"], length, force)
        torn = build_torn_system(scene, decompose(scene, partitions(scene), MPI.COMM_SELF))
        return DualSystem(torn, kind=kind)

    known = system(1.0, 1.0)
    balanced = known.problem.coarse.project(
        np.random.default_rng(0).standard_normal(len(known.torn.numbering.owned))
    )
    expected = known.problem.coarse.project(known.apply(balanced))
    for length, force in UNITS:
        other = system(length, force)
        found = known.problem.coarse.project(other.apply(balanced))
        np.testing.assert_allclose(found * force / length, expected, atol=1e-12 * np.abs(expected).max())


# The same scene far from the origin, turned, on meshes that are no powers of two: the same answer.
TURN = Rotation.from_euler("xyz", [0.3, -0.7, 1.1]).as_matrix()
SHIFTS = [1e3, 1e5, 1e6, 1e7]
WAY = np.array([1.0, -0.7, 0.4])
#: Error of a coordinate of one, relative to the size of the facets, in units of its last place.
AMPLIFIED = 100 * np.finfo(float).eps


def blocks(cells: int, cell: str = "hexahedron", discretisation: str = "node") -> Scene:
    """A crowned block on a larger one of other cells; nodes lie on edges, on corners and inside of facets."""
    lower = block((0.0, 0.0, -0.7), (2.1, 1.1, 0.0), (cells + 2, cells, 2), cell)
    upper = crowned(block((0.3, 0.0, 0.0), (1.8, 1.1, 0.8), (cells, cells, 2), cell), 0.04)
    return Scene(
        {"lower": Body(lower, STIFF), "upper": Body(upper, SOFT)},
        [Support("lower", "z0")],
        [Traction("upper", "z1", (0.4, 0.1, -2.0))],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), Coulomb(0.4), discretisation)],
    )


def shifted(scene: Scene, shift: float) -> Scene:
    """Return the scene elsewhere; obstacles are planes."""
    way = shift * WAY
    moved = scene.moved({name: body.mesh.points + way for name, body in scene.bodies.items()})
    pairs = [
        replace(pair, master=replace(pair.master, point=tuple(pair.master.point + way)))
        if isinstance(pair.master, RigidPlane)
        else pair
        for pair in moved.contacts
    ]
    return replace(moved, contacts=pairs)


def torn(scene: Scene) -> TornSystem:
    return build_torn_system(scene, decompose(scene, partitions(scene), MPI.COMM_SELF))


def solved_far(scene: Scene) -> State:
    return solve_scene(scene, MPI.COMM_SELF, partitions=partitions(scene), tolerance=1e-9)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
@pytest.mark.parametrize("cells", [3, 5, 7])
def test_no_contact_point_is_lost_far_from_the_origin(cells: int, cell: str, discretisation: str) -> None:
    scene = turned(blocks(cells, cell, discretisation), TURN)
    near = torn(scene).points
    assert near.count == (cells + 1) ** 2
    for shift in SHIFTS:
        far, noise = torn(shifted(scene, shift)).points, AMPLIFIED * shift
        np.testing.assert_array_equal(far.slave, near.slave)
        np.testing.assert_allclose(far.gap, near.gap, atol=noise)
        np.testing.assert_allclose(far.normal, near.normal, atol=10 * noise)
        np.testing.assert_allclose(far.area, near.area, rtol=10 * noise)
        np.testing.assert_allclose(far.master.toarray(), near.master.toarray(), atol=100 * noise)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_contact_forces_do_not_depend_on_where_the_scene_lies(discretisation: str) -> None:
    scene = turned(blocks(5, discretisation=discretisation), TURN)
    near = solved_far(scene).contact
    assert (near.normal_force > 0).sum() > 10
    assert (near.friction_force != 0).any()
    for shift in (1e5, 1e7):
        far = solved_far(shifted(scene, shift)).contact
        error = np.abs(far.force - near.force).max() / np.abs(near.force).max()
        assert error < 1e-6 + 1e3 * AMPLIFIED * shift


def test_forces_balance_the_load_far_from_the_origin_at_the_default_tolerance() -> None:
    scene = turned(blocks(3), TURN)
    for shift in (0.0, 1e7):
        far = shifted(scene, shift)
        state = solve_scene(far, MPI.COMM_SELF, partitions=partitions(far))
        expected = 1.5 * 1.1 * (TURN @ [0.4, 0.1, -2.0])
        np.testing.assert_allclose(-state.contact.force.sum(axis=0), expected, rtol=1e-6)


@pytest.mark.parametrize("cells", [3, 5, 7])
def test_tied_blocks_stay_together_far_from_the_origin(cells: int) -> None:
    scene = blocks(cells)
    scene = turned(replace(scene, contacts=[], ties=[Tie(*_faces(scene))]), TURN)
    near, far = solved_far(scene), solved_far(shifted(scene, 1e7))
    assert torn(shifted(scene, 1e7)).ties.count == torn(scene).ties.count > cells
    assert far.energies.strain == pytest.approx(near.energies.strain, rel=1e-6)


def _faces(scene: Scene) -> tuple[Surface, Surface]:
    return scene.contacts[0].slave, scene.contacts[0].master  # type: ignore[return-value]


@pytest.mark.parametrize("given", ["plane", "distance"])
def test_a_rigid_plane_far_from_the_origin_is_met_as_near_it(given: str) -> None:
    mesh = crowned(block((0.0, 0.0, 0.0), (1.7, 1.1, 0.9), (5, 3, 3)), 0.03)
    floor = ContactPair(Surface("block", "z0"), RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), Coulomb(0.3))
    support = Support("block", "z1", (0.01, 0.0, -0.025))
    scene = turned(Scene({"block": Body(mesh, SOFT)}, [support], contacts=[floor]), TURN)
    near = solved_far(scene).contact
    assert 0 < (near.normal_force > 0).sum() < near.points.count
    far = shifted(scene, 1e7)
    if given == "distance":
        pair = far.contacts[0]
        far = replace(far, contacts=[replace(pair, master=DistanceObstacle(pair.master.distance))])
    found = solved_far(far).contact
    assert found.points.count == near.points.count
    np.testing.assert_allclose(found.force, near.force, atol=1e-4 * np.abs(near.force).max())


def test_the_balance_of_loads_is_not_lost_in_rounding_far_from_the_origin() -> None:
    """Forces on two opposite sides of a body that nothing holds balance each other wherever it lies."""
    scene = blocks(3)
    pulls = [Traction("upper", "x0", (-1.0, 0.0, 0.0)), Traction("upper", "x1", (1.0, 0.0, 0.0))]
    scene = turned(replace(scene, loads=[*scene.loads, *pulls]), TURN)
    for shift in (0.0, 1e7):
        system = torn(shifted(scene, shift))
        load, sides = np.zeros(3), 0.0
        for part in system.subdomains:
            if part.mesh.body == "upper":
                load += part.load.reshape(-1, 3).sum(axis=0)
                sides += np.abs(part.load).sum()
        assert np.abs(load - 1.5 * 1.1 * (TURN @ [0.4, 0.1, -2.0])).max() < 1e-7 * sides


def test_rigid_motions_are_free_of_energy_far_from_the_origin() -> None:
    for shift in (0.0, 1e7):
        scene = shifted(turned(blocks(3), TURN), shift)
        for part in torn(scene).subdomains:
            K, R = part.stiffness, part.kernel
            assert np.abs(K @ R).max() < 1e-12 * K.diagonal().max()


def test_a_slave_node_whose_projection_is_not_found_is_told(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    from fenics_contact._surfaces import projection

    monkeypatch.setattr(projection, "RESIDUAL", 0.0)  # no answer of Newton's method is good enough
    scene = blocks(3)
    with (
        caplog.at_level(logging.WARNING, "fenics_contact"),
        pytest.raises(ValueError, match="none of the 16"),
    ):
        torn(scene)
    assert "16 of 16 slave nodes face their master, but no point of it was found for them" in caplog.text


@pytest.mark.parametrize("cells", [3, 5, 7])
def test_a_mortar_facet_that_only_touches_the_rim_of_its_master_is_no_contact(cells: int) -> None:
    """Beyond the rim there is nothing to meet, and rounding makes nothing of it."""
    scene = blocks(3, discretisation="mortar")
    wide = block((0.0, 0.0, 0.0), (2 * 2.1, 1.1, 0.8), (2 * cells, 4, 2))
    scene = turned(replace(scene, bodies={**scene.bodies, "upper": Body(wide, SOFT)}), TURN)
    near = torn(scene).points
    assert near.count == 5 * (cells + 1)
    for shift in (*SHIFTS, 1e9):
        np.testing.assert_array_equal(torn(shifted(scene, shift)).points.slave, near.slave)


# The stress of bodies on cells and nodes, against closed forms.
SCRIPT = Path(__file__).with_name("stress_cases.py")
COMM = MPI.COMM_SELF


def rates(errors: list[float]) -> np.ndarray:
    return np.log2(np.divide(errors[:-1], errors[1:]))


@pytest.mark.parametrize(("order", "coarsest", "rate"), [(1, 6, 1.8), (2, 3, 2.6)])
def test_the_stress_of_a_thick_cylinder_converges_to_lame(order: int, coarsest: int, rate: float) -> None:
    on_cells, on_nodes, at_wall = [], [], []
    for cells in (coarsest, 2 * coarsest, 4 * coarsest):
        scene = cylinder(cells, order=order)
        state, mesh = solved_stress(scene, COMM, 1), scene.bodies["ring"].mesh
        (nodal,) = state.gather_nodal_stress("ring")
        error = np.abs(nodal - lame(mesh.points)).max(axis=(1, 2))
        on_nodes.append(error.max())
        at_wall.append(error[np.unique(mesh.surfaces["x0"])].max())
        middle = mesh.points[mesh.cells].mean(axis=1)
        on_cells.append(np.abs(state.gather_stress("ring") - lame(middle)).max())
    assert rates(on_cells)[-1] > 1.8, on_cells
    assert rates(on_nodes)[-1] > rate, on_nodes
    assert at_wall[-1] < 0.02 * np.abs(lame(np.array([[1.0, 0.0]]))).max()


@pytest.mark.parametrize("order", [1, 2])
def test_the_stress_below_a_cylinder_converges_to_hertz(order: int) -> None:
    errors = []
    for cells in (4, 8, 16):
        scene = punched(cells // order, order=order)
        state, points = solved_stress(scene, COMM, 1), scene.bodies["block"].mesh.points
        (nodal,) = state.gather_nodal_stress("block")
        below = points[:, 1] < -0.24  # at the ends of the contact the pressure has a vertical slope
        errors.append(np.abs(nodal - line_contact(points))[below].max() / PEAK)
    # The largest shear stress lies on the axis, 0.786 half widths below the surface: 0.3 p₀.
    axis = below & (points[:, 0] == 0.0)
    shear = 0.5 * (nodal[axis, 0, 0] - nodal[axis, 1, 1])
    assert shear.max() == pytest.approx(0.3003 * PEAK, rel=0.01)
    assert points[axis][shear.argmax(), 1] == pytest.approx(-0.786, abs=0.1)
    assert rates(errors).min() > 1.0, errors
    assert errors[-1] < 0.01, errors


@pytest.mark.parametrize("material", [PlaneStrain(1000.0, 0.3), PlaneStress(1000.0, 0.3), None])
def test_a_bar_in_tension_has_one_stress_everywhere(material: PlaneStrain | PlaneStress | None) -> None:
    pull = 7.0
    if material is None:
        body = Body(block((0, 0, 0), (4, 1, 1), (5, 2, 2)), IsotropicElasticity(1000.0, 0.3))
    else:
        body = Body(rectangle((0, 0), (4, 1), (5, 2)), material)
    dim = body.mesh.dim
    rollers = [
        Support("bar", "xyz"[k] + "0", tuple(0.0 if k == j else None for j in range(dim))) for k in range(dim)
    ]
    scene = Scene({"bar": body}, rollers, [Traction("bar", "x1", (pull, *[0.0] * (dim - 1)))])
    state = solved_stress(scene, COMM)
    expected = np.zeros((3, 3))
    expected[0, 0] = pull
    if isinstance(material, PlaneStrain):
        expected[2, 2] = 0.3 * pull
    for found in (state.gather_stress("bar"), *state.gather_nodal_stress("bar")):
        np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-8)
    principal = state.principal_stress["bar"].x.array.reshape(-1, 3)
    np.testing.assert_allclose(
        principal, np.tile(np.sort(np.diag(expected))[::-1], (len(principal), 1)), atol=1e-8
    )


def test_nodes_between_two_materials_have_the_stress_of_each() -> None:
    scene = composite()
    state, mesh = solved_stress(scene, COMM), scene.bodies["bar"].mesh
    low, high = state.gather_nodal_stress("bar")
    between = np.isclose(mesh.points[:, 1], 1.0)
    assert between.sum() > 10
    for stress, mine, young in (
        (low, mesh.points[:, 1] < 1.0 + 1e-9, 1000.0),
        (high, mesh.points[:, 1] > 1.0 - 1e-9, 3000.0),
    ):
        assert np.isnan(stress[~mine]).all()
        np.testing.assert_allclose(stress[mine][:, 0, 0], young * 0.01 / 4.0, rtol=1e-8)
        assert np.abs(stress[mine][:, 1:]).max() < 1e-8


def test_principal_stresses_and_von_mises_are_those_of_the_tensor() -> None:
    state = solved_stress(STRESSED["bent"](), COMM)
    tensor = state.gather_stress("beam")
    np.testing.assert_array_equal(tensor, np.swapaxes(tensor, 1, 2))
    fields = state.gather_fields("beam").cells
    s = fields["principal_stress"]
    assert np.all(np.diff(s, axis=1) <= 0.0)
    np.testing.assert_allclose(s.sum(axis=1), np.trace(tensor, axis1=1, axis2=2), atol=1e-9)
    np.testing.assert_allclose(s[:, 0] * s[:, 1] * s[:, 2], np.linalg.det(tensor), atol=1e-6)
    equivalent = np.sqrt(0.5 * ((s - np.roll(s, 1, axis=1)) ** 2).sum(axis=1))
    # The mean of von Mises stress is above that of the mean stress, and near it in all but bent cells.
    assert np.all(equivalent <= fields["von_mises"] * (1 + 1e-9))
    assert np.median(equivalent / fields["von_mises"]) > 0.8
    xx, yy, zz, xy, yz, xz = fields["stress"].T
    np.testing.assert_array_equal(tensor[:, 0], np.stack([xx, xy, xz], axis=1))
    np.testing.assert_array_equal(tensor[:, 1:, 2], np.stack([yz, zz], axis=1))
    np.testing.assert_array_equal(tensor[:, 1, 1], yy)


def test_a_held_body_that_is_warmed_has_thermal_stress() -> None:
    young, poisson, expansion, warmer = 1000.0, 0.25, 1e-4, 30.0
    body = Body(block((0, 0, 0), (2, 1, 1), (4, 2, 2)), IsotropicElasticity(young, poisson, expansion))
    sides = [
        Support("body", "xyz"[k] + side, tuple(0.0 if k == j else None for j in range(3)))
        for k in range(3)
        for side in "01"
    ]
    state = solved_stress(Scene({"body": body}, sides, [ThermalStrain("body", warmer)]), COMM)
    pressure = young * expansion * warmer / (1 - 2 * poisson)
    for found in (state.gather_stress("body"), *state.gather_nodal_stress("body")):
        np.testing.assert_allclose(found, np.broadcast_to(-pressure * np.eye(3), found.shape), atol=1e-8)


def test_stresses_are_the_same_on_two_ranks(mpirun: Callable[..., str]) -> None:
    answers = json.loads(mpirun(SCRIPT, 2, "composite", "cylinder"))
    assert len(answers) == 2
    for name, found in answers.items():
        state = solved_stress(STRESSED[name](), COMM)
        (body,) = state.scene.bodies
        cells, nodes = state.gather_stress(body), np.nan_to_num(state.gather_nodal_stress(body), nan=-7.0)
        assert np.abs(cells).max() > 1.0
        np.testing.assert_allclose(found["cells"], cells.ravel(), atol=1e-8)
        np.testing.assert_allclose(found["nodes"], nodes.ravel(), atol=1e-8)
        assert found["principal"] == pytest.approx(state.principal_stress[body].x.array.max(), rel=1e-9)


def test_a_far_body_has_the_same_stress() -> None:
    scene = STRESSED["bent"]()
    mesh = scene.bodies["beam"].mesh
    far = scene.moved({"beam": mesh.points + 1e4})
    near_stress, far_stress = (solved_stress(each, COMM).gather_nodal_stress("beam") for each in (scene, far))
    np.testing.assert_allclose(far_stress, near_stress, rtol=0, atol=1e-6 * np.abs(near_stress).max())

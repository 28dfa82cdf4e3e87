"""Supports on contact nodes: half models, surfaces that supports move, and those they press together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    LoadStep,
    RigidPlane,
    Scene,
    Status,
    Support,
    Surface,
    Traction,
    box_partition,
    solve_scene,
    solve_steps,
)
from fenics_contact._scene.parts import surface_of
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti import TornSystem, build_torn_system, decompose
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.qp import FaceNewton
from fenics_contact.results.deformed_state import AnyState

STEEL = IsotropicElasticity(1000.0, 0.3)
TOLERANCE = 1e-9
FACES = Surface("upper", "z0"), Surface("lower", "z1")


def stack(width: float, cells: int, discretisation: str = "node") -> Scene:
    """A narrow block pushed along a wide one; of a half model the plane y = 0 is one of symmetry."""
    low = -width if cells > 4 else 0.0
    lower = block((0, low, 0), (2, width, 1), (5, cells, 2))
    upper = block((0.1, low, 1), (1.9, width, 2), (4, cells, 2))
    supports = [Support("lower", "z0")]
    if low == 0.0:
        supports += [Support(name, "y0", (None, 0.0, None)) for name in ("lower", "upper")]
    return Scene(
        {"lower": Body(lower, STEEL), "upper": Body(upper, STEEL)},
        supports,
        [Traction("upper", "z1", (3.0, 0.0, -10.0))],
        [ContactPair(*FACES, Coulomb(0.35), discretisation)],
    )


def solved(scene: Scene) -> AnyState:
    cut = {name: box_partition(body.mesh, (2, 1, 1)) for name, body in scene.bodies.items()}
    return solve_scene(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=TOLERANCE))


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_half_a_model_gives_half_the_answer(discretisation: str) -> None:
    half, whole = solved(stack(1.0, 4, discretisation)), solved(stack(1.0, 8, discretisation))
    assert half.energies.total_potential == pytest.approx(0.5 * whole.energies.total_potential, rel=1e-6)
    assert half.energies.friction == pytest.approx(0.5 * whole.energies.friction, rel=1e-4)
    points = whole.scene.bodies["upper"].mesh.points
    right = np.flatnonzero(points[:, 1] >= -1e-12)
    mine = half.scene.bodies["upper"].mesh.points
    place = [int(np.argmin(np.linalg.norm(mine - point, axis=1))) for point in points[right]]
    expected = whole.gather_displacement("upper")[right]
    found = half.gather_displacement("upper")[place]
    assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()
    for status in (Status.STICK, Status.SLIP):
        assert half.contact.count(status) > 0


def test_a_symmetry_plane_through_the_contact_costs_no_products() -> None:
    half, whole = solved(stack(1.0, 4)), solved(stack(1.0, 8))
    assert half.counts["f_products"] <= 1.3 * whole.counts["f_products"] + 5
    assert not any("rescue" in str(step) for step in half.solution.history)


def test_contact_rows_leave_prescribed_components_to_the_supports() -> None:
    torn = solved(stack(1.0, 4)).torn
    fixed = torn.decomposition.fixed
    assert (fixed[torn.points.slave].any(axis=1) & ~fixed[torn.points.slave].all(axis=1)).sum() == 5
    product = torn.B[: torn.n_equality] @ torn.B[torn.n_equality :].T
    assert abs(product).max() < 1e-14
    assert torn.groups.slips.held(fixed).sum() == 5, "sliding across the plane of symmetry"


def test_supports_that_move_both_surfaces_make_them_slip() -> None:
    """Both sides at x0 are moved by supports, the upper one farther: friction there is at its bound."""
    scene = stack(1.0, 4)
    upper = replace(scene.bodies["upper"], mesh=block((0, 0, 1), (1.9, 1, 2), (4, 4, 2)))
    slides = [Support("lower", "x0", (0.0, None, None)), Support("upper", "x0", (0.01, None, None))]
    scene = replace(
        scene,
        bodies={**scene.bodies, "upper": upper},
        supports=[*scene.supports, *slides],
        loads=[Traction("upper", "z1", (0.0, 0.0, -10.0))],
    )
    state = solved(scene)
    contact, points = state.contact, upper.mesh.points
    moved = np.flatnonzero(points[contact.points.slave - scene.bodies["lower"].mesh.n_nodes, 0] == 0.0)
    slip = np.einsum("na,nad->nd", contact.slip, contact.points.tangents)
    np.testing.assert_allclose(slip[moved, 0], 0.01, rtol=1e-9)
    pressed = moved[contact.normal_force[moved] > 0.0]
    assert len(pressed) >= 3
    assert (contact.status[pressed] == Status.SLIP).all()
    friction = np.linalg.norm(contact.friction_force[pressed], axis=1)
    np.testing.assert_allclose(friction, 0.35 * contact.normal_force[pressed], rtol=1e-6)


def test_load_steps_remember_where_supports_moved_the_slave() -> None:
    """One node row of the slave is driven forth and back on a floor; slip counts from the last step."""
    mesh = block((0, 0, 0), (2, 1, 1), (4, 2, 2))
    floor = ContactPair(Surface("block", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(0.3))
    scene = Scene({"block": Body(mesh, STEEL)}, contacts=[floor])
    press = Support("block", "z1", (None, None, -0.01))
    steps = [
        LoadStep(f"{s}", supports=[press, Support("block", "x0", (s, 0.0, None))]) for s in (0.01, 0.03, 0.02)
    ]
    cut = {"block": box_partition(mesh, (2, 1, 1))}
    states = solve_steps(
        ContactProblem(scene, MPI.COMM_SELF, partitions=cut, solver=FaceNewton(tolerance=TOLERANCE)), steps
    )
    driven = np.flatnonzero(mesh.points[states[0].contact.points.slave, 0] == 0.0)
    for state, step, total in zip(states, (0.01, 0.02, -0.01), (0.01, 0.03, 0.02), strict=True):
        contact = state.contact
        moved = np.einsum("na,nad->nd", contact.slip, contact.points.tangents)[driven, 0]
        np.testing.assert_allclose(moved, step, rtol=1e-9)
        moved = np.einsum("na,nad->nd", contact.total_slip, contact.points.tangents)[driven, 0]
        np.testing.assert_allclose(moved, total, rtol=1e-9)
        assert state.energies.primal == pytest.approx(state.energies.dual, rel=1e-7)
    friction = [state.contact.force[driven, 0].sum() for state in states]
    assert friction[1] < 0.0 < friction[2], "driven back, friction turns round"


def test_supports_that_press_surfaces_into_one_another_are_refused() -> None:
    scene = stack(1.0, 4)
    sunk = [
        *scene.supports,
        Support("lower", "z1", (None, None, 0.0)),
        Support("upper", "z0", (None, None, -0.2)),
    ]
    message = (
        r"supports must leave room between .* but \d+ contact nodes are pressed up to 0\.2 into their master"
    )
    with pytest.raises(InvalidInputError, match=message):
        solved(replace(scene, supports=sunk))


def tilted(slope: float, cells: int = 4) -> Scene:
    """The model with an upper face of the lower block that falls away from the plane y = 0 as a roof does."""
    scene = stack(1.0, cells)
    points = scene.bodies["lower"].mesh.points.copy()
    points[:, 2] -= slope * np.abs(points[:, 1]) * points[:, 2]
    return scene.moved({"lower": points})


def torn_of(scene: Scene) -> TornSystem:
    cut = {name: box_partition(body.mesh, (2, 1, 1)) for name, body in scene.bodies.items()}
    return build_torn_system(scene, decompose(scene, cut, MPI.COMM_SELF))


@pytest.mark.parametrize("slope", [0.004, 0.1, 0.5])
def test_normals_lie_in_a_plane_of_symmetry_however_the_face_is_tilted(slope: float) -> None:
    torn = torn_of(tilted(slope))
    fixed, points, slip = torn.decomposition.fixed, torn.points, torn.groups.slips
    on_plane = fixed[points.slave, 1]
    assert on_plane.sum() == 5
    np.testing.assert_array_equal(points.normal[on_plane, 1], 0.0)
    assert np.abs(points.normal[~on_plane, 1]).min() > 0.5 * slope
    across = np.abs(slip.directions[:, 1]) == 1.0
    np.testing.assert_array_equal(slip.held(fixed), across & on_plane[slip.which])


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_half_a_roof_gives_half_the_answer(discretisation: str) -> None:
    """The ridge lies in the plane of symmetry; its normals are those of both slopes together."""
    models = [tilted(0.03, cells) for cells in (4, 8)]
    pairs = [replace(model.contacts[0], discretisation=discretisation) for model in models]
    half, whole = (solved(replace(m, contacts=[p])) for m, p in zip(models, pairs, strict=True))
    assert 0 < half.contact.count(Status.OPEN) < half.contact.points.count
    assert half.energies.total_potential == pytest.approx(0.5 * whole.energies.total_potential, rel=1e-6)
    assert half.energies.friction == pytest.approx(0.5 * whole.energies.friction, rel=1e-4)


def test_friction_that_supports_hold_is_told(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("INFO", "fenics_contact"):
        torn_of(stack(1.0, 4))
    assert "5 of 50 friction rows are left to the supports, which hold slip there" in caplog.text


def beside(share: float) -> Scene:
    """An upper block whose side is held at a part of a facet beside the held side of the lower one."""
    lower = block((0.0, 0.0, 0.0), (2.1, 1.1, 1.0), (3, 3, 2))
    upper = block((0.7 * share, 0.0, 1.0), (1.7, 1.1, 1.8), (5, 3, 2))
    rollers = [Support(name, "x0", (0.0, None, None)) for name in ("lower", "upper")]
    return Scene(
        {"lower": Body(lower, STEEL), "upper": Body(upper, STEEL)},
        [Support("lower", "z0", (None, 0.0, 0.0)), *rollers, Support("upper", "z1", (None, 0.0, -0.05))],
        contacts=[ContactPair(*FACES, Coulomb(0.2), discretisation="node")],
    )


@pytest.mark.parametrize("share", [0.3, 0.019, 0.002])
def test_a_held_slave_node_keeps_its_friction_where_its_master_can_move(share: float) -> None:
    """98 % of its master is held, too; the rest slips under it as the lower block bulges."""
    state = solved(beside(share))
    contact, fixed = state.contact, state.torn.decomposition.fixed
    driven = np.flatnonzero(fixed[contact.points.slave, 0])
    assert len(driven) == 4
    assert not state.torn.groups.slips.held(fixed).any()
    displacement = np.vstack([state.gather_displacement(name) for name in state.scene.bodies])
    moved = (contact.points.jump @ displacement)[driven]
    across = np.einsum("na,nad->nd", contact.slip, contact.points.tangents)[driven]
    size = np.abs(displacement).max()
    assert np.abs(moved[:, 0]).max() > 0.02 * share * size
    np.testing.assert_allclose(across[:, 0], moved[:, 0], atol=1e-7 * size)
    slips = contact.status[driven] == Status.SLIP
    assert (np.linalg.norm(across[~slips], axis=1) < 1e-6 * size).all()
    friction, bound = np.linalg.norm(contact.friction_force[driven], axis=1), contact.slip_bound[driven]
    np.testing.assert_allclose(friction[slips], bound[slips], rtol=1e-4)
    assert slips.any()
    assert state.energies.primal == pytest.approx(state.energies.dual, rel=1e-6)


@pytest.mark.parametrize(("share", "held"), [(4e-6, False), (2e-7, True)])
def test_what_is_left_free_by_rounding_alone_is_held(share: float, held: bool) -> None:
    torn = torn_of(beside(share))
    slip, fixed = torn.groups.slips, torn.decomposition.fixed
    on_side = fixed[slip.points.slave[slip.which], 0] & (np.abs(slip.directions[:, 0]) > 0.9)
    assert on_side.sum() == 4
    assert (slip.held(fixed)[on_side] == held).all()


@pytest.mark.parametrize("tilt", [0.01, 0.2])
def test_slip_across_two_rollers_is_no_slip_when_it_only_opens(tilt: float) -> None:
    """Supports on faces that are no planes of symmetry: normals lean out of the plane that nodes move in."""
    scene = stack(1.0, 4)
    points = scene.bodies["lower"].mesh.points.copy()
    points[:, 2] -= tilt * points[:, 1] * points[:, 2]
    scene = scene.moved({"lower": points})
    held = [Support(name, face, (None, 0.0, None)) for name, face in (("lower", "z1"), ("upper", "z0"))]
    torn = torn_of(replace(scene, supports=[scene.supports[0], *held]))
    slip, fixed = torn.groups.slips, torn.decomposition.fixed
    assert slip.held(fixed).reshape(-1, 2).tolist() == [[True, False]] * torn.points.count
    ways = slip.directions.reshape(-1, 2, 3)[:, 1]
    np.testing.assert_allclose(ways[:, 1], 0.0, atol=1e-15)
    rows = torn.B[torn.n_equality + torn.points.count :].tocsr()
    assert (np.diff(rows.indptr).reshape(-1, 2)[:, 0] == 0).all()


@pytest.mark.parametrize(("degrees", "held"), [(5.0, True), (40.0, True), (50.0, False), (85.0, False)])
def test_a_way_down_a_slope_is_slip_where_it_is_more_slip_than_opening(degrees: float, held: bool) -> None:
    """Nodes that are held along y move along z alone beside that, which a wall meets ever more sideways."""
    angle = np.radians(degrees)
    wall = RigidPlane((0.0, 0.0, -5.0), (0.0, float(np.sin(angle)), float(np.cos(angle))))
    mesh = block((0.0, 0.0, 0.0), (0.7, 1.1, 1.3), (3, 5, 2))
    supports = [Support("block", "z0", (None, 0.0, None)), Support("block", "z1")]
    pair = ContactPair(Surface("block", "z0"), wall, Coulomb(0.3))
    torn = torn_of(Scene({"block": Body(mesh, STEEL)}, supports, contacts=[pair]))
    slip, fixed = torn.groups.slips, torn.decomposition.fixed
    way = np.abs(slip.directions[:, 2]) > 1e-3
    assert way.sum() == torn.points.count == 24
    assert (slip.held(fixed)[way] == held).all()
    assert not torn.groups.normal.held(fixed).any()


def test_a_surface_that_lies_in_a_plane_of_symmetry_keeps_its_normals() -> None:
    mesh = block((0.0, 0.0, 0.0), (0.7, 1.1, 1.3), (3, 5, 3))
    points = mesh.points + 1e-9 * np.sin(np.arange(mesh.points.size)).reshape(-1, 3)
    pair = ContactPair(Surface("block", "y0"), RigidPlane((0.0, -0.1, 0.0), (0.0, 1.0, 0.0)))
    roller = Support("block", "y0", (None, 0.01, None))
    scene = Scene({"block": Body(mesh.moved(points), STEEL)}, [roller, Support("block", "y1")], [], [pair])
    surface = surface_of(scene, pair.slave, "faceted")
    assert not surface.mirrored.any()
    np.testing.assert_allclose(surface.normals, np.tile([0.0, -1.0, 0.0], (16, 1)), atol=1e-7)


def test_surfaces_that_supports_hold_but_for_a_tilt_get_the_room_that_faceting_takes() -> None:
    """Pressed by a thousandth, they need not slip a tenth down a slope of one percent."""
    scene = tilted(0.01)
    sides = [Support("lower", "z1", (None, None, 0.0)), Support("upper", "z0", (None, None, -0.004))]
    torn = torn_of(replace(scene, supports=[Support("lower", "z0"), *sides]))
    fixed, normal = torn.decomposition.fixed, torn.groups.normal
    assert 0.0 < normal.freedom(fixed).max() < 0.02
    prescribed = np.where(torn.supported[torn.normal_rows] > torn.points.gap, 1, 0)
    assert prescribed.any()
    assert torn.right[torn.normal_rows].min() == 0.0

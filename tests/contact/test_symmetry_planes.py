"""Supports on contact nodes: half models, surfaces that supports move, and those they press together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.contact import State, Status, solve_scene, solve_steps
from fenics_contact.errors import InvalidInputError
from fenics_contact.geometry import block, box_partition
from fenics_contact.qp import FaceNewton
from fenics_contact.scene import (
    Body,
    ContactPair,
    Coulomb,
    Discretisation,
    IsotropicElasticity,
    LoadStep,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Traction,
)

STEEL = IsotropicElasticity(1000.0, 0.3)
TOLERANCE = 1e-9
FACES = Surface("upper", "z0"), Surface("lower", "z1")


def stack(width: float, cells: int, discretisation: Discretisation = "node") -> Scene:
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


def solved(scene: Scene) -> State:
    cut = {name: box_partition(body.mesh, (2, 1, 1)) for name, body in scene.bodies.items()}
    return solve_scene(scene, cut, MPI.COMM_SELF, solver=FaceNewton(tolerance=TOLERANCE))


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_half_a_model_gives_half_the_answer(discretisation: Discretisation) -> None:
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
    assert torn.relations[2].held(fixed).sum() == 5, "sliding across the plane of symmetry"


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
    states = solve_steps(scene, steps, cut, MPI.COMM_SELF, solver=FaceNewton(tolerance=TOLERANCE))
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


def test_a_row_that_is_free_but_for_a_slight_tilt_counts_as_held() -> None:
    """Normals of a crowned face are tilted by less than a percent at the plane of symmetry."""
    scene = stack(1.0, 4)
    points = scene.bodies["lower"].mesh.points.copy()
    points[:, 2] -= 0.004 * points[:, 1] * points[:, 2]
    tilted = scene.moved({"lower": points})
    torn = solved(tilted).torn
    slip = torn.relations[2]
    across = np.abs(slip.directions[:, 1]) > 0.99
    on_plane = torn.decomposition.fixed[slip.points.slave[slip.which], 1]
    assert 0.0 < np.abs(slip.directions[across & on_plane, 2]).max() < 0.02
    assert slip.held(torn.decomposition.fixed)[across & on_plane].all()
    assert not slip.held(torn.decomposition.fixed)[~on_plane].any()

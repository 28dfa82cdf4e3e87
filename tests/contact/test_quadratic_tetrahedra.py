"""Quadratic tetrahedra, whose facets bear on the midpoints of edges, find what quadratic hexahedra find."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    TotalForce,
    contact_area,
    solve_scene,
)
from fenics_contact._surfaces.facets import filled_at_corners
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from fenics_contact.mesh import quadratic
from fenics_contact.qp import FaceNewton
from fenics_contact.study.scenes.hertz import POISSON, RADIUS, YOUNG, round_block

SOLVER = FaceNewton(tolerance=1e-8)
FORCE = 4 * (YOUNG / (1 - POISSON**2)) / (3 * RADIUS)
PEAK = 3 * FORCE / (2 * np.pi)


@cache
def ball_on_floor(cell: str, curved: bool = True) -> State:
    """A quarter of a round block on a rigid floor; the radius of the contact is 1, three quadratic cells."""
    mesh = round_block(1.0, 1.0, 3 if curved else 6, cell)
    mesh = quadratic(mesh) if curved else mesh
    guides: dict[str, tuple[float | None, ...]] = {side: (0.0, None, None) for side in ("x0", "x1")}
    guides |= {side: (None, 0.0, None) for side in ("y0", "y1")}
    scene = Scene(
        {"ball": Body(mesh, IsotropicElasticity(YOUNG, POISSON))},
        [Support("ball", side, value) for side, value in guides.items()],
        [TotalForce("ball", "z1", (0.0, 0.0, -FORCE / 4))],
        [ContactPair(Surface("ball", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)))],
    )
    return solve_scene(scene, MPI.COMM_SELF, solver=SOLVER)


def found(state: State) -> dict[str, float]:
    """Peak p0 of the law p² = p0² (1 − r²/a²) fitted to the pressures, radius and approach."""
    contact, mesh = state.contact, state.scene.bodies["ball"].mesh
    square = (mesh.points[contact.points.slave][:, :2] ** 2).sum(axis=1)
    weight = np.sqrt(contact.points.area) * ((contact.status > 0) & (square < 0.64))
    rows = np.column_stack([np.ones_like(square), -square]) * weight[:, None]
    fitted = np.linalg.lstsq(rows, contact.pressure**2 * weight, rcond=None)[0]
    moment = contact.normal_force @ square / contact.normal_force.sum()
    top = np.unique(mesh.surfaces["z1"])
    return {
        "peak": float(np.sqrt(fitted[0])) / PEAK,
        "radius": float(np.sqrt(2.5 * moment)),
        "approach": -float(state.gather_displacement("ball")[top, 2].mean()),
    }


def test_tetrahedra_and_hexahedra_agree_on_the_contact_of_hertz() -> None:
    tetrahedra, hexahedra = found(ball_on_floor("tetrahedron")), found(ball_on_floor("hexahedron"))
    for key, value in tetrahedra.items():
        assert value == pytest.approx(hexahedra[key], rel=0.02), key
    assert tetrahedra["peak"] == pytest.approx(1.0, abs=0.02)
    assert tetrahedra["radius"] == pytest.approx(1.0, abs=0.01)
    linear = found(ball_on_floor("tetrahedron", curved=False))
    assert abs(linear["approach"] / hexahedra["approach"] - 1) > 0.02, "linear ones would do as well"


def test_the_largest_pressure_and_the_area_are_those_of_hertz() -> None:
    state = ball_on_floor("tetrahedron")
    assert state.contact.pressure.max() == pytest.approx(PEAK, rel=0.03)
    assert 4 * contact_area(state) == pytest.approx(np.pi, rel=0.04)
    mesh, points = state.scene.bodies["ball"].mesh, state.contact.points.slave
    corners = np.unique(mesh.surfaces["z0"][:, :3])
    assert not np.isin(corners, points).any()
    pressure = state.gather_fields("ball").points["contact_pressure"]
    radius = np.linalg.norm(mesh.points[corners][:, :2], axis=1)
    hertz = PEAK * np.sqrt(np.maximum(1 - radius**2, 0))
    np.testing.assert_allclose(pressure[corners], hertz, atol=0.35 * PEAK)
    assert np.all(pressure[corners][radius < 0.8] > 0.5 * hertz[radius < 0.8])
    assert np.all(pressure[corners][radius > 1.5] == 0.0)


def test_values_at_corners_are_those_of_quadratic_fields() -> None:
    """Around the centre of a regular hexagon: six triangles."""
    angle = np.arange(6) * np.pi / 3
    outer = np.column_stack([np.cos(angle), np.sin(angle)])
    following = np.roll(outer, -1, axis=0)
    points = np.concatenate([[[0.0, 0.0]], outer, outer / 2, (outer + following) / 2])
    k = np.arange(6)
    facets = np.column_stack([0 * k, 1 + k, 1 + (k + 1) % 6, 7 + k, 13 + k, 7 + (k + 1) % 6])
    values = np.stack([2.0 - (points**2).sum(axis=1), 1.0 + points[:, 0] * points[:, 1]], axis=1)
    given = values.copy()
    given[:7] = np.nan
    np.testing.assert_allclose(filled_at_corners(facets, given)[0], values[0])
    np.testing.assert_array_equal(filled_at_corners(facets, given)[7:], values[7:])
    np.testing.assert_array_equal(filled_at_corners(facets[:, :3], given), given)


def test_a_pushed_block_rubs_and_its_supports_bear_the_rest() -> None:
    """Friction on all contact points, and reactions on the corners of facets too."""
    mesh = quadratic(block((0, 0, 0), (2, 1, 1), (4, 2, 2), cell="tetrahedron"))
    scene = Scene(
        {"pad": Body(mesh, IsotropicElasticity(100.0, 0.3))},
        [Support("pad", "x1", (0.2, None, None)), Support("pad", "y0", (None, 0.0, None))],
        [TotalForce("pad", "z1", (0.0, 0.0, -6.0))],
        [ContactPair(Surface("pad", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(0.25))],
    )
    state = solve_scene(scene, MPI.COMM_SELF, solver=SOLVER)
    assert state.contact.normal_force.sum() == pytest.approx(6.0)
    assert scene.plan().multipliers["normal"] == state.contact.points.count
    pull, rubbed = state.reactions()[0].force[0], state.contact.force.sum(axis=0)[0]
    assert pull == pytest.approx(-rubbed, rel=1e-6), "corners of the support's facets bear too"
    assert pull == pytest.approx(0.25 * 6.0, rel=1e-3)

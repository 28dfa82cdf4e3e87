"""Pressure follows surfaces: its stiffness, a ring against its closed form, free rims, planes of symmetry."""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI
from scipy.integrate import solve_bvp

from fenics_contact import (
    AutomaticSteps,
    Body,
    BodyMesh,
    ContactPair,
    Coulomb,
    DeformedState,
    Pressure,
    RigidPlane,
    Scene,
    Support,
    Surface,
    TangentNewton,
    Ufl,
    box_partition,
    solve_scene,
)
from fenics_contact._fem.forms import FormLibrary
from fenics_contact._scene.plan import EffectName
from fenics_contact.feti.subdomain import assemble, cut_out
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke, PlaneStrain
from fenics_contact.mesh import bisection_partition
from tests.models.deformed import rotation, skew_patch, smooth_field
from tests.nonlinear.scenes import RUBBER, cut


@pytest.mark.parametrize(
    ("cell", "value"),
    [
        ("hexahedron", 0.3),
        ("tetrahedron10", Ufl(lambda x: 0.3 + x[0])),
        ("quadrilateral9", lambda x: 0.3 + x[:, 1] ** 2),
    ],
)
def test_stiffness_is_the_derivative_of_the_force_and_turns_with_the_body(cell: str, value: object) -> None:
    body = Body(skew_patch(cell), RUBBER)
    load = Pressure("body", "x1", value)  # type: ignore[arg-type]
    scene, forms = Scene({"body": body}, loads=[load]), FormLibrary(MPI.COMM_SELF)
    forms.prepare(scene)
    forms.prepare_mechanics(scene)
    mesh = cut_out(0, "body", body, np.arange(body.mesh.n_cells))
    order = np.argsort(mesh.nodes)
    acted = np.isin(mesh.nodes[order], body.mesh.surfaces["x1"])
    points = body.mesh.points[mesh.nodes]
    pressure = forms.following(
        load, body.mesh.cell_type, mesh.space, points[order], mesh.facets_of(body, "x1"), acted
    )
    u = smooth_field(points).ravel()
    direction = np.cos(np.arange(u.size) ** 1.5)
    _, softening = pressure.at(u)
    ahead, behind = (pressure.at(u + sign * 1e-6 * direction)[0] for sign in (1, -1))
    exact = softening @ direction
    assert np.abs(exact).max() > 0.01
    assert np.abs((behind - ahead) / 2e-6 - exact).max() < 1e-7 * np.abs(exact).max()
    # A turned surface has the turned force.
    R = rotation(body.mesh.dim)
    flat = np.zeros_like(u)
    more, _ = pressure.at((points @ R.T - points).ravel())
    assert pressure.at(flat)[0] == pytest.approx(0.0, abs=1e-14)
    dead = assemble(mesh, body, [load], forms).load.reshape(points.shape)
    assert np.abs(dead @ R.T - dead - more.reshape(points.shape)).max() < 1e-13
    assert np.abs(more).max() > 0.01


def test_friction_where_supports_hold_a_node_along_a_plane_passes_nothing_on() -> None:
    """Rows of friction there are zero: nothing is divided by their size."""
    floor = ContactPair(Surface("pad", "y0"), RigidPlane((0, 0), (0, 1)), Coulomb(0.5))
    scene = Scene(
        {"pad": Body(rectangle((0, 0), (2, 1), (3, 2)), RUBBER)},
        [Support("pad", "x0", (0.0, None))],
        [Pressure("pad", "y1", 0.02)],
        [floor],
    )
    state = solve_scene(scene, MPI.COMM_SELF, partitions={"pad": np.zeros(6, dtype=int)})
    assert state.balance().imbalance < 1e-8
    assert state.contact.points.count == 4


def quarter(around: int, through: int) -> tuple[BodyMesh, np.ndarray]:
    """A quarter of a ring from radius 1 to 2, with radius and angle of its nodes."""
    mesh = rectangle((0, 0), (1, 1), (through, around))
    r, angle = 1.0 + mesh.points[:, 0], 0.5 * np.pi * mesh.points[:, 1]
    moved = np.column_stack([r * np.cos(angle), r * np.sin(angle)])
    return replace(mesh, points=moved), np.column_stack([r, angle])


@cache
def inflated(
    around: int,
    through: int,
    pieces: tuple[int, int],
    pressure: float,
    forcing: float = TangentNewton.forcing,
) -> DeformedState:
    mesh, polar = quarter(around, through)
    rollers = [Support("ring", "y0", (None, 0.0)), Support("ring", "y1", (0.0, None))]
    scene = Scene({"ring": Body(mesh, RUBBER)}, rollers, [Pressure("ring", "x0", pressure)])
    parts = {"ring": box_partition(replace(mesh, points=polar), pieces)}
    steps = AutomaticSteps(TangentNewton(forcing=forcing))
    state = solve_scene(scene, MPI.COMM_SELF, partitions=parts, tolerance=1e-10, steps=steps)
    assert isinstance(state, DeformedState)
    return state


def radial(pressure: float) -> float:
    """How far the inner radius grows, by the equation of radial equilibrium."""
    lam, mu = RUBBER.parameters

    def stresses(R: np.ndarray, r: np.ndarray, stretch: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        volume = lam * np.log(stretch * r / R) - mu
        return mu * stretch + volume / stretch, mu * r / R + volume * R / r

    def rates(R: np.ndarray, y: np.ndarray) -> np.ndarray:
        r, stretch = y
        along, around = stresses(R, r, stretch)
        # dP_r/dR = (P_t − P_r) / R, with P_r a function of the stretch and of r / R.
        by_stretch = mu + (lam - lam * np.log(stretch * r / R) + mu) / stretch**2
        by_hoop = lam / (stretch * r / R)
        hoop_rate = (stretch - r / R) / R
        return np.vstack([stretch, ((around - along) / R - by_hoop * hoop_rate) / by_stretch])

    def ends(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        inner, outer = (stresses(R, y[0], y[1])[0] for R, y in ((1.0, a), (2.0, b)))
        return np.array([inner + pressure * a[0] / 1.0, outer])

    R = np.linspace(1.0, 2.0, 50)
    found = solve_bvp(rates, ends, R, np.vstack([R, np.ones(50)]), tol=1e-8, max_nodes=20_000)
    assert found.success
    return float(found.y[0, 0] - 1.0)


def test_an_inflated_ring_has_the_radius_of_the_closed_form() -> None:
    exact = radial(0.15)
    assert exact > 0.4
    errors = [
        inflated(n, n // 2, (1, 1), 0.15).gather_displacement("ring")[0, 0] / exact - 1.0 for n in (12, 24)
    ]
    assert abs(errors[1]) < 2e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15), "second order"


def test_newton_is_quadratic_where_rims_slide_in_planes_of_symmetry_and_neighbours_pass_forces_on() -> None:
    whole, torn = (inflated(12, 6, pieces, 0.15) for pieces in ((1, 1), (2, 3)))
    a, b = (state.gather_displacement("ring") for state in (whole, torn))
    assert np.abs(a - b).max() < 1e-8 * np.abs(a).max()
    for state in (whole, torn):
        assert len(state.solution.history) <= 8  # 6 to 8 by rounding: linear systems are solved roughly
        *_, before, last = [line.residuals.worst for line in state.solution.history]
        assert last < 1e-2 * before
    for pieces in ((1, 1), (2, 3)):
        exact = inflated(12, 6, pieces, 0.15, forcing=1e-8)
        residuals = [line.residuals.worst for line in exact.solution.history]
        assert len(residuals) <= 5
        assert all(after < before**2 for before, after in itertools.pairwise(residuals[1:4]))
    balance = torn.balance()
    inner = 1.0 + a[0, 0]
    assert balance.loads.force == pytest.approx([0.15 * inner] * 2, rel=5e-3), "on the deformed surface"
    assert np.abs(balance.total.force).max() < 1e-8
    assert np.isnan(torn.energies.load)
    assert EffectName.FOLLOWING_PRESSURE in [effect.name for effect in torn.scene.effects()]


def strip(follows: bool) -> DeformedState:
    mesh = rectangle((0, 0), (10, 1), (24, 2))
    load = Pressure("strip", "y1", 5e-4, dead=not follows)
    scene = Scene({"strip": Body(mesh, RUBBER)}, [Support("strip", "x0")], [load])
    parts = {"strip": box_partition(mesh, (3, 1))}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=parts)
    assert isinstance(state, DeformedState)
    return state


def test_a_bent_strip_with_a_free_rim() -> None:
    state, dead = strip(True), strip(False)
    assert len(state.solution.history) <= 12
    assert state.gather_displacement("strip")[:, 1].min() < -0.9, "bent far"
    # The force is p times the chord of the deformed surface, turned by a right angle.
    surface = np.sort(np.unique(state.scene.bodies["strip"].mesh.surfaces["y1"]))
    places = state.scene.bodies["strip"].mesh.points[surface] + state.gather_displacement("strip")[surface]
    chord = places[-1] - places[0]
    assert state.balance().loads.force == pytest.approx(5e-4 * np.array([chord[1], -chord[0]]), rel=1e-9)
    assert dead.balance().loads.force == pytest.approx([0.0, -5e-3], abs=1e-12)
    assert not np.isnan(dead.energies.load)


def test_a_pressed_cube_with_a_free_rim_and_neighbours() -> None:
    """The load of a free rim has an unsymmetric stiffness: without rows for it the load step must be cut."""
    mesh = block((0, 0, 0), (1, 1, 1), (3, 3, 3))
    scene = Scene({"block": Body(mesh, RUBBER)}, [Support("block", "z0")], [Pressure("block", "z1", 0.2)])
    answers = [solve_scene(scene, MPI.COMM_SELF, partitions=cut(mesh, n), tolerance=1e-10) for n in (1, 2)]
    a, b = (state.gather_displacement("block") for state in answers)
    assert np.abs(a - b).max() < 1e-8 * np.abs(a).max()
    assert max(len(state.solution.history) for state in answers) <= 9
    top = np.unique(mesh.surfaces["z1"])
    assert a[top, 2].mean() < -0.1


def test_soft_rows_of_rims_between_many_parts_neither_cost_products_nor_accuracy() -> None:
    """Their stiffness has entries of any size: unscaled, steps took 30 to 50 products and stalled at 1e-8."""
    mesh = block((0, 0, 0), (2, 1, 1), (5, 2, 2))
    rollers = [Support("pad", "x0", (0.0, None, None)), Support("pad", "y0", (None, 0.0, None))]
    floor = ContactPair(Surface("pad", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(0.5))
    scene = Scene({"pad": Body(mesh, RUBBER)}, rollers, [Pressure("pad", "z1", 0.0108)], [floor])
    state = solve_scene(scene, MPI.COMM_SELF, partitions={"pad": bisection_partition(mesh, 4)})
    assert isinstance(state, DeformedState)
    assert state.fractions == (1.0,)
    _, *steps = itertools.pairwise(state.solution.history)
    assert len(steps) >= 5
    assert max(after.products - before.products for before, after in steps) <= 15
    residuals = [line.residuals.worst for line in state.solution.history]
    far = max(number for number, size in enumerate(residuals) if size > 1e-7)
    assert residuals[far + 1] < 10 * residuals[far] ** 1.5, "superlinear to the end"


def test_small_strains_know_no_following_pressure() -> None:
    steel = Body(rectangle((0, 0), (1, 1), (2, 2)), PlaneStrain(1.0, 0.3))
    assert not Scene({"a": steel}, loads=[Pressure("a", "y1", 1.0)]).following_pressures
    rubber = Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), NeoHooke(1.0, 0.3))
    mixed = {"a": Body(rubber.mesh, IsotropicElasticity(1.0, 0.3)), "b": rubber}
    loads = [Pressure("a", "z1", 1.0), Pressure("b", "z1", 1.0), Pressure("b", "z0", 1.0, dead=True)]
    assert Scene(mixed, loads=loads).following_pressures == (loads[1],)

"""Cyclic symmetry: a sector is its part of the whole, with contact and friction, whatever its meshes."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ClosureTable,
    ContactPair,
    ContactProblem,
    Coulomb,
    CyclicSymmetry,
    LoadSequence,
    LoadStep,
    Pressure,
    RigidPlane,
    Roller,
    Scene,
    ShapeProblem,
    Status,
    Support,
    Surface,
    SurfaceDesign,
    ThermalStrain,
    Traction,
    contact_area,
    solve_scene,
)
from fenics_contact.design import TotalPotential
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.materials import NeoHooke, PlaneStrain
from fenics_contact.mesh import bisection_partition, quadratic
from fenics_contact.pictures.unrolled import contact_patches
from fenics_contact.qp import SlidingError
from fenics_contact.qp.problem import CountedOperator
from fenics_contact.results.deformed_state import AnyState
from tests.equilibrium.press_fits import BORE, NU, RIM, ring
from tests.feti.sector_cases import (
    SCENES,
    SECTORS,
    SOFT,
    STEEL,
    around,
    column,
    found,
    in_two,
    rotor,
    solved,
)

SCRIPT = Path(__file__).with_name("sector_cases.py")
AXIS = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def difference(part: AnyState, whole: AnyState) -> float:
    """By how much displacements of a sector differ from those of the whole, relative to the largest."""
    worst = 0.0
    for name in part.scene.bodies:
        mine, every = (state.scene.bodies[name].mesh.points for state in (part, whole))
        place = [int(np.argmin(np.linalg.norm(every - point, axis=1))) for point in mine]
        u = whole.gather_displacement(name)
        worst = max(worst, np.abs(part.gather_displacement(name) - u[place]).max() / np.abs(u).max())
    return worst


def test_a_sector_of_30_degrees_is_its_part_of_a_rotor() -> None:
    """A press-fit hub on a shaft whose seat is no circle, twisted; no plane of symmetry, some points slip."""
    part, whole = solved(rotor(), 3), solved(rotor(1.0), 4)
    assert difference(part, whole) < 1e-8
    assert part.contact.count(Status.SLIP) > 1
    assert part.contact.count(Status.STICK) > 0
    for status in Status:
        assert SECTORS * part.contact.count(status) == whole.contact.count(status), "each edge counts once"
    np.testing.assert_allclose(
        np.sort(part.contact.pressure), np.sort(whole.contact.pressure)[::SECTORS], rtol=1e-7
    )
    for name in ("strain", "load", "friction", "primal"):
        mine, every = (getattr(state.energies, name) for state in (part, whole))
        assert SECTORS * mine == pytest.approx(every, rel=1e-8)
    torques = [state.reactions()[0].moment_about((0.0, 0.0)) for state in (part, whole)]
    assert SECTORS * torques[0] == pytest.approx(torques[1], rel=1e-7)
    assert part.balance().imbalance < 1e-12
    assert part.counts["f_products"] <= whole.counts["f_products"]


def test_nodes_on_the_axis_belong_to_both_sides() -> None:
    part, whole = solved(column(whole=False), 3), solved(column(whole=True), 4)
    assert difference(part, whole) < 1e-8
    assert part.contact.points.count == 7, "two of nine nodes are on the slave side, one on the axis"
    on_axis = np.flatnonzero(np.linalg.norm(part.scene.bodies["upper"].mesh.points[:, :2], axis=1) == 0.0)
    u = part.gather_displacement("upper")[on_axis]
    np.testing.assert_allclose(u[:, :2], 0.0, atol=1e-20)
    assert np.abs(u[:, 2]).min() > 1e-4


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_pressure_reaches_the_side_whose_points_are_on_the_other(discretisation: str) -> None:
    """Areas, fields and pictures, also where there is another pair, which stays open."""
    lid, shown = RigidPlane((0.0, 0.0, 0.6), (0.0, 0.0, -1.0)), []
    for whole in (False, True):
        scene = column(whole=whole)
        pairs = [
            replace(scene.contacts[0], discretisation=discretisation),
            ContactPair(Surface("upper", "z1"), lid, Coulomb(0.3)),
        ]
        state = solved(replace(scene, contacts=pairs), 1)
        assert contact_area(state) == pytest.approx(4.0 if whole else 1.0, rel=1e-9)
        assert contact_area(state, 1) == 0.0
        points = scene.bodies["upper"].mesh.points
        field = state.gather_fields("upper").points["contact_pressure"]
        below = (points[:, 2] == 0.0) & (points[:, :2] >= 0.0).all(axis=1)
        order = np.lexsort(points[below].T)
        shown.append(field[below][order])
        patch = contact_patches([state], 0, None)[0]
        assert np.count_nonzero(patch.pressure > 0) == (25 if whole else 9)
    assert shown[0].min() > 0
    np.testing.assert_allclose(shown[0], shown[1], rtol=1e-6)


def test_sides_may_belong_to_two_bodies() -> None:
    one, two = (solved(in_two(two=two)) for two in (False, True))
    points, u = one.scene.bodies["a"].mesh.points, one.gather_displacement("a")
    for name in ("a", "b"):
        mine = two.scene.bodies[name].mesh.points
        place = [int(np.argmin(np.linalg.norm(points - point, axis=1))) for point in mine]
        assert np.abs(two.gather_displacement(name) - u[place]).max() < 1e-8 * np.abs(u).max()


@pytest.mark.parametrize(("discretisation", "order"), [("node", 1), ("mortar", 1), ("mortar", 2)])
def test_sides_whose_meshes_differ_pass_the_patch_test(discretisation: str, order: int) -> None:
    scene = rotor(skew=0.3)
    assert all(tie.reason == "mortar, as the meshes do not match" for tie in scene.ties)
    hub = {"hub": scene.bodies["hub"]}
    if order == 2:
        hub = {"hub": replace(hub["hub"], mesh=quadratic(hub["hub"].mesh))}
    ties = [replace(scene.ties[1], discretisation=discretisation)]
    state = solved(Scene(hub, loads=[ThermalStrain("hub", 1.0)], ties=ties))
    exact = 1e-3 * (1.0 + NU) * hub["hub"].mesh.points
    np.testing.assert_allclose(state.gather_displacement("hub"), exact, atol=1e-11)


def test_sides_whose_meshes_differ_are_right_within_the_error_of_the_mesh() -> None:
    same, skewed, fine = (solved(scene, 3) for scene in (rotor(), rotor(skew=0.3), rotor(fine=2)))
    energy = [state.energies.primal for state in (same, skewed, fine)]
    error = abs(energy[0] - energy[2])
    assert 0.0 < abs(energy[1] - energy[0]) < 1.5 * error
    assert skewed.counts["f_products"] < 1.3 * same.counts["f_products"] + 5


def test_large_deformations_of_a_sector_that_is_twisted_on_a_floor() -> None:
    """By a third of a right angle and more, under a pressure that follows, with friction on the floor."""
    angle, rubber = 0.4, NeoHooke(10.0, 0.3)

    def turned(points: np.ndarray) -> np.ndarray:
        c, s = np.cos(angle) - 1.0, np.sin(angle)
        return np.column_stack([c * points[:, 0] - s * points[:, 1], s * points[:, 0] + c * points[:, 1]])

    top = Support("upper", "z1", (lambda x: turned(x)[:, 0], lambda x: turned(x)[:, 1], -0.1))
    floor = ContactPair(Surface("upper", "z0"), RigidPlane(*AXIS), Coulomb(0.3))
    states = []
    for whole in (False, True):
        scene = column(whole=whole)
        sides = ("x0", "x1", "y0", "y1") if whole else ("x1", "y1")
        scene = Scene(
            {"upper": Body(scene.bodies["upper"].mesh, rubber)},
            [top],
            [Pressure("upper", name, 1.0) for name in sides],
            [floor],
            [tie for tie in scene.ties if tie.slave.body == "upper"],
        )
        cut = {"upper": bisection_partition(scene.bodies["upper"].mesh, 2)}
        states.append(solve_scene(scene, MPI.COMM_SELF, partitions=cut, tolerance=1e-10))
    part, whole_state = states
    assert difference(part, whole_state) < 1e-8
    assert part.contact.count(Status.SLIP) == 6
    np.testing.assert_allclose(
        np.unique(part.contact.pressure.round(6)), np.unique(whole_state.contact.pressure.round(6))
    )


def test_a_sector_may_turn_about_its_axis_and_do_nothing_else() -> None:
    mesh = ring(BORE, RIM, 96, 3, part=1 / SECTORS)
    sector = CyclicSymmetry(Surface("ring", "end"), Surface("ring", "start"), (0.0, 0.0))

    def pushed(points: np.ndarray) -> np.ndarray:
        outwards = points / np.linalg.norm(points, axis=1)[:, None]
        return 10.0 * outwards

    scene = Scene({"ring": Body(mesh, STEEL)}, loads=[Traction("ring", "outer", pushed)], ties=[sector])
    state = solved(scene)
    assert len(state.unheld) == 1
    way = mesh.points @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    turned = np.einsum("nd,nd->n", state.gather_displacement("ring"), way)
    np.testing.assert_allclose(turned, 0.0, atol=1e-8)
    twisted = replace(scene, loads=[Traction("ring", "outer", around)])
    with pytest.raises(Exception, match=r"every (loaded )?body must be held by supports"):
        solved(twisted)


def test_a_sector_that_supports_hold_in_one_subdomain_still_has_its_rows() -> None:
    scene = in_two(two=False)
    assert scene.plan().solver.value == "projected conjugate gradients"
    whole = {"a": np.zeros(scene.bodies["a"].mesh.n_cells, dtype=np.int64)}
    one = solve_scene(scene, MPI.COMM_SELF, partitions=whole, tolerance=1e-11)
    expected = solved(scene, 3).gather_displacement("a")
    np.testing.assert_allclose(one.gather_displacement("a"), expected, atol=1e-8 * np.abs(expected).max())


def test_a_torque_beyond_friction_is_refused_with_the_share_that_a_fit_of_soft_surfaces_carries(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Friction carries μ N r about the axis: 0.9 of it is held; 32 times are refused early."""
    products, counted = [], CountedOperator.__call__
    monkeypatch.setattr(CountedOperator, "__call__", lambda *args: products.append(1) or counted(*args))
    law = ClosureTable((0.0, 0.01, 0.015), (0.0, 0.0005, 0.002))
    steel = PlaneStrain(1.0, 0.3)
    bodies = {
        "shaft": Body(ring(0.3, 1.0, 24, 1, part=1 / SECTORS, shapes=False), steel),
        "hub": Body(ring(1.0, 1.8, 36, 1, part=1 / SECTORS, shapes=False), steel),
    }
    ties = [CyclicSymmetry(Surface(name, "end"), Surface(name, "start"), (0.0, 0.0)) for name in bodies]
    pair = ContactPair(
        Surface("hub", "inner"), Surface("shaft", "outer"), Coulomb(0.4), interference=0.01, closure=law
    )
    scene = Scene(bodies, [Support("shaft", "inner")], contacts=[pair], ties=ties)
    fit = LoadSequence(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-6))
    limit = 0.4 * fit.advance(LoadStep("fit")).contact.normal_force.sum()

    def torque(times: float) -> LoadStep:
        twist = times * limit / (1.8**3 * 2 * np.pi / SECTORS)
        across = Traction("hub", "outer", lambda x: twist * np.column_stack([-x[:, 1], x[:, 0]]))
        return LoadStep("torque", loads=[across])

    assert fit.advance(torque(0.9)).contact.count(Status.OPEN) == 0
    with pytest.raises(SlidingError, match=r"makes slide 'hub' .* friction carries only") as refused:
        fit.advance(torque(32.0))
    assert refused.value.share == pytest.approx(1 / 32, rel=0.01)
    assert 0 < len(products) < 700


def test_effects_and_plan_name_the_sectors() -> None:
    scene = rotor()
    names = [effect.name.value for effect in scene.effects()]
    assert names == [
        "elasticity", "prescribed displacement", "surface load", "cyclic symmetry", "contact",
        "Coulomb friction",
    ]  # fmt: skip
    plan = scene.plan()
    assert plan.ties == tuple(f"{n} end on {n} start; node, as the meshes match" for n in ("shaft", "hub"))


@pytest.mark.parametrize("name", SCENES)
def test_the_cut_does_not_matter(name: str) -> None:
    one, other = (found(name, cut, MPI.COMM_SELF) for cut in (1, 3))
    scale = np.abs(one["u"]).max()
    np.testing.assert_allclose(one["u"], other["u"], atol=1e-8 * scale)
    np.testing.assert_allclose(one["reactions"], other["reactions"], rtol=1e-6)


@pytest.mark.parametrize("ranks", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_ranks_find_the_same(ranks: int, mpirun: Callable[..., str]) -> None:
    everywhere = json.loads(mpirun(SCRIPT, ranks, *SCENES))
    assert len(everywhere) == ranks
    for name in SCENES:
        alone = found(name, 4, MPI.COMM_SELF)
        scale = np.abs(alone["u"]).max()
        for results in everywhere:
            np.testing.assert_allclose(results[name]["u"], alone["u"], atol=1e-8 * scale)
            np.testing.assert_allclose(results[name]["reactions"], alone["reactions"], rtol=1e-6)


def test_sides_that_are_no_sector_are_refused_with_the_angle_found() -> None:
    mesh = ring(BORE, RIM, 100, 3, part=0.07)
    bodies = {"ring": Body(mesh, STEEL)}
    sides = Surface("ring", "end"), Surface("ring", "start")
    message = r"360°/N apart, .* ring start are 25\.2° apart, 1/14\.2857 of a turn, the nearest is 25\.7"
    with pytest.raises(InvalidInputError, match=message):
        Scene(bodies, ties=[CyclicSymmetry(*sides, (0.0, 0.0))])
    given = CyclicSymmetry(*sides, (0.0, 0.0), angle=np.pi / 7)
    message = r"the same surface once the master is turned, but with the angle 25\.7143° .* up to 0\.\d* off"
    with pytest.raises(InvalidInputError, match=message):
        solved(Scene(bodies, [Support("ring", "inner")], [Traction("ring", "outer", around)], ties=[given]))
    with pytest.raises(InvalidInputError, match="the middle of one is on the axis"):
        Scene(bodies, ties=[CyclicSymmetry(*sides, (0.5 * (BORE + RIM), 0.0))])
    with pytest.raises(InvalidInputError, match="360°/N apart"):
        CyclicSymmetry(*sides, (0.0, 0.0), angle=1.0)


def test_points_and_axes_of_sectors_are_checked() -> None:
    sides = Surface("b", "x0"), Surface("b", "y0")
    with pytest.raises(InvalidInputError, match="needs an axis in space and none in the"):
        CyclicSymmetry(*sides, (0.0, 0.0, 0.0))
    with pytest.raises(InvalidInputError, match=r"CyclicSymmetry\.axis must be 3 finite numbers"):
        CyclicSymmetry(*sides, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    with pytest.raises(InvalidInputError, match=r"CyclicSymmetry\.at must be three finite coordinates"):
        CyclicSymmetry(*sides, (0.0,))
    with pytest.raises(InvalidInputError, match="needs both sides of a sector, got b x0 on b x0"):
        CyclicSymmetry(sides[0], sides[0], *AXIS)
    body = {"b": Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), SOFT)}
    with pytest.raises(InvalidInputError, match=r"CyclicSymmetry\.at of b x0 on b y0 must have 3"):
        Scene(body, ties=[CyclicSymmetry(*sides, (0.0, 0.0))])
    with pytest.raises(InvalidInputError, match=r"CyclicSymmetry\.master names surface 'w0'"):
        Scene(body, ties=[CyclicSymmetry(sides[0], Surface("b", "w0"), *AXIS)])


def test_supports_must_hold_both_sides_alike() -> None:
    scene = rotor()
    held = [*scene.supports, Roller("hub", "end")]
    with pytest.raises(InvalidInputError, match="hold both sides of a sector alike, but of hub end on hub"):
        solved(replace(scene, supports=held))


def test_what_does_not_go_around_is_refused() -> None:
    scene = column(whole=False)
    rubber = {name: Body(body.mesh, NeoHooke(10.0, 0.3)) for name, body in scene.bodies.items()}
    message = "does not go on around a sector, but the master of upper z0 on lower z1 ends at the side 'x0'"
    with pytest.raises(InvalidInputError, match=message):
        solve_scene(replace(scene, bodies=rubber, loads=[Traction("upper", "z1", (0, 0, -1))]), MPI.COMM_SELF)
    design = SurfaceDesign("upper", "z1", (2, 2))
    with pytest.raises(InvalidInputError, match="a design needs sides of sectors that stay and do not touch"):
        ShapeProblem(ContactProblem(scene, MPI.COMM_SELF), design, TotalPotential())

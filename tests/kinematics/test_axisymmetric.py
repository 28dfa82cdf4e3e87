"""Bodies of revolution in small strain: patch tests, Lamé, Hertz, kernels, loads per revolution."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from typer.testing import CliRunner

from fenics_contact import (
    Body,
    BodyForce,
    ContactPair,
    Coulomb,
    Pressure,
    RigidPlane,
    RigidSurface,
    Scene,
    State,
    Support,
    Surface,
    ThermalStrain,
    TotalForce,
    Traction,
    contact_area,
    solve_scene,
)
from fenics_contact import _cli as cli
from fenics_contact._kinematics.revolution import RevolvedMeasure
from fenics_contact._surfaces.facets import bearing_areas, nodal_areas
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.gallery.blocks import SIDES
from fenics_contact.materials import (
    Elasticity,
    EnergyModel,
    IsotropicElasticity,
    PlaneStrain,
    material_axes,
)
from fenics_contact.mesh import bisection_partition, quadratic
from fenics_contact.output import read_result
from fenics_contact.pictures import states
from fenics_contact.pictures.drawing import ColouredField
from fenics_contact.results.fields import tensors, von_mises_of
from tests.kinematics.revolved import (
    BORE,
    KINDS,
    PRESSURE,
    RADIUS,
    RIM,
    SEAT,
    STEEL,
    STRANDS,
    WOUND,
    Kind,
    press_fit,
    press_fit_pressure,
    pushed_on_ball,
    pushed_with_friction,
    section,
    stacked,
)


def solved(scene: Scene, tolerance: float = 1e-11) -> State:
    return solve_scene(scene, MPI.COMM_SELF, tolerance=tolerance)


def worst_patch_error(state: State) -> float:
    """The largest stress beside an axial pressure, relative to it."""
    expected = np.diag([0.0, -PRESSURE, 0.0])
    return (
        max(float(np.abs(state.gather_stress(name) - expected).max()) for name in state.scene.bodies)
        / PRESSURE
    )


@pytest.mark.parametrize("inner", [0.0, 1.0])
@pytest.mark.parametrize("kind", KINDS)
def test_pressure_is_transmitted_exactly_by_nodes(kind: Kind, inner: float) -> None:
    state = solved(stacked(kind, "node", (4, 4), inner=inner, friction=0.3))
    assert worst_patch_error(state) < 1e-9
    np.testing.assert_allclose(state.contact.pressure, PRESSURE, rtol=1e-9)
    area = np.pi * (9 - inner**2)
    assert state.resultants().contacts[0].force[1] == pytest.approx(PRESSURE * area, rel=1e-9)
    assert contact_area(state) == pytest.approx(area, rel=1e-9)


@pytest.mark.parametrize("tied", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_pressure_is_transmitted_exactly_by_mortar(kind: Kind, tied: bool) -> None:
    state = solved(stacked(kind, "mortar", (4, 7), tied=tied))
    assert worst_patch_error(state) < 1e-9
    if not tied:
        np.testing.assert_allclose(state.contact.pressure, PRESSURE, rtol=1e-9)
        assert state.contact.area.sum() == pytest.approx(9 * np.pi, rel=1e-12)
        assert contact_area(state) == pytest.approx(9 * np.pi, rel=1e-9)


def test_recovered_stress_of_a_patch_is_exact_on_the_axis() -> None:
    scene = stacked("quadrilateral", "node", (4, 4), material=STRANDS)
    stress = solved(scene).gather_nodal_stress("upper")[0]
    np.testing.assert_allclose(
        stress, np.broadcast_to(np.diag([0.0, -PRESSURE, 0.0]), stress.shape), atol=1e-8
    )


@pytest.mark.parametrize("kind", KINDS)
def test_hoop_and_radial_stress_are_those_of_lame(kind: Kind) -> None:
    inner, outer, inside = 20.0, 40.0, 100.0
    mesh = rectangle((inner, 0), (outer, 5), (12, 3), "triangle" if "tri" in kind else "quadrilateral")
    mesh = quadratic(mesh) if kind[-1] in "69" else mesh
    supports = [Support("ring", side, (None, 0.0)) for side in ("y0", "y1")]
    state = solved(
        Scene({"ring": Body(mesh, STEEL, axisymmetric=True)}, supports, [Pressure("ring", "x0", inside)])
    )
    r, share = mesh.points[:, 0], inside * inner**2 / (outer**2 - inner**2)
    E, nu = STEEL.young_modulus, STEEL.poisson_ratio
    expected = (1 + nu) / E * share * ((1 - 2 * nu) * r + outer**2 / r)
    accuracy = {"triangle": 5e-3, "quadrilateral": 1.5e-3, "triangle6": 5e-5, "quadrilateral9": 2e-6}[kind]
    np.testing.assert_allclose(state.gather_displacement("ring")[:, 0], expected, rtol=accuracy)
    stress = state.gather_nodal_stress("ring")[0]
    accuracy = {"triangle": 5e-2, "quadrilateral": 2e-2, "triangle6": 4e-3, "quadrilateral9": 1e-3}[kind]
    largest = share * (1 + outer**2 / inner**2)
    np.testing.assert_allclose(stress[:, 2, 2], share * (1 + outer**2 / r**2), atol=accuracy * largest)
    np.testing.assert_allclose(stress[:, 0, 0], share * (1 - outer**2 / r**2), atol=accuracy * largest)
    mises = state.gather_fields("ring").points["nodal_von_mises"]
    root = np.sqrt(3 * (outer / r) ** 4 + (1 - 2 * nu) ** 2) * share
    np.testing.assert_allclose(mises, root, atol=2 * accuracy * largest)


def test_fibres_around_the_circumference_carry_hoop_stress() -> None:
    """With other stiffness around than across, u = a rᵏ + b r⁻ᵏ with k² = C_θθ / C_rr."""
    mesh = quadratic(rectangle((BORE, 0), (SEAT, 2), (24, 2)))
    supports = [Support("ring", side, (None, 0.0)) for side in ("y0", "y1")]
    state = solved(
        Scene({"ring": Body(mesh, WOUND, axisymmetric=True)}, supports, [Pressure("ring", "x0", PRESSURE)])
    )
    C, r = WOUND.stiffness_matrix, mesh.points[:, 0]
    k = np.sqrt(C[2, 2] / C[0, 0])
    stress = [[(C[0, 0] * n + C[0, 2]) * at ** (n - 1) for n in (k, -k)] for at in (BORE, SEAT)]
    a, b = np.linalg.solve(stress, [-PRESSURE, 0.0])
    np.testing.assert_allclose(state.gather_displacement("ring")[:, 0], a * r**k + b * r**-k, rtol=2e-5)


@pytest.mark.parametrize(
    ("kind", "by"), [("quadrilateral", "node"), ("quadrilateral", "mortar"), ("quadrilateral9", "node")]
)
def test_pressure_of_a_press_fit_is_that_of_lame(kind: Kind, by: str) -> None:
    state = solved(press_fit(kind, 24 if kind == "quadrilateral" else 8, by, friction=0.2))  # type: ignore[arg-type]
    accuracy = 1e-3 if kind == "quadrilateral" else 2e-5
    np.testing.assert_allclose(state.contact.pressure, press_fit_pressure(), rtol=accuracy)
    radial = state.resultants().contacts[0].force[0]
    assert radial == pytest.approx(press_fit_pressure() * 2 * np.pi * SEAT * 6, rel=accuracy)


def test_peak_pressure_on_a_ball_is_that_of_hertz() -> None:
    for order, accuracy in ((1, 0.031), (2, 0.006)):
        state = solved(pushed_on_ball(8, order), 1e-8)
        force = -state.resultants().contacts[0].force[1]
        modulus = STEEL.young_modulus / (1 - STEEL.poisson_ratio**2)
        spot = (0.75 * force * RADIUS / modulus) ** (1 / 3)
        r = state.scene.bodies["flat"].mesh.points[state.contact.points.slave, 0]
        expected = 1.5 * force / (np.pi * spot**2) * np.sqrt(np.maximum(1 - (r / spot) ** 2, 0.0))
        inside = r < 0.7 * spot
        peak = 1.5 * force / (np.pi * spot**2)
        np.testing.assert_allclose(state.contact.pressure[inside], expected[inside], atol=accuracy * peak)
        assert contact_area(state) == pytest.approx(np.pi * spot**2, rel=0.01)
        shown = state.gather_fields("flat").points["contact_pressure"].max()
        assert shown == pytest.approx(peak, rel={1: 0.02, 2: 0.002}[order])


def test_ends_of_quadratic_edges_on_the_axis_carry_nothing() -> None:
    """Of an arc they would have a small area of either sign, and a pressure without bound."""
    angles = np.array([0.0, 0.2, 0.08, 0.4, 0.3])
    arc, edges = np.column_stack([np.sin(angles), -np.cos(angles)]), np.array([[0, 1, 2], [1, 3, 4]])
    areas = bearing_areas(arc, edges, RevolvedMeasure())
    assert areas[0, 0] == 0.0
    np.testing.assert_allclose(areas.sum(), nodal_areas(arc, edges, RevolvedMeasure()).sum())
    np.testing.assert_allclose(areas.sum(), 2 * np.pi * (1 - np.cos(0.4)), rtol=1e-3)
    assert areas[areas != 0.0].min() > 0.0


class BulkAndShear(Elasticity):
    """A material of one's own, for bodies in the plane and in space."""

    def __init__(self, young_modulus: float, poisson_ratio: float) -> None:
        E, nu = young_modulus, poisson_ratio
        self._constants = E / (3 * (1 - 2 * nu)), E / (2 * (1 + nu))

    @property
    def parameters(self) -> tuple[float, ...]:
        return self._constants

    def stress(self, u: ufl.core.expr.Expr, parameters: tuple[ufl.Constant, ...]) -> ufl.core.expr.Expr:
        bulk, shear = parameters
        return bulk * ufl.div(u) * ufl.Identity(len(u)) + 2 * shear * ufl.dev(ufl.sym(ufl.grad(u)))


class ByEnergy(EnergyModel):
    """The same by its energy."""

    def __init__(self, young_modulus: float, poisson_ratio: float) -> None:
        E, nu = young_modulus, poisson_ratio
        self._constants = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))

    @property
    def parameters(self) -> tuple[float, ...]:
        return self._constants

    def energy(
        self, strain: ufl.core.expr.Expr, parameters: tuple[ufl.Constant, ...] | tuple[float, ...]
    ) -> ufl.core.expr.Expr:
        return parameters[0] / 2 * ufl.tr(strain) ** 2 + parameters[1] * ufl.inner(strain, strain)


@pytest.mark.parametrize("make", [BulkAndShear, ByEnergy])
def test_material_of_ones_own_works_unchanged(make: type[BulkAndShear] | type[ByEnergy]) -> None:
    scene = press_fit("quadrilateral", 3, "node")
    own = make(STEEL.young_modulus, STEEL.poisson_ratio)
    bodies = {name: replace(body, material=own) for name, body in scene.bodies.items()}
    ours, theirs = (solved(each).contact.pressure for each in (replace(scene, bodies=bodies), scene))
    np.testing.assert_allclose(ours, theirs, rtol=1e-9)


def test_materials_by_region_share_a_ring() -> None:
    """A soft lining carries the pressure of its seat: Lamé's equations of two rings."""
    mesh = rectangle((BORE, 0), (RIM, 2), (100, 2))
    inside = mesh.points[mesh.cells, 0].mean(axis=1) < SEAT
    mesh = replace(mesh, regions={"lining": np.flatnonzero(inside), "ring": np.flatnonzero(~inside)})
    soft = IsotropicElasticity(1e3, 0.4)
    supports = [Support("ring", side, (None, 0.0)) for side in ("y0", "y1")]
    body = Body(mesh, {"lining": soft, "ring": STEEL}, axisymmetric=True)
    state = solved(Scene({"ring": body}, supports, [Pressure("ring", "x0", PRESSURE)]))

    def flexibility(material: IsotropicElasticity, inner: float, outer: float, at: float, side: str) -> float:
        E, nu = material.young_modulus, material.poisson_ratio
        other = outer if side == "inside" else inner
        sign = 1.0 if side == "inside" else -1.0
        share = sign * (inner if side == "inside" else outer) ** 2 / (outer**2 - inner**2)
        return (1 + nu) / E * share * ((1 - 2 * nu) * at + other**2 / at)

    by_seat = flexibility(STEEL, SEAT, RIM, SEAT, "inside") - flexibility(soft, BORE, SEAT, SEAT, "outside")
    seat = PRESSURE * flexibility(soft, BORE, SEAT, SEAT, "inside") / by_seat
    expected = seat * flexibility(STEEL, SEAT, RIM, SEAT, "inside")
    found = state.gather_displacement("ring")[np.isclose(mesh.points[:, 0], SEAT), 0]
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_free_expansion_has_no_stress() -> None:
    mesh = section((0, 0), (3, 2), (4, 3), "quadrilateral")
    hot = ThermalStrain("disc", lambda x: np.full(len(x), 100.0))
    scene = Scene({"disc": Body(mesh, STEEL, axisymmetric=True)}, [Support("disc", "y0", (None, 0.0))], [hot])
    state = solved(scene)
    np.testing.assert_allclose(state.gather_displacement("disc"), 1.2e-3 * mesh.points, atol=1e-12)
    assert state.gather_von_mises("disc").max() < 1e-7
    assert np.abs(state.gather_nodal_stress("disc")).max() < 1e-7


@pytest.mark.parametrize(
    "load",
    [
        TotalForce("disc", "y1", (0.0, -300.0)),
        Traction("disc", "y1", (0.0, -300.0 / (9 * np.pi))),
        Pressure("disc", "y1", lambda x: np.full(len(x), 300.0 / (9 * np.pi))),
        BodyForce("disc", (0.0, -300.0 / (18 * np.pi))),
    ],
    ids=["total", "traction", "pressure", "body"],
)
def test_loads_are_those_of_a_full_revolution(load: TotalForce | Traction | Pressure | BodyForce) -> None:
    mesh = section((0, 0), (3, 2), (4, 3), "quadrilateral9")
    scene = Scene(
        {"disc": Body(mesh, STEEL, axisymmetric=True)}, [Support("disc", "y0", (None, 0.0))], [load]
    )
    state = solved(scene)
    assert state.reactions()[0].force[1] == pytest.approx(300.0, rel=1e-9)
    assert state.balance().imbalance < 1e-9
    assert "per revolution" in str(state.reactions())
    assert "Fz" in str(state.balance())


def test_rigid_surface_moves_along_the_axis_alone() -> None:
    mesh = rectangle((0, 0), (3, 2), (4, 3))
    top = RigidSurface("disc", "y1", (0, 2), force=(0.0, -300.0))
    scene = Scene({"disc": Body(mesh, STEEL, axisymmetric=True)}, [Support("disc", "y0", (None, 0.0)), top])
    state = solved(scene)
    moved = state.gather_displacement("disc")[mesh.points[:, 1] == 2]
    assert np.abs(np.ptp(moved, axis=0)).max() < 1e-12
    assert moved[0, 1] < 0
    assert abs(moved[0, 0]) < 1e-12
    assert state.reactions()[0].force[1] == pytest.approx(300.0, rel=1e-9)
    with pytest.raises(InvalidInputError, match="can move along the axis alone"):
        replace(scene, supports=[RigidSurface("disc", "y1", (0, 2), rotation=0.1)])


def test_body_is_held_by_what_stops_its_one_translation() -> None:
    """A disc that nothing holds radially rests on a rigid plane; without it it moves away."""
    disc = Body(section((0, 2), (3, 3), (4, 2), "quadrilateral"), STEEL, axisymmetric=True)
    pair = ContactPair(Surface("disc", "y0"), RigidPlane((0, 2), (0, 1)))
    state = solved(Scene({"disc": disc}, [], [Pressure("disc", "y1", PRESSURE)], [pair]))
    np.testing.assert_allclose(state.contact.pressure, PRESSURE, rtol=1e-9)
    assert state.torn.subdomains[0].kernel.shape[1] == 1
    above = ContactPair(Surface("disc", "y1"), RigidPlane((0, 4), (0, -1)))
    with pytest.raises(InfeasibleError, match="translation -1 along the axis"):
        solved(Scene({"disc": disc}, [], [Pressure("disc", "y1", PRESSURE)], [above]))


def test_axis_stays_where_it_is() -> None:
    scene = stacked("quadrilateral", "node", (4, 4))
    state = solved(replace(scene, loads=[Traction("upper", "y1", lambda x: -(x[:, :1] ** 2) * (1.0, 3.0))]))
    mesh = scene.bodies["upper"].mesh
    u = state.gather_displacement("upper")
    assert np.abs(u[mesh.points[:, 0] == 0.0, 0]).max() < 1e-20 * np.abs(u).max()
    with pytest.raises(InvalidInputError, match="radial displacement is zero on the axis"):
        solved(replace(scene, supports=[Support("lower", "y0", (0.1, 0.0))]))


def test_scene_says_that_it_is_one_of_revolution() -> None:
    scene = stacked("quadrilateral", "node", (4, 4))
    plan = str(scene.plan())
    assert "axisymmetry (2 bodies of revolution, all per revolution)" in plan
    assert "2 rigid motions" in plan
    assert "a body of revolution" in str(scene)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), STEEL, axisymmetric=True), "a plane mesh"),
        (lambda: Body(rectangle((-1, 0), (1, 1), (2, 2)), STEEL, axisymmetric=True), "3 nodes lie left"),
        (
            lambda: Body(rectangle((0, 0), (1, 1), (2, 2)), PlaneStrain(1.0, 0.3), axisymmetric=True),
            "must be one of space",
        ),
        (
            lambda: Body(
                rectangle((0, 0), (1, 1), (2, 2)),
                replace(WOUND, orientation=material_axes((1, 0, 0), (0, 1, 1))),
                axisymmetric=True,
            ),
            "inclined to the circumference",
        ),
        (
            lambda: Scene(
                {
                    "one": Body(rectangle((0, 0), (1, 1), (2, 2)), STEEL, axisymmetric=True),
                    "two": Body(rectangle((0, 0), (1, 1), (2, 2)), PlaneStrain(1.0, 0.3)),
                }
            ),
            "bodies of revolution or none",
        ),
        (
            lambda: Scene(
                {"one": Body(rectangle((0, 0), (1, 1), (2, 2)), STEEL, axisymmetric=True)},
                loads=[Pressure("one", "x0", 1.0)],
            ),
            "the axis of revolution",
        ),
        (
            lambda: Scene(
                {"one": Body(rectangle((0, 0), (1, 1), (2, 2)), STEEL, axisymmetric=True)},
                loads=[TotalForce("one", "y1", (0.0, 1.0), moment=1.0)],
            ),
            "leave both out",
        ),
    ],
)
def test_mistakes_are_named(make: object, words: str) -> None:
    with pytest.raises(InvalidInputError, match=words):
        make()  # type: ignore[operator]


def test_cut_bodies_have_the_answer_of_whole_ones() -> None:
    scene = pushed_with_friction()
    fields = []
    for cuts in (1, 8):
        parts = {name: bisection_partition(body.mesh, cuts) for name, body in scene.bodies.items()}
        state = solve_scene(scene, MPI.COMM_SELF, partitions=parts, tolerance=1e-12)
        fields.append(np.vstack([state.gather_displacement(name) for name in scene.bodies]))
    np.testing.assert_allclose(fields[1], fields[0], atol=1e-9 * np.abs(fields[0]).max())


RANKS = """
    import numpy as np
    from mpi4py import MPI
    from fenics_contact import solve_scene
    from tests.kinematics.revolved import pushed_with_friction

    comm, scene = MPI.COMM_WORLD, pushed_with_friction()
    state = solve_scene(scene, comm, partitions=scene.partition(4), tolerance=1e-12)
    moved = np.vstack([state.gather_displacement(name) for name in scene.bodies])
    stress = state.gather_nodal_stress("punch")[0, :, 2, 2]
    if comm.rank == 0:
        print(*(f"{x:.17g}" for x in (*moved.ravel(), *state.contact.pressure, *stress)))
"""


@pytest.mark.parametrize("ranks", [2, 4])
def test_all_ranks_have_the_answer_of_one(ranks: int, mpirun: Callable[..., str]) -> None:
    one, other = (np.array(mpirun(RANKS, count).split(), dtype=float) for count in (1, ranks))
    np.testing.assert_allclose(other, one, rtol=1e-8, atol=1e-9 * np.abs(one).max())


def test_pull_out_force_is_that_of_friction() -> None:
    """A shaft is drawn out of its ring: the friction of the whole seat resists."""
    scene = press_fit("quadrilateral", 8, "node", friction=0.2)
    pulled = [Support("shaft", "y0", (None, 0.4)), Support("shaft", "y1", (None, 0.4))]
    held = [Support("ring", "y0", (None, 0.0)), Support("ring", "y1", (None, 0.0))]
    state = solved(replace(scene, supports=[*pulled, *held]), 1e-9)
    contact = state.resultants().contacts[0].force
    assert contact[1] == pytest.approx(0.2 * contact[0], rel=1e-6)
    pair = scene.contacts[0]
    assert isinstance(pair.friction, Coulomb)


SCENE_FILE = """
[meshes.lid]
shape = "rectangle"
lower = [0.0, 1.0]
upper = [4.0, 2.0]
counts = [8, 2]

[materials.steel]
young_modulus = 2.1e5
poisson_ratio = 0.3

[bodies.lid]
mesh = "lid"
material = "steel"
axisymmetric = true

[[supports]]
body = "lid"
surface = "y0"
value = ["free", 0.0]

[[loads]]
kind = "pressure"
body = "lid"
surface = "y1"
value = 10.0

[output]
files = ["vtu"]
pictures = []
"""


def console() -> cli.Console:
    return cli.Console(MPI.COMM_SELF)


def test_scene_files_and_their_results_say_that_all_is_per_revolution(tmp_path: Path) -> None:
    (tmp_path / "lid.toml").write_text(SCENE_FILE)
    out = str(tmp_path / "out")
    ran = CliRunner().invoke(cli.app, ["run", str(tmp_path / "lid.toml"), "--output", out], obj=console())
    assert ran.exit_code == 0, ran.output
    shown = ran.output
    assert "1 body of revolution" in shown
    assert "forces (N) per revolution" in shown
    assert "502.65" in shown  # N, 10 N/mm² on π 4² mm²
    record = read_result(tmp_path / "out")
    assert record["scene"]["axisymmetric"] is True
    assert record["forces"]["balance"]["loads"]["moment"] == []
    assert CliRunner().invoke(cli.app, ["view", out, "--page"], obj=console()).exit_code == 0
    assert "radial and axial force" in (tmp_path / "out" / "page.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", ["triangle", "quadrilateral9"])
def test_sections_are_turned_into_bodies_with_their_fields(kind: Kind) -> None:
    mesh = section((0.5, 0), (3, 2), (4, 3), kind)
    load = Pressure("disc", "x1", PRESSURE)
    scene = Scene(
        {"disc": Body(mesh, STEEL, axisymmetric=True)}, [Support("disc", "y0", (None, 0.0))], [load]
    )
    state = solved(scene)
    whole = state.to_pyvista(revolved=90.0)["disc"]
    sector = 18 * np.sin(np.pi / 36) / (np.pi / 2)  # of chords in place of arcs
    assert whole.volume == pytest.approx(sector * scene.bodies["disc"].volume / 4, rel=1e-6)
    flat, x = state.to_pyvista(linear=True)["disc"], np.asarray(whole.points)
    moved, n = np.asarray(whole.point_data["displacement"]), flat.n_points
    radial = np.einsum("nd,nd->n", moved[:, :2], x[:, :2]) / np.linalg.norm(x[:, :2], axis=1)
    np.testing.assert_allclose(radial, np.tile(flat.point_data["displacement"][:, 0], 19), atol=1e-12)
    np.testing.assert_allclose(moved[:, 2], np.tile(flat.point_data["displacement"][:, 1], 19), atol=1e-12)
    stress = np.asarray(whole.point_data["nodal_stress"])
    hoop = np.asarray(flat.point_data["nodal_stress"])[:, 2]
    np.testing.assert_allclose(stress[:n, 1], hoop, atol=1e-9)  # along y where the section lies in x, z
    np.testing.assert_allclose(stress[-n:, 0], hoop, atol=1e-9)
    mises = von_mises_of(tensors(stress))
    np.testing.assert_allclose(mises, np.tile(flat.point_data["nodal_von_mises"], 19), rtol=1e-9)
    with pytest.raises(InvalidInputError, match="above 0 and up to 360"):
        state.to_pyvista(revolved=400.0)


@pytest.mark.parametrize("kind", ["triangle", "quadrilateral", "quadrilateral9"])
def test_shear_along_the_axis_has_no_hoop_stress_at_nodes(kind: Kind) -> None:
    """A tube whose outside moves along the axis: u_z = c ln r, τ = μ c / r, far from z = 0."""

    def along(points: np.ndarray) -> np.ndarray:
        return 0.01 * np.log(points[:, 0])

    tube = Body(section((2, 5), (3, 6), (8, 5), kind), STEEL, axisymmetric=True)
    state = solved(Scene({"tube": tube}, [Support("tube", side, (0.0, along)) for side in SIDES[:4]]))
    (stress,) = state.gather_nodal_stress("tube")
    shear = 0.01 * 2.1e5 / 2.6 / tube.mesh.points[:, 0]
    np.testing.assert_allclose(stress[:, 0, 1], shear, rtol=0.03)
    assert np.abs(np.diagonal(stress, axis1=1, axis2=2)).max() < 0.02 * shear.max()


def test_fields_of_bodies_of_revolution_are_drawn_over_r_and_z(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[ColouredField] = []
    monkeypatch.setattr(states, "draw_field_on_bodies", lambda bodies, field, *_, **__: drawn.append(field))
    state = solved(
        Scene(
            {"disc": Body(section((1, 0), (3, 2), (3, 2), "quadrilateral"), STEEL, axisymmetric=True)},
            [Support("disc", "y0", (None, 0.0))],
            [Pressure("disc", "x0", PRESSURE)],
        )
    )
    states.plot_field(state, "stress_zz")
    states.plot_field(state, {"disc": state.gather_von_mises("disc")})
    assert [field.axes for field in drawn] == [("r", "z"), ("r", "z")]

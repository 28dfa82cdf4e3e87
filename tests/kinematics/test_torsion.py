"""Torsion of bodies of revolution: tubes, shafts and press fits known by formula, kernels, loads, results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from typer.testing import CliRunner

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    CyclicSymmetry,
    ElasticFoundation,
    LoadStep,
    Preload,
    Pressure,
    RigidPlane,
    RigidSurface,
    RigidTool,
    Roller,
    Scene,
    Section,
    ShapeProblem,
    Spring,
    State,
    Support,
    Surface,
    SurfaceDesign,
    ThermalStrain,
    Tie,
    TotalForce,
    Traction,
    centrifugal,
    solve_scene,
    solve_steps,
)
from fenics_contact import _cli as cli
from fenics_contact._equilibrium.rolling import rolling
from fenics_contact.design import StrainEnergy
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke, OrthotropicElasticity, material_axes
from fenics_contact.mesh import bisection_partition, quadratic
from fenics_contact.output import read_result, write_contact_table
from fenics_contact.pictures import plot_contact_pressure, plot_stress
from fenics_contact.pictures.curves import contact_trace
from fenics_contact.results.linear_state import as_linear
from tests.equilibrium.press_fits import Disc
from tests.kinematics.revolved import (
    BORE,
    INTERFERENCE,
    KINDS,
    PRESSURE,
    RIM,
    SEAT,
    STEEL,
    Kind,
    press_fit_pressure,
    pushed_with_friction,
    section,
    stacked,
    twisted_fit,
)

SHEAR = STEEL.young_modulus / (2 * (1 + STEEL.poisson_ratio))
TORQUE = 1e6  # N mm


def twisting(mesh: BodyMesh, material: IsotropicElasticity | OrthotropicElasticity = STEEL) -> Body:
    return Body(mesh, material, axisymmetric=True, torsion=True)


def with_torsion(scene: Scene, *supports: Support | RigidSurface) -> Scene:
    """The scene with bodies that may twist; supports that it has leave the way around free."""
    bodies = {name: replace(body, torsion=True) for name, body in scene.bodies.items()}
    free = [replace(each, value=(*each.value, None)) for each in scene.supports if isinstance(each, Support)]
    return replace(scene, bodies=bodies, supports=[*free, *supports])


def solved(scene: Scene, tolerance: float = 1e-10) -> State:
    return solve_scene(scene, MPI.COMM_SELF, tolerance=tolerance)


@pytest.mark.parametrize("kind", KINDS)
def test_tube_between_two_torques_has_the_exact_twist(kind: Kind) -> None:
    """u_θ = T r / (4 π G L) (1 / a² − 1 / r²), τ_rθ = T / (2 π r² L)."""
    inner, outer, length = 10.0, 20.0, 5.0
    mesh = rectangle((inner, 0), (outer, length), (12, 2), "triangle" if "tri" in kind else "quadrilateral")
    mesh = quadratic(mesh) if kind[-1] in "69" else mesh
    load = TotalForce("tube", "x1", (0.0, 0.0), moment=TORQUE)
    state = solved(Scene({"tube": twisting(mesh)}, [Support("tube", "x0")], [load]))
    moved, r = state.gather_displacement("tube"), mesh.points[:, 0]
    expected = TORQUE / (4 * np.pi * SHEAR * length) * (1 / inner**2 - 1 / r**2) * r
    accuracy = {"triangle": 1e-3, "quadrilateral": 5e-4, "triangle6": 3e-5, "quadrilateral9": 5e-7}[kind]
    np.testing.assert_allclose(moved[:, 2], expected, atol=accuracy * expected.max())
    assert np.abs(moved[:, :2]).max() <= 1e-12 * expected.max()
    stress = state.gather_nodal_stress("tube")[0]
    accuracy = 1e-2 if kind[-1] not in "69" else 1e-3
    largest = TORQUE / (2 * np.pi * inner**2 * length)
    np.testing.assert_allclose(stress[:, 0, 2], largest * (inner / r) ** 2, atol=accuracy * largest)
    assert state.reactions()["tube x0"].moment == pytest.approx([-TORQUE], rel=1e-9)
    assert state.balance().imbalance < 1e-9
    shown = str(state.reactions())
    assert shown.splitlines()[0].split() == ["Fr", "Fz", "T"]
    assert "T in [force·length] per revolution" in shown
    assert "torque -1e+06" in str(state.reactions()[0])


def test_shaft_twists_by_torque_over_stiffness() -> None:
    """φ' = T / (G J), τ = T r / J, in stiff steel and soft brass one after the other; exact on rectangles."""
    brass = IsotropicElasticity(1e5, 0.35)
    mesh = rectangle((0, 0), (5, 30), (3, 6))
    below = mesh.points[mesh.cells, 1].mean(axis=1) < 15
    mesh = replace(mesh, regions={"steel": np.flatnonzero(below), "brass": np.flatnonzero(~below)})
    body = Body(mesh, {"steel": STEEL, "brass": brass}, axisymmetric=True, torsion=True)
    load = TotalForce("shaft", "y1", (0.0, 0.0), moment=1e4)
    scene = Scene({"shaft": body}, [Support("shaft", "y0")], [load])
    state, polar = solved(scene), np.pi * 5**4 / 2
    r, z = mesh.points.T
    soft = 1e5 / 2.7
    angle = 1e4 / polar * (np.minimum(z, 15) / SHEAR + np.maximum(z - 15, 0) / soft)
    np.testing.assert_allclose(state.gather_displacement("shaft")[:, 2], angle * r, rtol=1e-9, atol=1e-15)
    stress = state.gather_nodal_stress("shaft")
    steel = np.isfinite(stress[0, :, 0, 0])
    np.testing.assert_allclose(stress[0, steel, 1, 2], 1e4 * r[steel] / polar, atol=1e-7)
    np.testing.assert_allclose(stress[0, steel, 0, 2], 0.0, atol=1e-7)
    assert state.energies.strain == pytest.approx(0.5 * 1e4 * angle.max(), rel=1e-9)
    plan = str(scene.plan())
    assert "torsion (1 body may twist about its axis)" in plan
    assert f"{3 * mesh.n_nodes} in 1 subdomain" in plan


@pytest.mark.parametrize(("by", "counts"), [("node", (4, 4)), ("mortar", (4, 7))])
def test_a_turn_of_stacked_cylinders_leaves_their_patch_alone(by: str, counts: tuple[int, int]) -> None:
    scene = stacked("quadrilateral", by, counts, friction=0.3)  # type: ignore[arg-type]
    turned = Support("lower", "y0", (None, None, lambda x: 0.01 * x[:, 0]))
    state = solved(with_torsion(scene, turned))
    for name, body in state.scene.bodies.items():
        moved = state.gather_displacement(name)
        np.testing.assert_allclose(moved[:, 2], 0.01 * body.mesh.points[:, 0], atol=1e-11)
        stress = state.gather_stress(name)
        assert np.abs(stress - np.diag([0.0, -PRESSURE, 0.0])).max() < 1e-9 * PRESSURE
    np.testing.assert_allclose(state.contact.pressure, PRESSURE, rtol=1e-9)
    assert abs(state.resultants().contacts[0].moment[0]) < 1e-9 * PRESSURE * np.pi * 27  # type: ignore[index]


@pytest.mark.parametrize("tied", [False, True])
def test_a_torque_passes_matching_cylinders_exactly(tied: bool) -> None:
    """u_θ = φ' r z through both; friction, or a tie, transmits τ = G φ' r at every node."""
    slope, top = 1e-4, Traction("upper", "y1", lambda x: SHEAR * 1e-4 * x[:, :1] * (0.0, 0.0, 1.0))
    bodies = {
        "lower": twisting(rectangle((0, 0), (3, 1), (4, 3))),
        "upper": twisting(rectangle((0, 1), (3, 2), (4, 2))),
    }
    faces = Surface("upper", "y0"), Surface("lower", "y1")
    supports = [Support("lower", "y0", (None, 0.0, 0.0))]
    loads = [Pressure("upper", "y1", 4 * SHEAR * 3 * slope), top]
    ties, pairs = ([Tie(*faces)], []) if tied else ([], [ContactPair(*faces, Coulomb(0.5))])
    state = solved(Scene(bodies, supports, loads, pairs, ties))
    for name, body in bodies.items():
        r, z = body.mesh.points.T
        np.testing.assert_allclose(
            state.gather_displacement(name)[:, 2], slope * r * z, atol=1e-9 * 6 * slope
        )
    torque = SHEAR * slope * np.pi * 3**4 / 2
    found = state.resultants()
    assert (found.ties if tied else found.friction)[0].moment == pytest.approx([-torque], rel=1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("inner", [0.0, 1.0])
def test_stiffness_annihilates_translation_and_turn(kind: Kind, inner: float) -> None:
    mesh = section((inner, 0), (3, 2), (4, 3), kind)
    bed = ContactPair(Surface("disc", "y0"), RigidPlane((0, 0), (0, 1)), Coulomb(0.2))
    scene = Scene({"disc": twisting(mesh)}, [], [Pressure("disc", "y1", 1.0)], [bed])
    state = solved(scene)
    (part,) = state.torn.subdomains
    assert part.kernel.shape == (3 * mesh.n_nodes, 2)
    assert np.linalg.matrix_rank(part.kernel) == 2
    assert np.abs(part.stiffness @ part.kernel).max() < 1e-9 * part.stiffness.diagonal().max()
    if inner:  # nothing is held on an axis
        values = np.linalg.eigvalsh(part.stiffness.toarray())
        assert np.count_nonzero(values < 1e-10 * values[-1]) == 2


@pytest.mark.parametrize(
    ("kind", "by"),
    [
        ("quadrilateral", "node"),
        ("quadrilateral", "mortar"),
        ("quadrilateral9", "node"),
        ("triangle6", "mortar"),
    ],
)
def test_press_fit_slips_at_the_torque_of_its_friction(kind: Kind, by: str) -> None:
    """Uniform pressure p: T = μ p 2 π b² L; before it the tube's T = 4 π G L φ / (1/a² − 1/c²)."""
    slips = 0.2 * press_fit_pressure() * 2 * np.pi * SEAT**2 * 6
    angle = slips * (1 / BORE**2 - 1 / RIM**2) / (4 * np.pi * SHEAR * 6)
    accuracy = 2e-3 if kind == "quadrilateral" else 1e-5
    for share, expected in ((0.5, 0.5), (2.0, 1.0)):
        state = solved(twisted_fit(kind, 10, by, share * angle), 1e-9)  # type: ignore[arg-type]
        torque = -state.resultants().friction[0].moment[0]  # type: ignore[index]
        assert torque == pytest.approx(expected * slips, rel=accuracy)
        assert state.contact.count(2) == (state.contact.points.count if share > 1 else 0)  # type: ignore[arg-type]
        assert state.reactions()["ring x1"].moment == pytest.approx([torque], rel=1e-6)


def test_a_torque_below_that_of_friction_is_held_and_one_above_is_not() -> None:
    scene = twisted_fit("quadrilateral9", 4, "node", 0.0)
    slips = 0.2 * press_fit_pressure() * 2 * np.pi * SEAT**2 * 6
    grip = TotalForce("ring", "x1", (0.0, 0.0), moment=0.8 * slips)
    scene = replace(scene, supports=scene.supports[:-1], loads=[grip])
    state = solved(scene, 1e-9)
    assert state.resultants().friction[0].moment == pytest.approx([-0.8 * slips], rel=1e-6)
    mesh = scene.bodies["ring"].mesh
    turn = state.gather_displacement("ring")[np.unique(mesh.surfaces["x1"]), 2] / RIM
    expected = 0.8 * slips * (1 / BORE**2 - 1 / RIM**2) / (4 * np.pi * SHEAR * 6)
    np.testing.assert_allclose(turn, expected, rtol=5e-4)
    with pytest.raises(InfeasibleError, match=r"rotation 1 about the axis"):
        solved(replace(scene, loads=[replace(grip, moment=1.2 * slips)]), 1e-9)


def test_a_rigid_end_turns_and_moves_by_its_torque_and_force() -> None:
    mesh = rectangle((0, 0), (5, 30), (3, 5))
    end = RigidSurface("shaft", "y1", (0.0, 30.0), force=(0.0, 200.0), moment=1e4)
    material = IsotropicElasticity(2.1e5, 0.0)
    state = solved(Scene({"shaft": twisting(mesh, material)}, [Support("shaft", "y0"), end]))
    (motion,) = state.rigid_motions()
    assert motion.rotation == pytest.approx(1e4 * 30 / (1.05e5 * np.pi * 5**4 / 2), rel=1e-9)
    assert motion.displacement == pytest.approx([0.0, 200 * 30 / (2.1e5 * np.pi * 25)], rel=1e-9)
    reaction = state.reactions()["shaft y0"]
    assert [*reaction.force, *reaction.moment] == pytest.approx([0.0, -200.0, -1e4], rel=1e-9, abs=1e-6)  # type: ignore[misc]
    assert state.reactions()["shaft y1"].moment == pytest.approx([0.0], abs=1e-6)
    turned = replace(end, force=None, moment=None, displacement=(0.0, 0.1), rotation=1e-3)
    state = solved(replace(state.scene, supports=[Support("shaft", "y0"), turned]))
    assert state.reactions()["shaft y1"].moment == pytest.approx(
        [1e-3 * 1.05e5 * np.pi * 5**4 / 60], rel=1e-9
    )


def test_a_press_fit_turned_back_keeps_a_torque() -> None:
    """Slip is remembered: turned until it slips, then back by twice the elastic angle, it slips back."""
    slips = 0.2 * press_fit_pressure() * 2 * np.pi * SEAT**2 * 6
    angle = slips * (1 / BORE**2 - 1 / RIM**2) / (4 * np.pi * SHEAR * 6)
    scene = twisted_fit("quadrilateral9", 3, "node", 0.0)

    def turn(share: float) -> LoadStep:
        turned = Support("ring", "x1", (None, None, lambda x: share * angle * x[:, 0]))
        return LoadStep(f"{share:g}", supports=[*scene.supports[:-1], turned])

    states = solve_steps(
        ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-9), [turn(s) for s in (1.5, 0.5, -1.5)]
    )
    torques = [-state.resultants().friction[0].moment[0] / slips for state in states]  # type: ignore[index]
    np.testing.assert_allclose(torques, [1.0, 0.0, -1.0], atol=1e-3)


def test_a_disc_turned_on_a_plate_has_the_torque_of_its_pressure() -> None:
    """T = μ p 2 π R³ / 3, of a rigid obstacle."""
    punch = twisting(rectangle((0, 0), (3, 1), (5, 2)), IsotropicElasticity(1e3, 0.0))
    turned = Support("punch", "y1", (0.0, None, lambda x: 0.1 * x[:, 0]))
    pair = ContactPair(Surface("punch", "y0"), RigidPlane((0, 0), (0, 1)), Coulomb(0.3))
    state = solved(Scene({"punch": punch}, [turned], [Pressure("punch", "y1", 2.0)], [pair]))
    torque = 0.3 * 2.0 * 2 * np.pi * 27 / 3
    assert state.resultants().friction[0].moment == pytest.approx([-torque], rel=1e-6)
    assert np.abs(state.contact.total_slip[:, 0]).max() < 1e-6
    assert state.contact.slip[-1, 1] > 0.0


def test_without_a_torque_all_is_as_without_torsion() -> None:
    plain = pushed_with_friction()
    hot = ThermalStrain("disc", 20.0)
    spun = centrifugal("punch", 7.85e-9, 300.0, (0.0, 0.0), (0.0, 1.0))
    plain = replace(plain, loads=[hot, spun, TotalForce("punch", "x1", (5.0, -3.0))])
    ours, theirs = solved(with_torsion(plain)), solved(plain)
    for name in plain.bodies:
        one, other = (state.gather_displacement(name) for state in (ours, theirs))
        np.testing.assert_allclose(one[:, :2], other, atol=1e-8 * np.abs(other).max())
        assert np.abs(one[:, 2]).max() < 1e-9 * np.abs(other).max()
        stress = [state.gather_nodal_stress(name)[0] for state in (ours, theirs)]
        np.testing.assert_allclose(*stress, atol=1e-6 * np.abs(stress[0]).max())
    assert ours.resultants().contacts[0].force == pytest.approx(theirs.resultants().contacts[0].force)
    errors = [as_linear(state, "errors").estimate_errors().discretisation for state in (ours, theirs)]
    assert errors[0] == pytest.approx(errors[1], rel=1e-6)


def test_estimate_of_the_error_of_a_twisted_tube_is_near_the_error() -> None:
    mesh = rectangle((2, 0), (12, 5), (10, 5))
    load = TotalForce("tube", "x1", (0.0, 0.0), moment=TORQUE)
    state = solved(Scene({"tube": twisting(mesh)}, [Support("tube", "x0")], [load]))
    work = TORQUE**2 / (4 * np.pi * SHEAR * 5) * (1 / 4 - 1 / 144)
    error = np.sqrt(work / (2 * state.energies.strain) - 1)  # relative, in energy
    estimate = as_linear(state, "errors").estimate_errors().discretisation
    assert 0.7 < estimate / error < 1.2


def test_fibres_that_wind_around_a_tube_twist_it_when_it_is_pulled() -> None:
    """φ' = S_zθ,zz σ / R of a thin tube; without torsion such a material is refused."""
    turned = material_axes((0, 1, 0.5), (0, -0.5, 1))  # in r, z and around
    wound = OrthotropicElasticity((1.4e5, 1e4, 1e4), (0.3, 0.3, 0.3), (5e3, 5e3, 4e3), orientation=turned)
    mesh = rectangle((100, 0), (101, 4), (2, 4))
    scene = Scene(
        {"tube": twisting(mesh, wound)},
        [Support("tube", "y0", (None, 0.0, 0.0))],
        [Pressure("tube", "y1", -1.0)],
    )
    twist = solved(scene).gather_displacement("tube")[:, 2]
    compliance = np.linalg.inv(wound.stiffness_matrix)  # xx, yy, zz, yz, xz, xy
    slope = np.polyfit(mesh.points[:, 1], twist, 1)[0]
    assert abs(compliance[3, 1]) > 1e-6
    assert slope == pytest.approx(compliance[3, 1], rel=0.02)
    with pytest.raises(InvalidInputError, match="inclined to the circumference"):
        Body(mesh, wound, axisymmetric=True)


def test_springs_around_a_shaft_resist_its_torque() -> None:
    """φ = T / (k ∫ r²) of a stiff shaft on soft springs along the way around."""
    soft, mesh = 1e-2, rectangle((0, 0), (5, 10), (3, 4))
    springs = ElasticFoundation("shaft", "x1", (0.0, 0.0, soft))
    top = TotalForce("shaft", "y1", (0.0, 0.0), moment=100.0)
    scene = Scene(
        {"shaft": twisting(mesh)}, [Support("shaft", "y0", (None, 0.0, None))], [top], foundations=[springs]
    )
    state = solved(scene)
    angle = state.gather_displacement("shaft")[mesh.points[:, 0] == 5.0, 2] / 5.0
    np.testing.assert_allclose(angle, 100.0 / (soft * 2 * np.pi * 5**3 * 10), rtol=1e-4)
    assert state.foundations()[0].moment == pytest.approx([-100.0], rel=1e-6)


def test_cut_bodies_have_the_answer_of_whole_ones() -> None:
    turned = RigidSurface("punch", "y1", (0.0, 6.0), (0.0, -0.002), rotation=2e-4)
    scene = with_torsion(pushed_with_friction(), Support("disc", "y0", (None, None, 0.0)))
    scene = replace(scene, supports=[each for each in scene.supports if each.surface != "y1"] + [turned])
    fields = []
    for cuts in (1, 8):
        parts = {name: bisection_partition(body.mesh, cuts) for name, body in scene.bodies.items()}
        state = solve_scene(scene, MPI.COMM_SELF, partitions=parts, tolerance=1e-12)
        fields.append(np.vstack([state.gather_displacement(name) for name in scene.bodies]))
        assert 0 < state.contact.count(2) < state.contact.points.count  # type: ignore[arg-type]
    np.testing.assert_allclose(fields[1], fields[0], atol=1e-9 * np.abs(fields[0]).max())


RANKS = """
    import numpy as np
    from mpi4py import MPI
    from fenics_contact import solve_scene
    from tests.kinematics.revolved import twisted_fit

    comm, scene = MPI.COMM_WORLD, twisted_fit("quadrilateral", 6, "mortar", 1e-3)
    state = solve_scene(scene, comm, partitions=scene.partition(4), tolerance=1e-12)
    moved = np.vstack([state.gather_displacement(name) for name in scene.bodies])
    stress = state.gather_nodal_stress("ring")[0, :, 0, 2]
    torque = state.reactions()["ring x1"].moment
    if comm.rank == 0:
        print(*(f"{x:.17g}" for x in (*moved.ravel(), *state.contact.pressure, *stress, *torque)))
"""


@pytest.mark.parametrize("ranks", [2, 4])
def test_all_ranks_have_the_answer_of_one(ranks: int, mpirun: Callable[..., str]) -> None:
    one, other = (np.array(mpirun(RANKS, count).split(), dtype=float) for count in (1, ranks))
    np.testing.assert_allclose(other, one, rtol=1e-8, atol=1e-9 * np.abs(one).max())


def around(mesh: BodyMesh, angle: float, cells: int) -> BodyMesh:
    """A sector in space of a section of quadrilaterals, its axis that of z; sides "first" and "last"."""
    turns, n = np.linspace(0.0, angle, cells + 1), mesh.n_nodes
    r, z = mesh.points.T
    points = np.concatenate([np.column_stack([r * np.cos(t), r * np.sin(t), z]) for t in turns])
    swept = [np.hstack([mesh.cells + n * (k + 1), mesh.cells + n * k]) for k in range(cells)]
    sides = {
        name: np.concatenate([np.hstack([edge[:, ::-1] + n * k, edge + n * (k + 1)]) for k in range(cells)])
        for name, edge in mesh.surfaces.items()
    }
    sides |= {"first": mesh.cells, "last": mesh.cells[:, ::-1] + n * cells}
    return BodyMesh(points, np.concatenate(swept), sides)


@pytest.mark.parametrize("turned", [8e-4, 8e-3])
def test_torque_is_that_of_a_sector_in_space(turned: float) -> None:
    """15° of the press fit in three cells, both sides tied by a turn, with slip."""
    flat = twisted_fit("quadrilateral", 4, "node", turned)
    held = (("shaft", "x0", 0.0), ("ring", "x1", turned))
    between = [each for each in flat.supports if each.surface in ("y0", "y1")]
    ends = [Support(name, side, (0.0, None, lambda x, a=a: a * x[:, 0])) for name, side, a in held]
    flat = replace(flat, supports=[*between, *ends])
    bodies = {name: Body(around(body.mesh, np.pi / 12, 3), STEEL) for name, body in flat.bodies.items()}
    supports = [Support(name, side, (None, None, 0.0)) for name in bodies for side in ("y0", "y1")]
    for name, side, angle in held:
        turn = (lambda x, a=angle: -a * x[:, 1]), (lambda x, a=angle: a * x[:, 0])
        supports.append(Support(name, side, (*turn, None)))
    axis = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    sides = [CyclicSymmetry(Surface(name, "last"), Surface(name, "first"), *axis) for name in bodies]
    whole = Scene(bodies, supports, contacts=flat.contacts, ties=sides)
    ours, theirs = solved(flat, 1e-8), solved(whole, 1e-8)
    torque = ours.resultants().friction[0].moment[0]  # type: ignore[index]
    in_space = 24 * theirs.resultants(about=(0, 0, 0)).friction[0].moment[2]  # type: ignore[index]
    assert torque == pytest.approx(in_space, rel=5e-3)
    slipping = ours.contact.points.count if turned > 1e-3 else 0
    assert ours.contact.count(2) == slipping  # type: ignore[arg-type]


SCENE_FILE = """
[meshes.tube]
shape = "rectangle"
lower = [10.0, 0.0]
upper = [20.0, 5.0]
counts = [6, 2]

[materials.steel]
young_modulus = 2.1e5
poisson_ratio = 0.3

[bodies.tube]
mesh = "tube"
material = "steel"
axisymmetric = true
torsion = true

[[supports]]
body = "tube"
surface = "x0"

[[loads]]
kind = "total_force"
body = "tube"
surface = "x1"
value = [0.0, 0.0]
moment = 1.0e6

[output]
files = ["vtu", "xdmf"]
pictures = ["stress"]
fields = ["displacement_z"]
"""


def test_scene_files_and_their_results_know_torsion(tmp_path: Path) -> None:
    (tmp_path / "tube.toml").write_text(SCENE_FILE)
    out, console = str(tmp_path / "out"), cli.Console(MPI.COMM_SELF)
    ran = CliRunner().invoke(cli.app, ["run", str(tmp_path / "tube.toml"), "--output", out], obj=console)
    assert ran.exit_code == 0, ran.output
    assert "-1e+06" in ran.output
    assert "forces (N) and torques (N mm) per revolution" in " ".join(ran.output.split())
    head = next(line for line in ran.output.splitlines() if "Fr" in line)
    assert head.split()[-3:] == ["Fr", "Fz", "T"]
    record = read_result(tmp_path / "out")
    assert record["scene"]["torsion"] is True
    assert record["forces"]["balance"]["reactions"]["moment"] == pytest.approx([-1e6])
    console = cli.Console(MPI.COMM_SELF)
    assert CliRunner().invoke(cli.app, ["view", out, "--page"], obj=console).exit_code == 0
    page = (tmp_path / "out" / "page.html").read_text(encoding="utf-8")
    assert "torque (N mm)" in page
    assert "axial forces and torques per revolution" in page


def test_a_twisted_section_is_turned_around_with_its_displacement() -> None:
    scene = twisted_fit("quadrilateral", 3, "node", 1e-3)
    state = solved(scene, 1e-8)
    whole, flat = state.to_pyvista(revolved=90.0)["ring"], state.gather_displacement("ring")
    x, moved = np.asarray(whole.points), np.asarray(whole.point_data["displacement"])
    radius = np.linalg.norm(x[:, :2], axis=1)
    tangential = (x[:, 0] * moved[:, 1] - x[:, 1] * moved[:, 0]) / radius
    np.testing.assert_allclose(tangential, np.tile(flat[:, 2], 19), atol=1e-12)
    bent = np.asarray(state.to_pyvista(deformed=1.0)["ring"].points)
    np.testing.assert_allclose(bent[:, 2], flat[:, 2], atol=1e-7)


def test_pictures_show_the_size_of_the_traction_and_its_torque(tmp_path: Path) -> None:
    state = solved(twisted_fit("quadrilateral", 3, "node", 2e-3), 1e-8)
    trace = contact_trace(state, 0)
    np.testing.assert_allclose(trace.traction, 0.2 * trace.pressure, rtol=1e-6)
    assert trace.shear == pytest.approx(state.resultants().friction[0].moment[0], rel=1e-6)  # type: ignore[index]
    assert trace.slip.min() > 0.0
    for draw in (plot_stress, plot_contact_pressure):
        draw(state, tmp_path / "drawn.png")
        assert (tmp_path / "drawn.png").stat().st_size > 0


def test_table_of_contact_points_has_three_components(tmp_path: Path) -> None:
    state = solved(twisted_fit("quadrilateral", 3, "node", 2e-3), 1e-8)
    text = write_contact_table(state, tmp_path / "contact.csv").read_text()
    head, *rows = [line for line in text.splitlines() if not line.startswith("#")]
    assert "traction_z" in head
    assert "z_moved" not in head
    column = head.split(",").index("traction_z")
    found = [float(row.split(",")[column]) for row in rows]
    np.testing.assert_allclose(found, -0.2 * state.contact.pressure, rtol=1e-3)


def test_a_body_that_turns_far_is_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    mesh = rectangle((1, 0), (2, 1), (3, 2))
    turned = Support("tube", "y0", (None, 0.0, lambda x: 0.3 * x[:, 0]))
    solved(Scene({"tube": twisting(mesh)}, [turned]))
    assert "body 'tube' has turned by 0.3 rad" in caplog.text
    assert "take it in space and give it a material" in caplog.text


def test_a_shaft_travels_until_it_touches() -> None:
    punch = twisting(rectangle((1, 1), (2, 2), (2, 2)))
    pair = ContactPair(Surface("punch", "y0"), RigidPlane((0, 0.75), (0, 1)), Coulomb(0.3))
    state = solved(Scene({"punch": punch}, [Support("punch", "y1")], contacts=[pair]))
    assert state.contact.travel(np.array([0.0, -1.0])) == pytest.approx(0.25)


def small(**given: object) -> Body:
    return Body(rectangle((1, 0), (2, 1), (2, 2)), STEEL, **{"axisymmetric": True, "torsion": True, **given})  # type: ignore[arg-type]


def fit() -> Scene:
    return twisted_fit("quadrilateral", 3, "node", 0.0)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: small(axisymmetric=False), "needs a body of revolution"),
        (lambda: Scene({"a": small(), "b": small(torsion=False)}), "able to twist or none"),
        (
            lambda: Scene({"a": replace(small(), material=NeoHooke(1.0, 0.3))}),
            "torsion=True needs linear materials",
        ),
        (lambda: Scene({"a": small()}, [Roller("a", "x1")]), "needs no rollers"),
        (
            lambda: Scene(
                {"a": small()},
                contacts=[
                    ContactPair(Surface("a", "y0"), RigidTool("pad", RigidPlane((0, 0), (0, 1)), (0, 0)))
                ],
            ),
            "needs no rigid tools",
        ),
        (
            lambda: Scene({"a": small()}, preloads=[Preload("a", Section((1.5, 0.5), (0, 1)), 10.0)]),
            "needs no preloads",
        ),
        (
            lambda: Scene({"a": small()}, springs=[Spring(Surface("a", "y0"), (1.5, -1.0), (0.0, 1.0))]),
            "needs no springs",
        ),
        (
            lambda: Scene({"a": small()}, [Support("a", "y0", (None, 0.0))]),
            "three, for r, z and the way around",
        ),
        (lambda: Scene({"a": small()}, [], [Traction("a", "x1", (0.0, 1.0))]), "three, for r, z"),
        (lambda: Scene({"a": small()}, [], [BodyForce("a", (0.0, 1.0))]), "three, for r, z"),
        (
            lambda: Scene({"a": small()}, [], [TotalForce("a", "x1", (0.0, 1.0, 2.0))]),
            "a torque is its moment",
        ),
        (
            lambda: Scene({"a": small()}, [], [TotalForce("a", "x1", (0.0, 1.0), at=(0.0, 1.0))]),
            "leave both out",
        ),
        (
            lambda: Scene({"a": small()}, [RigidSurface("a", "y0", (0.0, 0.0), (0.1, 0.0))]),
            "along the axis and turn about it alone",
        ),
        (
            lambda: solved(
                Scene(
                    {"a": twisting(rectangle((0, 0), (1, 1), (2, 2)))},
                    [Support("a", "y0", (0.0, 0.0, 0.1))],
                )
            ),
            "displacement around is zero on the axis",
        ),
        (
            lambda: ShapeProblem(
                ContactProblem(fit(), MPI.COMM_SELF), SurfaceDesign("ring", "x0", net=(3,)), StrainEnergy()
            ),
            "designs need bodies without torsion",
        ),
        (lambda: Body(block((0, 0, 0), (1, 1, 1), (1, 1, 1)), STEEL, torsion=True), "body of revolution"),
        (
            lambda: solved(fit()).reactions()[0].torque((0, 0, 0), (0, 0, 1)),
            "use moment_about.* bodies of revolution",
        ),
    ],
)
def test_mistakes_are_named(make: Callable[[], object], words: str) -> None:
    with pytest.raises(InvalidInputError, match=words):
        make()


def test_pressure_of_a_fit_does_not_depend_on_its_torque() -> None:
    assert INTERFERENCE > 0.0
    pressures = [
        solved(twisted_fit("quadrilateral", 4, "node", turn), 1e-9).contact.pressure for turn in (0.0, 3e-3)
    ]
    np.testing.assert_allclose(*pressures, rtol=1e-6)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
def test_bodies_that_slide_around_the_axis_roll_nowhere(discretisation: Disc) -> None:
    """Surfaces are alike around the axis: slip far larger than the approach changes no gap."""
    scene = stacked("quadrilateral", discretisation, (3, 2))
    upper = max(scene.bodies, key=lambda name: scene.bodies[name].mesh.points[:, 1].max())
    turned = Support(upper, "y1", (None, None, lambda x: 0.1 * x[:, 0]))
    state = solved(with_torsion(scene, turned))
    assert np.abs(state.contact.total_slip[:, 1]).max() > 100 * np.abs(state.contact.gap).max()
    assert rolling(state, 0, 0.0).gap == 0.0

"""Prescribed motion, pressures that follow, and values that are reported."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scipy.integrate import solve_bvp

from fenics_contact import (
    AutomaticSteps,
    Body,
    BodyMesh,
    ContactPair,
    ContactProblem,
    Coulomb,
    DeformedState,
    LoadSequence,
    LoadStep,
    MovingObstacle,
    Pressure,
    RigidPlane,
    RigidSurface,
    Scene,
    Support,
    Surface,
    TangentNewton,
    Traction,
    Ufl,
    box_partition,
    read_scene_file,
    solve_scene,
    solve_steps,
)
from fenics_contact._fem.forms import FormLibrary
from fenics_contact._scene.effects import EffectName
from fenics_contact._scene_file.reading import SceneFile
from fenics_contact._scene_file.source import SceneFileError
from fenics_contact.errors import InvalidInputError, UserCodeError
from fenics_contact.feti.subdomain import assemble, cut_out
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import (
    IsotropicElasticity,
    J2Plasticity,
    NeoHooke,
    PlaneStrain,
    StVenantKirchhoff,
)
from fenics_contact.mesh import bisection_partition, quadratic
from fenics_contact.qp import Smalse
from tests.large_deformations.scenes import RUBBER, cut
from tests.materials.deformed import rotation, skew_patch, smooth_field

CUBE = block((0, 0, 0), (1, 1, 1), (3, 3, 3))
ROD = block((-0.5, -0.5, 0), (0.5, 0.5, 2), (3, 3, 6))


def turn(angle: float, surface: str = "z0") -> RigidSurface:
    """A turn about an axis through a point beside the cube."""
    return RigidSurface("block", surface, (2.0, 0.0, 0.0), (0.0, 0.0, 0.1), (0.0, 0.0, angle))


def following(supports: list[RigidSurface | Support], step: LoadStep, **how: float) -> DeformedState:
    scene = Scene({"block": Body(CUBE, RUBBER)}, supports)
    steps = AutomaticSteps(TangentNewton(1e-9), **how)
    problem = ContactProblem(scene, MPI.COMM_SELF, partitions=cut(CUBE, 1), steps=steps)
    (state,) = solve_steps(problem, [step])
    assert isinstance(state, DeformedState)
    return state


@pytest.mark.parametrize("angle", [0.5 * np.pi, np.pi], ids=["90", "180"])
@pytest.mark.parametrize("first", [1.0, 0.5])
def test_a_turned_cube_has_no_stress(angle: float, first: float) -> None:
    """In one load step, and without a product."""
    state = following([turn(0.0)], LoadStep("turn", supports=[turn(angle)]), first=first)
    c, s = np.cos(angle), np.sin(angle)
    arms = CUBE.points - (2.0, 0.0, 0.0)
    exact = arms @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T - arms + (0, 0, 0.1)
    assert np.abs(state.gather_displacement("block") - exact).max() < 1e-12
    assert np.abs(state.stress["block"].x.array).max() < 1e-12
    assert state.solution.products == 0
    assert state.fractions[0] == first
    (motion,) = state.rigid_motions()
    assert motion.displacement == pytest.approx([0, 0, 0.1], abs=1e-12)
    assert motion.rotation == pytest.approx([0, 0, angle], abs=1e-12)


def spun(angle: float) -> Support:
    """Nodes of the cube's underside on their way about a vertical axis, by functions of space."""
    c, s = np.cos(angle), np.sin(angle)
    way = (lambda x: (c - 1) * x[:, 0] - s * x[:, 1], lambda x: s * x[:, 0] + (c - 1) * x[:, 1], 0.0)
    return Support("block", "z0", way)


def test_a_loaded_cube_is_turned_by_90_degrees_in_one_load_step() -> None:
    """It starts turned, strained as before, and is as bent as one turned first and loaded then."""
    load, none = Traction("block", "z1", (0.05, 0.02, -0.1)), Traction("block", "z1", (0.0, 0.0, 0.0))
    ways = [[(0.0, load), (0.5 * np.pi, load)], [(0.5 * np.pi, none), (0.5 * np.pi, load)]]
    found = []
    for way in ways:
        scene = Scene({"block": Body(CUBE, RUBBER)}, [spun(0.0)], loads=[none])
        problem = ContactProblem(scene, MPI.COMM_SELF, partitions=cut(CUBE, 1), tolerance=1e-10)
        steps = [LoadStep(str(angle), supports=[spun(angle)], loads=[load]) for angle, load in way]
        found.append(solve_steps(problem, steps))
    assert isinstance(found[0][-1], DeformedState)
    assert found[0][-1].fractions == (1.0,)
    one, other = (states[-1].gather_displacement("block") for states in found)
    assert np.abs(one - other).max() < 1e-9


def test_a_body_does_not_start_inside_of_an_obstacle() -> None:
    """Moved into its floor as a whole it would have to be pressed out again: it is not moved."""
    floor = ContactPair(Surface("block", "z0"), RigidPlane((0, 0, -0.05), (0, 0, 1)))
    down = LoadStep("down", supports=[Support("block", "z1", (0.0, 0.0, -0.2))])
    scene = Scene({"block": Body(CUBE, RUBBER)}, [Support("block", "z1")], contacts=[floor])
    state = solve_steps(ContactProblem(scene, MPI.COMM_SELF), [down])[0]
    assert isinstance(state, DeformedState)
    assert state.contact.normal_force.sum() > 0.1
    assert len(state.solution.history) < 7
    assert state.fractions == (1.0,)


def test_on_the_way_it_moves_along_an_arc() -> None:
    """Halfway the support is where half of the angle is, in the rows that hold it, too."""
    pressed = [turn(1.0), Support("block", "z1", (None, None, -0.2))]
    free = [turn(0.0), Support("block", "z1", (None, None, 0.0))]
    state = following(free, LoadStep("turn and press", supports=pressed), first=0.5)
    assert state.fractions[:1] == (0.5,)
    halfway = state.load.between(state.load.removed(), 0.5)
    bottom = np.unique(CUBE.surfaces["z0"])
    arms = CUBE.points[bottom, :2] - (2.0, 0.0)
    c, s = np.cos(0.5), np.sin(0.5)
    exact = arms @ np.array([[c, s], [-s, c]]) - arms
    assert np.abs(halfway.prescribed[bottom, :2] - exact).max() < 1e-12
    gluing = halfway.torn.decomposition.gluing
    held = gluing.right_side(halfway.prescribed)
    assert np.abs(held).max() > 0.1
    assert np.abs(halfway.torn.right[: len(held)] - held).max() < 1e-12


def ends(angle: float) -> list[RigidSurface]:
    return [
        RigidSurface("block", surface, (0, 0, z), (0, 0, 0), (0, 0, way * angle / 2))
        for surface, z, way in (("z0", 0, -1), ("z1", 2, 1))
    ]


def test_a_twisted_rod_has_a_moment_about_its_axis_alone() -> None:
    scene = Scene({"block": Body(ROD, RUBBER)}, ends(0.0))
    problem = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-10)
    steps = [LoadStep(f"{angle:.2f}", supports=ends(angle)) for angle in (0.01, 0.5 * np.pi)]
    little, far = (state.reactions((0, 0, 1)) for state in solve_steps(problem, steps))
    for low, high in (little, far):
        assert low.moment + high.moment == pytest.approx(0.0, abs=1e-8)
        assert high.moment[:2] == pytest.approx(0.0, abs=1e-8)
        assert high.force[:2] == pytest.approx(0.0, abs=1e-8)
    stiffness = little[1].moment[2] / 0.01
    assert 0.0 < far[1].moment[2] < 1.1 * stiffness * 0.5 * np.pi
    assert far[1].force[2] < -1e-3, "twisted rubber wants to be longer: it pushes its ends apart"


@pytest.mark.parametrize("turns", [(0.0, 1.0), (-0.4, 0.4)])
def test_a_strip_is_bent_along_the_arc_of_its_end_in_one_load_step(turns: tuple[float, float]) -> None:
    """By pure bending M = E I φ / L: one of 0.9 of a turn and more came out as turned the other way round."""
    length, young = 40.0, 1e3
    strip = quadratic(rectangle((0.0, -0.5), (length, 0.5), (16, 1)))
    holds = [
        RigidSurface("strip", side, (x, 0.0), motion, 2.0 * np.pi * part)
        for side, x, motion, part in zip(("x0", "x1"), (0.0, length), ((0.0, 0.0), None), turns, strict=True)
    ]
    scene = Scene({"strip": Body(strip, StVenantKirchhoff(young, 0.0))}, holds)
    state = solve_scene(scene, MPI.COMM_SELF)
    angle = 2.0 * np.pi * (turns[1] - turns[0])
    moment = float(np.ravel(state.reactions()["strip x1"].moment)[-1])
    assert moment == pytest.approx(young / 12.0 * angle / length, rel=0.05)
    tips = [int(np.flatnonzero((strip.points == (x, 0.0)).all(axis=1))[0]) for x in (0.0, length)]
    start, end = (strip.points + state.gather_displacement("strip"))[tips]
    exact = 2.0 * length / angle * np.sin(0.5 * angle)
    assert np.linalg.norm(end - start) == pytest.approx(abs(exact), abs=0.02 * length)


def test_functions_of_time_have_their_values_on_the_way() -> None:
    """Half a step ends where the function is, not between its ends."""

    def moved(time: float) -> list[Support]:
        return [Support("block", "z0"), Support("block", "z1", (0.3 * np.sin(np.pi * time), 0.0, 0.0))]

    def pull(time: float) -> list[Traction]:
        return [Traction("block", "x1", (0.0, 0.02 * time**2, 0.0))]

    scene = Scene({"block": Body(CUBE, RUBBER)}, moved(0.0))
    seen: list[float] = []

    def watched(time: float) -> list[Support]:
        seen.append(time)
        return moved(time)

    steps = [LoadStep(f"{t}", loads=pull, supports=watched, time=t) for t in (1.0, 1.5)]
    problem = ContactProblem(
        scene, MPI.COMM_SELF, partitions=cut(CUBE, 1), steps=AutomaticSteps(first=0.5, smallest=0.5)
    )
    sequence = LoadSequence(problem)
    at_one = sequence.advance(steps[0])
    top = np.unique(CUBE.surfaces["z1"])
    assert isinstance(at_one, DeformedState)
    assert at_one.fractions == (0.5, 1.0)
    assert seen == [1.0, 0.5]
    # Half way the top was pushed by 0.3, and the part after it drew it back.
    first = at_one.load.between(at_one.load.removed(), 0.5)
    assert np.nanmax(first.prescribed) == pytest.approx(0.3)
    force = first.torn.load.reshape(-1, 3).sum(axis=0)
    assert force == pytest.approx([0.0, 0.02 * 0.25, 0.0])
    last = sequence.advance(steps[1])
    assert last.gather_displacement("block")[top, 0] == pytest.approx(-0.3, abs=1e-9)
    assert last.balance().loads.force == pytest.approx([0.0, 0.02 * 2.25, 0.0])


def test_functions_of_time_in_the_plane_and_with_linear_materials() -> None:
    plate = rectangle((0, 0), (1, 1), (3, 3))

    def supports(time: float) -> list[RigidSurface]:
        return [RigidSurface("plate", "y0", (0.0, 0.0), (0.0, 0.0), 0.1 * time)]

    steps = [LoadStep("t", supports=supports, time=2.0)]
    small = Scene({"plate": Body(plate, PlaneStrain(1.0, 0.3))}, supports(0.0))
    large = Scene({"plate": Body(plate, RUBBER)}, supports(0.0))
    (a,), (b,) = (solve_steps(ContactProblem(each, MPI.COMM_SELF), steps) for each in (small, large))
    corner = int(np.argmin(np.linalg.norm(plate.points - (1.0, 0.0), axis=1)))
    assert a.gather_displacement("plate")[corner] == pytest.approx([0.0, 0.2])
    assert b.gather_displacement("plate")[corner] == pytest.approx([np.cos(0.2) - 1, np.sin(0.2)])


def test_what_functions_of_time_must_not_do() -> None:
    with pytest.raises(InvalidInputError, match=r"LoadStep 'a' must have the time at its end.*: give time"):
        LoadStep("a", loads=lambda time: [])
    scene = Scene({"block": Body(CUBE, RUBBER)}, [turn(0.0)])
    sequence = LoadSequence(ContactProblem(scene, MPI.COMM_SELF))
    with pytest.raises(UserCodeError, match=r"the supports of LoadStep 'b' at time 2 failed with ZeroDiv"):
        sequence.advance(LoadStep("b", supports=lambda time: [turn(1 / 0)], time=2.0))


FILE = {
    "meshes": {"m": {"shape": "block", "lower": [0, 0, 0], "upper": [1, 1, 1], "counts": [2, 2, 2]}},
    "materials": {"rubber": {"model": "neo_hooke", "young_modulus": 1.0, "poisson_ratio": 0.3}},
    "bodies": {"block": {"mesh": "m", "material": "rubber"}},
}
TURN = {"kind": "rigid", "name": "turn", "body": "block", "surface": "z0", "at": [2.0, 0.0, 0.0]}


@pytest.mark.parametrize("value", [[0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, "0.75 * t"]], ids=["ramp", "formula"])
def test_scene_files_turn_surfaces(value: list[object]) -> None:
    steps = [{"name": "turn", "count": 2}]
    if value[-1] == 0:
        steps[0]["supports"] = {"turn": [0, 0, 0, 0, 0, 1.5]}
    file = read_scene_file({**FILE, "supports": [{**TURN, "value": value}], "steps": steps}, MPI.COMM_SELF)
    assert callable(file.steps[0].supports) == (value[-1] != 0)
    sequence = file.sequence()
    for step, angle in zip(file.steps, (0.75, 1.5), strict=True):
        state = sequence.advance(step)
        points = file.scene.bodies["block"].mesh.points
        c, s = np.cos(angle), np.sin(angle)
        exact = (points - (2.0, 0, 0)) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + (2.0, 0, 0)
        assert np.abs(points + state.gather_displacement("block") - exact).max() < 1e-6
    assert isinstance(state, DeformedState)
    halfway = state.load.between(state.load.removed(), 0.5)
    c, s = np.cos(0.75), np.sin(0.75)
    bottom = np.unique(file.scene.bodies["block"].mesh.surfaces["z0"])
    arms = points[bottom] - (2.0, 0, 0)
    exact = arms @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) - arms
    assert np.abs(halfway.prescribed[bottom] - exact).max() < 1e-12


def test_bodies_come_back_to_rest() -> None:
    """Residuals are relative to what there was: at rest there is nothing to be relative to."""
    scene = Scene({"block": Body(CUBE, RUBBER)}, [turn(0.0), Support("block", "z1")])
    problem = ContactProblem(scene, MPI.COMM_SELF, partitions=cut(CUBE, 1))
    away, back, still = (
        [Support("block", "z0"), Support("block", "z1", (x, 0.0, 0.0))] for x in (0.3, 0.0, 0.0)
    )
    steps = [LoadStep(name, supports=each) for name, each in (("a", away), ("b", back), ("c", still))]
    states = solve_steps(problem, steps)
    assert states[0].contact.points.count == 0
    assert all(np.abs(state.gather_displacement("block")).max() < 1e-8 for state in states[1:])
    assert len(states[1].solution.history) <= 6


SPHERE = {"obstacle": "sphere", "centre": [0.5, 0.5, 2.0], "radius": 1.0}


def pressed_file(**sphere: object) -> SceneFile:
    pair = {"slave": {"body": "block", "surface": "z1"}, "master": {**SPHERE, **sphere}}
    base = {"body": "block", "surface": "z0", "name": "base"}
    data = {**FILE, "supports": [base], "contacts": [pair], "steps": [{"name": "press", "duration": 2.0}]}
    return read_scene_file(data, MPI.COMM_SELF)


def test_obstacles_of_scene_files_move() -> None:
    """Half a turn about a point beside the ball and a way back press it as far as a plain way does."""
    down = [0.0, 0.0, "-0.05 * t", 0.0, 0.0, 0.0]
    around = [0.0, -2.0, "-0.05 * t", 0.0, 0.0, "0.5 * pi * t"]
    plain, turned = (pressed_file(motion=motion, about=[0.5, 1.5, 0.0]) for motion in (down, around))
    for file in (plain, turned):
        (pair,) = file.scene.contacts
        assert isinstance(pair.master, MovingObstacle)
    place = np.array([[0.5, 0.5, 0.9]])
    assert turned.scene.contacts[0].master.at(2.0).distance(place) == pytest.approx(0.0)
    state = plain.solve()
    assert state.contact.force[:, 2].sum() < -1e-3
    assert state.gather_displacement("block")[:, 2].min() == pytest.approx(-0.1, abs=1e-3)


def test_scene_files_say_how_loads_are_followed() -> None:
    careful = {"first": 0.25, "smallest": 0.01, "snaps": True, "max_steps": 12, "max_products": 99}
    data = {**FILE, "solver": {"newton": careful}, "supports": [{**TURN, "value": [0] * 6}]}
    data["loads"] = [{"kind": "traction", "body": "block", "surface": "z1", "value": [0, 0, -0.1]}]
    file = read_scene_file(data, MPI.COMM_SELF)
    assert file.problem.steps == AutomaticSteps(
        TangentNewton(max_steps=12, max_products=99), 0.25, 0.01, snaps=True
    )
    state = file.solve()
    assert isinstance(state, DeformedState)
    assert state.fractions[0] == 0.25
    assert (
        read_scene_file({**data, "solver": {"newton": {}}}, MPI.COMM_SELF).problem.steps == AutomaticSteps()
    )
    contradicting = {**data, "solver": {"newton": {"first": 0.001}}}
    with pytest.raises(
        SceneFileError, match=r"solver\.newton: .*smallest and first part .* got 0.00390625 and 0.001"
    ):
        _ = read_scene_file(contradicting, MPI.COMM_SELF).problem
    linear = {**data, "materials": {"rubber": {"young_modulus": 1.0, "poisson_ratio": 0.3}}}
    with pytest.raises(SceneFileError, match=r"newton is for nonlinear materials.*got first, .*: leave it"):
        _ = read_scene_file(linear, MPI.COMM_SELF).problem


def test_wrong_motions_and_solvers_of_scene_files() -> None:
    with pytest.raises(
        SceneFileError, match=r"motion of an obstacle must be 6 numbers .* prescribe all of it"
    ):
        _ = pressed_file(motion=[0, 0, "free", 0, 0, 0]).scene
    file = read_scene_file(
        {**FILE, "supports": [{"body": "block", "surface": "z0"}], "solver": {"method": "smalse"}},
        MPI.COMM_SELF,
    )
    with pytest.raises(SceneFileError, match=r"method and max_products are for linear materials.*leave them"):
        file.solve()
    scene = Scene({"block": Body(CUBE, RUBBER)}, [turn(0.0)])
    with pytest.raises(InvalidInputError, match=r"dual solvers are for linear materials.*: give steps"):
        solve_scene(scene, MPI.COMM_SELF, solver=Smalse())


# Pressure follows surfaces: its stiffness, a ring against its closed form, free rims, planes of symmetry.
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
    mesh = cut_out(0, "body", body, np.arange(body.mesh.n_cells), {})
    order = np.argsort(mesh.nodes)
    acted = np.isin(mesh.nodes[order], body.mesh.surfaces["x1"])
    points = body.mesh.points[mesh.nodes]
    pressure = forms.following(
        load, body.element, mesh.space, points[order], mesh.facets_of(body, "x1"), acted
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
    few: int = TangentNewton.few,
) -> DeformedState:
    mesh, polar = quarter(around, through)
    rollers = [Support("ring", "y0", (None, 0.0)), Support("ring", "y1", (0.0, None))]
    scene = Scene({"ring": Body(mesh, RUBBER)}, rollers, [Pressure("ring", "x0", pressure)])
    parts = {"ring": box_partition(replace(mesh, points=polar), pieces)}
    steps = AutomaticSteps(TangentNewton(few=few))
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
        residuals = [line.residuals.worst for line in state.solution.history]
        assert len(residuals) <= 5
        assert all(after < before**2 for before, after in itertools.pairwise(residuals[1:4]))
    for pieces in ((1, 1), (2, 3)):
        rough = inflated(12, 6, pieces, 0.15, few=1)
        assert len(rough.solution.history) <= 8  # 6 to 8 by rounding: linear systems are solved roughly
        *_, before, last = [line.residuals.worst for line in rough.solution.history]
        assert last < 1e-2 * before
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
    assert len(steps) >= 3
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


# What states of moved bodies report: balance beside bodies of small strain, slip of bodies that turn.
LINEAR, METAL = PlaneStrain(3.0, 0.3), J2Plasticity(3.0, 0.3, 0.1, isotropic_hardening=0.3)


@pytest.mark.parametrize(
    ("low", "high"), [(LINEAR, RUBBER), (RUBBER, LINEAR), (RUBBER, METAL)], ids=["under", "over", "metal"]
)
def test_forces_and_moments_balance_beside_bodies_of_small_strain(low: object, high: object) -> None:
    """These are in balance about undeformed places, rubber about deformed ones."""
    bodies = {
        "low": Body(rectangle((0.0, 0.0), (3.0, 1.0), (6, 2)), low),  # type: ignore[arg-type]
        "high": Body(rectangle((0.6, 1.0), (2.2, 1.8), (4, 2)), high),  # type: ignore[arg-type]
    }
    pair = ContactPair(Surface("high", "y0"), Surface("low", "y1"), Coulomb(0.3), "node")
    supports = [Support("low", "y0"), Support("high", "y1", (0.05, -0.15))]
    balance = solve_scene(Scene(bodies, supports, contacts=[pair]), MPI.COMM_SELF).balance()
    assert balance.imbalance < 1e-8
    across = np.abs(balance.gaps.moment) / balance.moment_scale
    assert across > 1e-3, "forces of a pair have a moment between deformed and undeformed places"


def test_slip_of_earlier_steps_turns_about_the_normal() -> None:
    """Two blocks slide on each other, and then turn together by 120 degrees."""
    low, high = block((-1, -1, 0), (1, 1, 0.5), (2, 2, 1)), block((-0.5, -0.5, 0.5), (0.5, 0.5, 1), (2, 2, 1))

    def supports(way: float, angle: float) -> list[RigidSurface]:
        c, s = np.cos(angle), np.sin(angle)
        moved = (way * c, way * s, -0.05)
        return [
            RigidSurface("low", "z0", (0, 0, 0), displacement=(0, 0, 0), rotation=(0, 0, angle)),
            RigidSurface("high", "z1", (0, 0, 1), displacement=moved, rotation=(0, 0, angle)),
        ]

    pair = ContactPair(Surface("high", "z0"), Surface("low", "z1"), discretisation="node")
    bodies = {"low": Body(low, RUBBER), "high": Body(high, RUBBER)}
    problem = ContactProblem(Scene(bodies, supports(0.0, 0.0), contacts=[pair]), MPI.COMM_SELF)
    angle = 2.0 * np.pi / 3.0
    steps = [LoadStep(str(turn), supports=supports(0.2, turn)) for turn in (0.0, angle)]
    slid, turned = (state.contact for state in solve_steps(problem, steps))
    before, after = (
        np.einsum("na,nad->nd", each.total_slip, each.points.tangents) for each in (slid, turned)
    )
    c, s = np.cos(angle), np.sin(angle)
    assert np.abs(turned.slip).max() < 1e-6
    assert np.linalg.norm(before, axis=1).min() > 0.1
    np.testing.assert_allclose(after, before @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T, atol=1e-6)


def test_friction_to_and_fro_within_a_load_step_is_the_sum_over_parts_with_histories_of_their_own() -> None:
    """As one step of the law it counts by where slip ends."""
    bodies = {
        "low": Body(rectangle((0.0, 0.0), (3.0, 1.0), (6, 2)), RUBBER),
        "high": Body(rectangle((1.0, 1.0), (2.0, 1.6), (2, 1)), RUBBER),
    }
    pair = ContactPair(Surface("high", "y0"), Surface("low", "y1"), Coulomb(0.1), "node")

    def supports(time: float) -> list[Support]:
        down, along = min(4.0 * time, 1.0), max(4.0 * time - 1.0, 0.0) / 3.0
        return [Support("low", "y0"), Support("high", "y1", (0.3 * along * (1.0 - along), -0.05 * down))]

    def followed(times: Sequence[float], **how: Any) -> list[DeformedState]:
        steps = AutomaticSteps(TangentNewton(tolerance=1e-10), **how)
        problem = ContactProblem(Scene(bodies, supports(0.0), contacts=[pair]), MPI.COMM_SELF, steps=steps)
        found = solve_steps(problem, [LoadStep(str(t), supports=supports, time=t) for t in times])
        return [state for state in found if isinstance(state, DeformedState)]

    (by_parts,) = followed([1.0], first=0.125, finer_history=True)
    assert 4 <= len(by_parts.fractions) <= 8
    singly = followed(by_parts.fractions)
    dissipated = sum(state.energies.friction for state in singly)
    assert dissipated > 1e-4
    assert by_parts.energies.friction == pytest.approx(dissipated, rel=1e-6)
    (at_once,) = followed([1.0], first=0.125)
    assert at_once.energies.friction < 0.5 * dissipated
    slip = np.linalg.norm(at_once.contact.slip, axis=1)
    assert at_once.energies.friction == pytest.approx(at_once.contact.slip_bound @ slip, rel=1e-6)

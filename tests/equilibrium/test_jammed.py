"""Bodies that jam, and that pass beside one another."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    FixedPoint,
    LoadSequence,
    LoadStep,
    Pressure,
    RigidPlane,
    RigidSurface,
    Scene,
    State,
    Support,
    Surface,
    TotalForce,
    solve_scene,
)
from fenics_contact._equilibrium import followed_loads
from fenics_contact._scene.pair_geometry import outline_of, unpaired
from fenics_contact.errors import InfeasibleError
from fenics_contact.gallery import block, disc, rectangle, rectangle_lattice
from fenics_contact.materials import IsotropicElasticity, NeoHooke, PlaneStrain
from fenics_contact.mesh import bisection_partition
from fenics_contact.qp import FaceNewton, Smalse
from fenics_contact.qp.solve import may_grip
from tests.equilibrium.passing import pressed as pressed_passing
from tests.equilibrium.round_bodies import pressed as pressed_round
from tests.equilibrium.wedges import FRICTION, driven, follow, wedge


def pressed(state: State) -> float:
    return float(state.contact.normal_force.sum())


@cache
def hardly_loaded() -> State:
    return follow(wedge(5.0), (50.0, 25.0, 1e-7))[-1]


SOLVERS = [FaceNewton(1e-8), FixedPoint(FaceNewton(1e-8)), FixedPoint(Smalse(1e-5))]


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_wedge_stays_where_it_was_driven_when_nothing_acts(solver: FaceNewton | FixedPoint) -> None:
    *_, nothing = follow(wedge(5.0), (50.0, 25.0, 0.0), solver=solver)
    hardly = hardly_loaded()

    assert pressed(nothing) > 50.0
    same = pytest.approx(hardly.contact.normal_force, abs=100.0 * solver.tolerance * pressed(hardly))
    assert nothing.contact.normal_force == same


def test_a_jammed_wedge_holds_a_pull_up_to_what_friction_bears() -> None:
    scene = wedge(5.0)
    pulled = follow(scene, (50.0, 0.0, -5.0, 0.0, -5.0))
    assert pressed(pulled[-1]) == pytest.approx(pressed(pulled[2]), rel=1e-6)

    with pytest.raises(InfeasibleError, match="every loaded body must be held"):
        follow(scene, (50.0, 0.0, -500.0))


def test_a_wedge_too_blunt_to_jam_is_left_without_any_force() -> None:
    *_, pushed, nothing = follow(wedge(25.0), (50.0, 20.0, 0.0))

    assert pressed(pushed) > 20.0
    assert not nothing.contact.normal_force.any()


def test_a_block_on_a_floor_is_let_go_at_the_cost_of_three_load_steps() -> None:
    mesh = rectangle((0.0, 0.0), (2.0, 1.0), (9, 5))
    pair = ContactPair(Surface("wedge", "y0"), RigidPlane((0.0, 0.0), (0.0, 1.0)), Coulomb(FRICTION))
    held = [Support("wedge", "x0")]
    scene = Scene({"wedge": Body(mesh, PlaneStrain(1000.0, 0.3))}, held, driven(1.0), [pair])

    pushed, less, nothing = follow(scene, (50.0, 20.0, 0.0))

    assert not nothing.contact.normal_force.any()
    assert nothing.solution.products <= 3 * max(pushed.solution.products, less.solution.products)


@pytest.mark.parametrize("pieces", [1, 2, 5])
def test_the_wedge_stays_however_it_is_cut(pieces: int) -> None:
    """At once from the full load: Newton's method lets go of the wedge in some partitions."""
    *_, nothing = follow(wedge(5.0), (50.0, 0.0), pieces)

    assert pressed(nothing) == pytest.approx(104.5, rel=1e-3)


# A taper in space that friction holds where it was driven: pulled, it answers alike in every partition.

#: Pressed, unloaded and pulled: for each partition the pull in contact, the normal forces and the motion.
PULLED = """
import numpy as np
from mpi4py import MPI
from fenics_contact import ContactProblem, LoadSequence
from fenics_contact.gallery import block
from fenics_contact.mesh import bisection_partition
from fenics_contact import Body, ContactPair, Coulomb, LoadStep, RigidPlane, Scene, Surface, TotalForce
from fenics_contact.materials import IsotropicElasticity

angle, comm = np.radians(5.0), MPI.COMM_WORLD
base = block((-1.0, 0.0, 1.0), (1.0, 1.0, 6.0), (2, 2, 4))
x, y, z = base.points.T
mesh = base.moved(np.column_stack([x * (2.0 + z * np.tan(angle)), y + 0.02 * x * z, z]))
c, s = np.cos(angle), np.sin(angle)
walls = {"x1": RigidPlane((2.0, 0.0, 0.0), (-c, 0.0, s)), "x0": RigidPlane((-2.0, 0.0, 0.0), (c, 0.0, s))}
pairs = [ContactPair(Surface("taper", side), wall, Coulomb(0.3)) for side, wall in walls.items()]
scene = Scene({"taper": Body(mesh, IsotropicElasticity(1000.0, 0.3))}, [], [], pairs)
for pieces in PIECES:
    cut = {"taper": bisection_partition(mesh, pieces)}
    steps = LoadSequence(ContactProblem(scene, comm, partitions=cut, tolerance=1e-8))
    for force in (50.0, 25.0, 0.0, -5.0):
        pull = TotalForce("taper", "z1", (0.0, 0.0, -force))
        state = steps.advance(LoadStep(f"{force:g}", loads=[pull]))
    moved = np.linalg.norm(state.gather_displacement("taper"))
    if comm.rank == 0:
        print(-state.contact.force[:, 2].sum(), state.contact.normal_force.sum(), moved)
"""


@pytest.mark.parametrize(
    ("ranks", "pieces"), [(1, (1, 2, 3)), (2, (2, 5)), pytest.param(4, (5,), marks=pytest.mark.claim)]
)
def test_a_jammed_taper_bears_a_pull_alike_on_all_ranks_and_partitions(
    ranks: int, pieces: tuple[int, ...], mpirun
) -> None:
    written = mpirun(PULLED.replace("PIECES", repr(pieces)), ranks).split()
    found = np.array(written, dtype=float).reshape(len(pieces), 3)
    np.testing.assert_allclose(found, np.tile([5.0, 107.329345, 1.8832162], (len(pieces), 1)), rtol=1e-6)


# Loads of exactly zero after others: what friction cannot hold without a load comes to rest at no cost.
MATERIAL = PlaneStrain(1000.0, 0.3)
#: Inclination of the sides of the wedge in degrees; friction holds it where it is more than its tangent.
SIDE = 5.0
UNLOADING_SOLVERS = {
    "face Newton": FaceNewton(1e-8),
    "fixed point of face Newton": FixedPoint(FaceNewton(1e-8)),
    "fixed point of SMALSE": FixedPoint(Smalse(1e-8)),
}
NAMES = [*list(UNLOADING_SOLVERS)[:2], pytest.param(list(UNLOADING_SOLVERS)[2], marks=pytest.mark.slow)]


@pytest.mark.parametrize("solver", NAMES)
def test_a_wedge_that_friction_cannot_hold_comes_out_without_any_force(solver: str) -> None:
    loose = wedge(SIDE, 0.5 * np.tan(np.radians(SIDE)))
    pressed, released = follow(loose, (50.0, 0.0), solver=UNLOADING_SOLVERS[solver])

    assert pressed.contact.normal_force.min() > 0.0
    assert not released.contact.normal_force.any()
    assert not released.gather_displacement("wedge").any()
    assert released.solution.products <= 1


def test_whether_friction_can_grip_is_asked_once_and_the_solution_says_what_came_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = []

    def counted(*given: object) -> bool:
        asked.append(given)
        return may_grip(*given)

    for module in (sys.modules["fenics_contact.qp.solve"], followed_loads):
        monkeypatch.setattr(module, "may_grip", counted)
    _, released = follow(wedge(SIDE, 0.5 * np.tan(np.radians(SIDE))), (50.0, 0.0))

    assert len(asked) == 1
    assert released.solution.released
    assert "released: no load, and no friction that grips" in str(released.solution.history[-1])


def test_a_step_without_another_start_begins_at_the_step_before() -> None:
    problem = ContactProblem(replace(wedge(SIDE), loads=driven(50.0)), MPI.COMM_SELF, tolerance=1e-8)
    pressed = problem.solve()
    scene = replace(problem.scene, loads=driven(0.0))

    again, anew = (problem.solve(scene, start=None, before=each) for each in (pressed, None))

    assert again.contact.normal_force.sum() > 0.5 * pressed.contact.normal_force.sum()
    assert not anew.contact.normal_force.any()


@pytest.mark.parametrize("solver", UNLOADING_SOLVERS)
def test_a_block_that_was_released_has_no_force_and_can_be_pushed_again(solver: str) -> None:
    floor, block = rectangle((0.0, 0.0), (3.0, 1.0), (6, 2)), rectangle((0.5, 1.0), (2.5, 2.0), (5, 3))
    pair = ContactPair(Surface("block", "y0"), Surface("floor", "y1"), Coulomb(0.3), "node")
    bodies = {"floor": Body(floor, MATERIAL), "block": Body(block, MATERIAL)}
    scene = Scene(bodies, [Support("floor", "y0")], [], [pair])
    steps = LoadSequence(ContactProblem(scene, MPI.COMM_SELF, solver=UNLOADING_SOLVERS[solver]))
    pushes = [[TotalForce("block", "y1", (0.2 * force, -force))] for force in (50.0, 0.0, 10.0)]

    pressed, released, again = (steps.advance(LoadStep("push", loads=push)) for push in pushes)

    assert not released.contact.normal_force.any()
    assert not released.gather_displacement("block").any()
    assert released.solution.products <= 1
    sums = [state.contact.normal_force.sum() for state in (pressed, again)]
    np.testing.assert_allclose(sums, [50.0, 10.0], rtol=1e-6)


@pytest.mark.parametrize("parts", [1, 2, 3, 5])
def test_a_body_that_a_support_lifts_off_leaves_the_one_below_at_rest(parts: int) -> None:
    """Nothing acts; jumps of bodies that touch are rounding of how far the support moves."""
    made = (
        ("lower", 0.0, 1.14, 2.72, (5, 7)),
        ("middle", 2.72, 2.2, 1.83, (3, 5)),
        ("upper", 4.55, 2.3, 2.4, (7, 3)),
    )
    bodies = {
        name: Body(rectangle((0.0, low), (width, low + height), cells), MATERIAL)
        for name, low, width, height, cells in made
    }
    supports = [
        Support("lower", "y0"), Support("middle", "x0", (None, 0.0)), Support("upper", "y1", (0.0, 0.0747)),
    ]  # fmt: skip
    contacts = [
        ContactPair(Surface("middle", "y0"), Surface("lower", "y1"), discretisation="node"),
        ContactPair(Surface("middle", "y1"), Surface("upper", "y0"), discretisation="node"),
    ]
    scene = Scene(bodies, supports, contacts=contacts)
    partitions = {name: bisection_partition(body.mesh, parts) for name, body in bodies.items()}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partitions)
    assert state.solution.products <= 1
    assert np.abs(state.contact.normal_force).max() == 0.0


# Nodes of a master that pass between those of a coarse slave are told of, with the depth.
def solved(caplog: pytest.LogCaptureFixture, scene: Scene) -> tuple[State, list[str]]:
    """Return the state of a scene and what is told of nodes of masters."""
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-8)
    words = [record.getMessage() for record in caplog.records]
    return state, [each for each in words if each.startswith("nodes of the master of ")]


def depth(state: State) -> float:
    """Return how far nodes of the lower body are above lines between closed ones of the upper body."""
    low, high = (state.scene.bodies[name].mesh for name in ("lower", "upper"))
    places = [
        low.points + state.gather_displacement("lower"),
        high.points + state.gather_displacement("upper"),
    ]
    top, bottom = (
        places[n][np.unique(mesh.surfaces[side])]
        for n, (mesh, side) in enumerate(((low, "y1"), (high, "y0")))
    )
    bottom = bottom[np.argsort(bottom[:, 0])]
    closed = state.contact_places[state.contact.normal_force > 0.0, 0]
    inside = top[np.abs(top[:, 0]) <= np.abs(closed).max()]
    return float((inside[:, 1] - np.interp(inside[:, 0], *bottom.T)).max())


def test_the_depth_between_coarse_nodes_is_told(caplog: pytest.LogCaptureFixture) -> None:
    scene, _ = pressed_round(2, 4, 0.5, discretisation="node")
    state, (words,) = solved(caplog, scene)
    told = float(words.split("by up to ")[1].split(",")[0])
    assert told == pytest.approx(depth(state), rel=0.3)
    assert ": refine the slave, or let the finer surface be the slave; discretisation='mortar' has " in words


@pytest.mark.parametrize(
    ("ratio", "discretisation"), [(0.5, "mortar"), (0.8, "node"), (1.0, "node"), (2.0, "node")]
)
def test_mortar_and_finer_slaves_are_not_told(
    ratio: float, discretisation: str, caplog: pytest.LogCaptureFixture
) -> None:
    assert solved(caplog, pressed_round(2, 4, ratio, discretisation=discretisation)[0])[1] == []


def test_masters_that_bulge_beside_a_punch_are_not_told(caplog: pytest.LogCaptureFixture) -> None:
    """Nodes of the plate just beyond the edge of the punch rise above its end."""
    half = np.array([0.0, 0.5, 0.5025, 0.505, 0.51, 0.52, 0.54, 0.6, 0.8, 1.2, 2.0])
    down = np.array([0.0, 0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 1.0])
    plate = rectangle_lattice([np.concatenate([-half[:0:-1], half]), down])
    meshes = {"punch": rectangle((-0.5, 1.0), (0.5, 2.0), (2, 2)), "plate": plate}
    scene = Scene(
        {name: Body(mesh, PlaneStrain(1e3, 0.3)) for name, mesh in meshes.items()},
        [Support("plate", "y0"), Support("punch", "y1", (0.0, -0.01))],
        contacts=[ContactPair(Surface("punch", "y0"), Surface("plate", "y1"), discretisation="node")],
    )
    state, words = solved(caplog, scene)
    assert state.contact.normal_force.min() > 0.0
    assert words == []


def test_finer_slaves_are_not_told_that_are_coarser_along_an_axis(caplog: pytest.LogCaptureFixture) -> None:
    meshes = {
        "upper": block((0.0, 0.0, 1.0), (1.0, 1.0, 2.0), (5, 3, 2), "tetrahedron"),
        "lower": block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (3, 4, 2), "tetrahedron"),
    }
    sides = {"x0": (0.0, None, None), "y0": (None, 0.0, None)}
    rollers = [Support(name, side, value) for name in meshes for side, value in sides.items()]
    scene = Scene(
        {name: Body(mesh, IsotropicElasticity(1e3, 0.3)) for name, mesh in meshes.items()},
        [*rollers, Support("lower", "z0", (None, None, 0.0))],
        [Pressure("upper", "z1", 1.0)],
        [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), discretisation="node")],
    )
    assert solved(caplog, scene)[1] == []


# Bodies that pass through each other for want of a pair or of a larger surface are told of.
TOUCHING = (
    "bodies 'upper' and 'lower' touch at 5 facets, without a pair or tie between them: add a ContactPair or"
)


def told(scene: Scene, caplog: pytest.LogCaptureFixture) -> list[str]:
    caplog.set_level(logging.WARNING, "fenics_contact")
    solve_scene(scene, MPI.COMM_SELF)
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (pressed_passing(0.0, 0.0), TOUCHING),
        (
            pressed_passing(0.01, 0.1),
            "'upper' and 'lower' pass into each other at 5 facets, without a pair or tie",
        ),
        (
            pressed_passing(-0.3, 0.0),
            "'upper' and 'lower' overlap unloaded at 13 facets, without a pair or tie",
        ),
        (
            pressed_passing(0.0, 0.1, pair="half"),
            "'upper' and 'lower' pass into each other at 2 facets, outside the surfaces",
        ),
    ],
    ids=["touching", "passing", "overlapping", "half a surface"],
)
def test_bodies_that_nothing_keeps_apart_are_told_of(
    scene: Scene, words: str, caplog: pytest.LogCaptureFixture
) -> None:
    """By the plan before, which knows where supports move them, and in a warning after.

    How far a pair of too small surfaces lets them is known after alone.
    """
    (found,) = told(scene, caplog)
    assert words in found
    assert "add a ContactPair" in found or "name more of their facets" in found
    if "outside" in found:
        assert scene.plan().unpaired == ()
        return
    as_supports = words.replace("pass into each other", "pass into each other as their supports move them")
    (planned,) = scene.plan().unpaired
    assert as_supports in planned
    assert f"\nno pair         {planned}" in str(scene.plan())


@pytest.mark.parametrize(
    "scene",
    [
        pressed_passing(0.0, 0.1, pair="whole"),
        pressed_passing(0.0, 0.1, pair="tie"),
        pressed_passing(0.2, 0.1),
    ],
    ids=["pair", "tie", "apart"],
)
def test_bodies_that_keep_apart_are_not_told_of(scene: Scene, caplog: pytest.LogCaptureFixture) -> None:
    assert told(scene, caplog) == []
    assert scene.plan().unpaired == ()
    assert "no pair" not in str(scene.plan())


def plates(into: float, *, cells: tuple[int, int] = (4, 5), along: float = 0.0) -> Scene:
    """A flat plate that reaches into a block, or begins ``along`` behind its start, with a pair between."""
    flat = rectangle((0.0, into - 0.05), (2.0, into), cells)
    bodies = {"flat": flat, "high": rectangle((along, 0.0), (along + 2.0, 1.0), (1, 1))}
    pair = ContactPair(Surface("high", "y0"), Surface("flat", "y1"), discretisation="node")
    return Scene({name: Body(mesh, PlaneStrain(1.0, 0.3)) for name, mesh in bodies.items()}, contacts=[pair])


def entered(scene: Scene, way: tuple[float, float]) -> int:
    """Return how many facets outside of the pair pass into the other body as the plate moves."""
    moved = {name: np.zeros_like(body.mesh.points) for name, body in scene.bodies.items()}
    moved["flat"] += way
    outlines = {name: outline_of(body.mesh) for name, body in scene.bodies.items()}
    return unpaired(scene, ("flat", "high"), outlines, moved, float(np.abs(way).max())).counts[2]


def test_sides_that_follow_a_surface_of_a_pair_as_deep_as_it_passes_are_not_told_of() -> None:
    """By nodes a master passes between nodes of a coarse slave, here by more than its flat cells are high."""
    assert entered(plates(0.0), (0.0, 0.03)) == 0
    assert entered(replace(plates(0.0), contacts=[]), (0.0, 0.03)) == 4 + 6 + 1
    beside = plates(0.02, along=2.1)
    assert entered(beside, (0.2, 0.0)) == 2  # of its five cells are as high as the block: a true passing
    assert plates(0.03).plan().unpaired == ()  # as a press fit, before any load


def test_bodies_flatter_than_their_facets_are_long_do_not_overlap_where_they_touch() -> None:
    assert plates(0.0, cells=(1, 1)).plan().unpaired == ()


ON_RANKS = """
    import logging, sys
    from mpi4py import MPI
    from fenics_contact import solve_scene
    from tests.equilibrium.passing import pressed

    logging.basicConfig(stream=sys.stdout, format="%(message)s", level=logging.WARNING)
    solve_scene(pressed(0.0, 0.0), MPI.COMM_WORLD)
"""


def test_ranks_share_the_facets_and_one_of_them_tells(mpirun: Callable[..., str]) -> None:
    (found,) = mpirun(ON_RANKS, 2).splitlines()
    assert found.startswith(TOUCHING)


def test_a_rigid_surface_that_turns_far_moves_rubber_on_an_arc_and_not_along_its_tangent() -> None:
    """A whole turn brings it back; linearised it would pass through all that is near."""
    meshes = {"wheel": rectangle((-1, -1), (1, 1), (2, 2)), "near": rectangle((3, -1), (4, 1), (1, 2))}
    turned = RigidSurface("wheel", "x1", at=(0.0, 0.0), displacement=(0.0, 0.0), rotation=2.0 * np.pi)
    bodies = {name: Body(mesh, NeoHooke(1.0, 0.3)) for name, mesh in meshes.items()}
    assert Scene(bodies, [turned, Support("near", "x1")]).plan().unpaired == ()


# A round body on facets so large that their means are open although its lowest node is not.
def about_open_means(caplog: pytest.LogCaptureFixture, scene: Scene) -> tuple[State, list[str]]:
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-8)
    words = [record.getMessage() for record in caplog.records]
    return state, [each for each in words if each.startswith("nothing presses on ")]


@pytest.mark.parametrize(("push", "discretisation"), [(-0.01, "mortar"), (0.01, "mortar"), (-0.01, "node")])
def test_round_bodies_on_facets_that_are_too_large_are_reported(
    push: float, discretisation: str, caplog: pytest.LogCaptureFixture
) -> None:
    material = PlaneStrain(1000.0, 0.3)
    bodies = {
        "disc": Body(disc(1.0, 5), material),
        "bed": Body(rectangle((-2, -2), (2, -1), (9, 4)), material),
    }
    pair = ContactPair(Surface("disc", "y0"), Surface("bed", "y1"), discretisation=discretisation)
    supports = [Support("bed", "y0"), Support("disc", "y1", (0.0, push))]
    state, found = about_open_means(caplog, Scene(bodies, supports, contacts=[pair]))
    assert bool(found) == (push < 0 and discretisation == "mortar")
    assert (state.contact.normal_force.max() > 0.0) == (discretisation == "node")
    if found:
        assert "nodes lie up to 0.01 inside the master, where surfaces move by 0.0" in found[0]


def test_a_pin_that_moves_in_a_wider_hole_is_not_reported(caplog: pytest.LogCaptureFixture) -> None:
    """The facets of the hole come nearer than the hole itself; gaps are those of the true circles."""
    material = PlaneStrain(1000.0, 0.3)
    bodies = {"pin": Body(disc(0.988, 3), material), "ring": Body(disc(2.0, 2, hole=1.0), material)}
    pair = ContactPair(Surface("pin", "outer"), Surface("ring", "inner"), discretisation="mortar")
    supports = [Support("ring", "outer"), Support("pin", "y1", (0.0, -0.01))]
    state, found = about_open_means(caplog, Scene(bodies, supports, contacts=[pair]))
    assert state.contact.normal_force.max() == 0.0
    assert found == []

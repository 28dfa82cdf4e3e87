"""Springs between surfaces stretch, hold and push as formulas say."""

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
    PointForce,
    Preload,
    RigidSphere,
    RigidTool,
    Scene,
    Section,
    Spring,
    Status,
    Support,
    Surface,
    ToolMotion,
    TotalForce,
    Traction,
    read_scene_file,
    solve_scene,
    solve_steps,
    write_result,
)
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke
from fenics_contact.mesh import quadratic
from fenics_contact.output import StepTable, read_result

YOUNG, STEEL = 2.1e3, IsotropicElasticity(2.1e3, 0.0)
FIRST, SECOND = Surface("a", "x1"), Surface("b", "x0")
#: Of b: it moves along x alone.
GUIDE = [Support("b", "y0", (None, 0.0, None)), Support("b", "z0", (None, None, 0.0))]
#: Lengthening of both blocks, 3 long and 4 across, under 100.
BOTH = 2.0 * 100.0 * 3.0 / (YOUNG * 4.0)


def pair_of_blocks(
    spring, load: float = 25.0, material=STEEL, order: int = 1, cell: str = "hexahedron"
) -> Scene:
    """Two blocks in a row along x, the first held at its far end, the second drawn away."""
    a, b = block((0, 0, 0), (3, 2, 2), (3, 2, 3), cell), block((5, 0, 0), (8, 2, 2), (2, 3, 1), cell)
    bodies = {
        name: Body(mesh if order == 1 else quadratic(mesh), material) for name, mesh in (("a", a), ("b", b))
    }
    held = [Support("a", "x0"), Support("b", "y1", (None, 0.0, None)), *GUIDE]
    return Scene(bodies, held, [Traction("b", "x1", (load, 0.0, 0.0))], springs=[spring])


def end_of(state) -> float:
    return float(state.gather_displacement("b")[:, 0].max())


@pytest.mark.parametrize(("cell", "order"), [("hexahedron", 1), ("tetrahedron", 2)])
def test_blocks_and_their_spring_are_compliances_in_series(cell: str, order: int) -> None:
    scene = pair_of_blocks(Spring(FIRST, SECOND, 500.0), order=order, cell=cell)
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
    assert end_of(state) == pytest.approx(100.0 / 500.0 + BOTH, rel=1e-8)
    found = state.springs()["a x1 to b x0"]
    assert found.tension == pytest.approx([100.0])
    assert found.force == pytest.approx([100.0, 0.0, 0.0], abs=1e-8)
    assert found.elongation == pytest.approx([0.2])
    assert state.balance().imbalance < 1e-10
    assert state.energies.surface == pytest.approx(0.5 * 100.0 * 0.2)
    assert state.energies.primal == pytest.approx(state.energies.dual)
    assert "(1, 0, 0)" in str(state.springs())


@pytest.mark.parametrize("stiffness", [1e-3, 1e2, 1e9])
def test_springs_of_any_stiffness_are_exact_and_cost_little(stiffness: float) -> None:
    state = solve_scene(pair_of_blocks(Spring(FIRST, SECOND, stiffness)), MPI.COMM_SELF, tolerance=1e-10)
    assert end_of(state) == pytest.approx(100.0 / stiffness + BOTH, rel=1e-9)
    assert state.solution.products < 15


def test_tension_is_there_before_anything_moves() -> None:
    scene = pair_of_blocks(Spring(FIRST, SECOND, 500.0, tension=70.0, name="rod"), load=-25.0)
    rod = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10).springs()["rod"]
    assert rod.tension == pytest.approx([-100.0])
    assert rod.elongation == pytest.approx([-170.0 / 500.0])


def test_springs_side_by_side_and_to_the_ground_share_the_force() -> None:
    both = [Spring(FIRST, SECOND, 500.0, name="rod")] * 2
    scene = pair_of_blocks(both[0])
    scene = replace(scene, springs=[*both, Spring(Surface("b", "x1"), (9.0, 1.0, 1.0), 300.0, name="stop")])
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
    forces = {name: float(each.tension[0]) for name, each in state.springs().items()}
    row = 1.0 / (1.0 / 1000.0 + BOTH / 100.0)
    assert forces["rod 1"] == pytest.approx(0.5 * 100.0 * row / (row + 300.0), rel=1e-8)
    assert forces["rod 2"] == pytest.approx(forces["rod 1"])
    assert forces["stop"] == pytest.approx(-100.0 * 300.0 / (row + 300.0), rel=1e-8)
    # What pulls at the ground is a force from outside.
    assert state.balance().beds.force[0] == pytest.approx(forces["stop"], rel=1e-8)


def test_components_that_supports_hold_change_reactions_alone() -> None:
    pushed = [Support("b", "y0", (None, 0.01, None)), Support("b", "y1", (None, 0.01, None))]
    scene = pair_of_blocks(Spring(Surface("a", "x0"), Surface("b", "y0"), (50.0, 20.0, 7.0)))
    scene = replace(scene, supports=[*scene.supports[:1], *pushed, GUIDE[1]])
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
    found = state.springs()["a x0 to b y0"]
    assert found.elongation[1] == pytest.approx(0.01)
    assert found.force[:2] == pytest.approx([100.0, 0.2], rel=1e-8)
    assert state.reactions()[0].force[:2] == pytest.approx([-100.0, -0.2], rel=1e-8)
    assert state.balance().imbalance < 1e-10


def rubbing(tension: float = 0.0) -> Scene:
    """A block on another one, pushed along it against a spring to the first one's side."""
    a, b = block((0, 0, 0), (4, 2, 2), (4, 2, 3)), block((0.3, 0, 2), (2.7, 2, 4), (3, 3, 2))
    contact = ContactPair(Surface("b", "z0"), Surface("a", "z1"), Coulomb(0.3))
    spring = Spring(Surface("b", "x1"), Surface("a", "x1"), (800.0, 0.0, 0.0), name="s")
    if tension:
        spring = Spring(Surface("b", "x1"), (6.0, 1.0, 3.0), 800.0, tension, name="s")
    loads = [Traction("b", "z1", (0.0, 0.0, -20.0)), Traction("b", "x0", (12.0, 0.0, 0.0))]
    bodies = {"a": Body(a, STEEL), "b": Body(b, STEEL)}
    return Scene(bodies, [Support("a", "z0")], loads, [contact], springs=[spring])


def test_a_spring_takes_what_friction_leaves() -> None:
    state = solve_scene(rubbing(), MPI.COMM_SELF, tolerance=1e-8)
    pressed, pushed = 20.0 * 2.4 * 2.0, 12.0 * 4.0
    assert state.contact.count(Status.SLIP) == state.contact.points.count > 0
    assert float(state.springs()["s"].tension[0]) == pytest.approx(-(pushed - 0.3 * pressed), rel=1e-6)
    assert state.balance().imbalance < 1e-10


def test_springs_side_by_side_do_not_contradict_each_other() -> None:
    halves = [Spring(FIRST, SECOND, k, tension, name="rod") for k, tension in ((300.0, 50.0), (100.0, 0.0))]
    for load, stiffest in ((25.0, 1.0), (25.0, 1e6)):
        springs = [replace(each, stiffness=each.stiffness * stiffest) for each in halves]
        scene = replace(pair_of_blocks(halves[0], load), springs=springs)
        rods = solve_scene(scene, MPI.COMM_SELF).springs()
        assert rods["rod 1"].tension + rods["rod 2"].tension == pytest.approx([100.0], rel=1e-6)
        assert rods["rod 1"].elongation == pytest.approx([50.0 / (400.0 * stiffest)], rel=1e-5)


def test_bounds_of_errors_hold_beside_springs() -> None:
    from fenics_contact._accuracy.certificate import certify

    scene = rubbing(tension=5.0)
    exact, rough = (solve_scene(scene, MPI.COMM_SELF, tolerance=t) for t in (1e-11, 1e-3))
    wrong, error = rough.torn_displacement - exact.torn_displacement, 0.0
    for part, where in zip(rough.torn.subdomains, rough.torn.decomposition.parts, strict=True):
        error += wrong[where] @ (part.stiffness @ wrong[where])
    bound = certify(rough.dual, rough.dual_solution).bound
    assert 0.0 < np.sqrt(error) <= 1.001 * bound
    assert bound < 0.01 * rough.energies.norm


def test_load_steps_and_preloads_beside_springs_are_those_of_the_joint_diagram() -> None:
    spring = Spring(FIRST, SECOND, 500.0, name="rod")
    scene = replace(
        pair_of_blocks(spring, load=0.0),
        preloads=[Preload("b", Section((6.5, 1, 1), (1, 0, 0)), shortening=0.05)],
    )
    scene = replace(scene, supports=[*scene.supports, Support("b", "x1", (0.0, None, None))], loads=[])
    steps = [LoadStep("drawn"), LoadStep("pulled", [Traction("a", "x1", (10.0, 0.0, 0.0))])]
    drawn, pulled = solve_steps(ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-10), steps)
    row = 1.0 / (1.0 / 500.0 + BOTH / 100.0)
    assert float(drawn.springs()["rod"].tension[0]) == pytest.approx(0.05 * row, rel=1e-8)
    forced = replace(scene, preloads=[replace(scene.preloads[0], force=40.0, shortening=None)])
    state = solve_scene(forced, MPI.COMM_SELF, tolerance=1e-10)
    assert state.springs()["rod"].tension == pytest.approx([40.0], rel=1e-8)
    assert state.preloads()["b"].shortening == pytest.approx(40.0 / row, rel=1e-8)
    assert state.energies.primal == pytest.approx(state.energies.dual, rel=1e-7)
    moved = 40.0 * BOTH / 200.0
    assert float(pulled.springs()["rod"].tension[0]) == pytest.approx((0.05 - moved) * row, rel=1e-8)


def test_springs_along_the_axes_follow_large_deformations() -> None:
    rubber = NeoHooke(50.0, 0.3)
    scene = pair_of_blocks(Spring(FIRST, SECOND, (20.0, 0.0, 0.0), name="s"), 3.0, rubber)
    state = solve_scene(scene, MPI.COMM_SELF)
    assert state.springs()["s"].elongation == pytest.approx([0.6], rel=1e-6)
    moved = {name: state.gather_displacement(name)[:, 0] for name in ("a", "b")}
    ends = [moved[end.body][scene.bodies[end.body].mesh.surfaces[end.name]].mean() for end in (FIRST, SECOND)]
    assert ends[1] - ends[0] == pytest.approx(0.6, rel=0.05), "means over nodes"
    assert state.balance().imbalance < 1e-7
    assert state.energies.surface == pytest.approx(0.5 * 12.0 * 0.6, rel=1e-6)


def test_rings_have_springs_along_the_axis_per_revolution() -> None:
    rings = {
        name: Body(
            rectangle((1.0, z), (2.0, z + 3.0), (2, 3)), IsotropicElasticity(YOUNG, 0.0), axisymmetric=True
        )
        for name, z in (("a", 0.0), ("b", 4.0))
    }
    loads = [Traction("b", "y1", (0.0, 2.0))]
    force = 2.0 * np.pi * 3.0
    for stiffness in (90.0, (0.0, 90.0)):
        spring = Spring(Surface("a", "y1"), Surface("b", "y0"), stiffness, name="s")
        scene = Scene(rings, [Support("a", "y0", (None, 0.0))], loads, springs=[spring])
        state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
        assert state.springs()["s"].tension == pytest.approx([force])
        top = float(state.gather_displacement("b")[:, 1].max())
        assert top == pytest.approx(force / 90.0 + 2.0 * 2.0 * 3.0 / YOUNG, rel=1e-8)


def test_a_tool_presses_through_a_spring() -> None:
    ball = RigidTool("ball", RigidSphere((1.0, 1.0, 3.0), 1.0), (1.0, 1.0, 3.0))
    bodies = {
        "base": Body(block((0, 0, 0), (2, 2, 2), (3, 3, 2)), STEEL),
        "lid": Body(block((0, 0, 5), (2, 2, 6), (2, 2, 1)), STEEL),
    }
    lid = [Support("lid", "x0", (0.0, None, None)), Support("lid", "y0", (None, 0.0, None))]
    lid += [Support("lid", "z1", (None, None, -0.4))]
    supports = [Support("base", "z0"), *lid, ToolMotion("ball", (0.0, 0.0, None), (0.0, 0.0, 0.0))]
    pair = ContactPair(Surface("base", "z1"), ball)
    spring = Spring(Surface("lid", "z0"), Surface("ball", "tool"), 50.0, name="s")
    state = solve_scene(Scene(bodies, supports, [], [pair], springs=[spring]), MPI.COMM_SELF, tolerance=1e-9)
    tool, pushed = state.tools()["ball"], float(state.springs()["s"].tension[0])
    assert tool.force[2] == pytest.approx(-pushed, rel=1e-6)
    # The lid gives way by its own compression only.
    way = 0.4 + float(tool.displacement[2])
    assert -pushed == pytest.approx(50.0 * (way + pushed / (YOUNG * 4.0)), rel=1e-6)


RANKS = """
    from mpi4py import MPI
    from fenics_contact import Body, ContactPair, Coulomb, Scene, Spring, Support, Surface, Traction
    from fenics_contact import box_partition, solve_scene
    from fenics_contact.gallery import block
    from fenics_contact.materials import IsotropicElasticity

    a, b = block((0, 0, 0), (4, 2, 2), (4, 2, 3)), block((0.3, 0, 2), (2.7, 2, 4), (3, 3, 2))
    bodies = {name: Body(mesh, IsotropicElasticity(2.1e3, 0.3)) for name, mesh in (("a", a), ("b", b))}
    contact = ContactPair(Surface("b", "z0"), Surface("a", "z1"), Coulomb(0.3))
    springs = [
        Spring(Surface("b", "x1"), Surface("a", "x1"), (800.0, 300.0, 0.0)),
        Spring(Surface("b", "x1"), (6.0, 1.0, 3.0), 200.0, 5.0),
    ]
    loads = [Traction("b", "z1", (0.0, 1.0, -20.0)), Traction("b", "x0", (12.0, 0.0, 0.0))]
    scene = Scene(bodies, [Support("a", "z0")], loads, [contact], springs=springs)

    def found(comm, parts=None):
        state = solve_scene(scene, comm, partitions=parts, tolerance=1e-11)
        forces = [each.force.tolist() for each in state.springs().values()]
        return [*forces[0], *forces[1], float(state.gather_displacement("b").max())]

    parts = {name: box_partition(body.mesh, (2, 1, 2)) for name, body in bodies.items()}
    torn, whole = found(MPI.COMM_WORLD, parts), found(MPI.COMM_SELF)
    if MPI.COMM_WORLD.rank == 0:
        print(repr((torn, whole)))
"""


@pytest.mark.parametrize("ranks", [2, 4])
def test_ranks_and_subdomains_find_the_same_forces(ranks, mpirun) -> None:
    every = [eval(mpirun(RANKS, count)) for count in (1, ranks)]
    assert np.abs(every[0][1][:2]).min() > 0.5
    for torn, whole in every:
        np.testing.assert_allclose(torn, whole, rtol=1e-7, atol=1e-8)
        np.testing.assert_allclose(whole, every[0][1], rtol=1e-12, atol=1e-12)


def test_a_body_that_a_spring_lets_turn_is_refused() -> None:
    scene = pair_of_blocks(Spring(FIRST, SECOND, (500.0, 20.0, 30.0)))
    scene = replace(scene, supports=scene.supports[:1], loads=[TotalForce("b", "x1", (0.0, 0.0, 1.0))])
    with pytest.raises(InfeasibleError, match="body 'b' can move away"):
        solve_scene(scene, MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: Spring(FIRST, SECOND, 0.0), "must be positive, or numbers of at least zero along the axes"),
        (lambda: Spring(FIRST, SECOND, (1.0, -1.0, 0.0)), "must be positive, or numbers of at least zero"),
        (
            lambda: Spring(FIRST, SECOND, (1.0, 1.0, 0.0), 3.0),
            "must be finite, zero with stiffness along axes",
        ),
        (lambda: Spring(FIRST, FIRST, 1.0), "must have two different ends"),
        (
            lambda: pair_of_blocks(Spring(FIRST, SECOND, (1.0, 1.0))),
            "stiffness .* must have 3 finite numbers",
        ),
        (lambda: pair_of_blocks(Spring(FIRST, (1.0, 1.0), 1.0)), "second .* must have 3 finite numbers"),
        (lambda: pair_of_blocks(Spring(FIRST, (3.0, 1.0, 1.0), 1.0)), "needs ends with different centroids"),
        (
            lambda: pair_of_blocks(Spring(FIRST, Surface("b", "rim"), 1.0)),
            "Spring.second names surface 'rim'",
        ),
        (
            lambda: pair_of_blocks(Spring(FIRST, SECOND, 1.0), material=NeoHooke(1.0, 0.3)),
            "needs small displ",
        ),
        (lambda: _ring(Spring(Surface("a", "y1"), (0.0, 5.0), (1.0, 1.0))), "must act along the axis"),
        (lambda: _ring(Spring(Surface("a", "y1"), (1.0, 5.0), 1.0)), "must act along the axis"),
    ],
)
def test_springs_that_do_not_suit_their_bodies_are_refused(made, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        made()


def _ring(spring: Spring) -> Scene:
    body = Body(rectangle((1.0, 0.0), (2.0, 3.0), (1, 1)), STEEL, axisymmetric=True)
    return Scene({"a": body}, [Support("a", "y0")], springs=[spring])


def _file(**spring) -> dict:
    shape = {"shape": "block", "counts": [1, 1, 1]}
    return {
        "meshes": {
            "a": {**shape, "lower": [0, 0, 0], "upper": [1, 1, 1]},
            "b": {**shape, "lower": [2, 0, 0], "upper": [3, 1, 1]},
        },
        "materials": {"s": {"young_modulus": 2.1e5, "poisson_ratio": 0.3}},
        "bodies": {"a": {"mesh": "a", "material": "s"}, "b": {"mesh": "b", "material": "s"}},
        "supports": [
            {"body": "a", "surface": "x0", "value": [0, 0, 0]},
            {"body": "b", "surface": "x1", "value": [0.1, 0, 0]},
        ],
        "springs": [{"first": {"body": "a", "surface": "x1"}, "name": "rod", **spring}],
    }


def test_scene_files_results_and_tables_have_springs(tmp_path) -> None:
    second = {"body": "b", "surface": "x0"}
    file = read_scene_file(_file(second=second, stiffness=40.0, tension=2.0), MPI.COMM_SELF)
    assert "spring (1 spring acts between surfaces)" in str(file.scene.plan())
    assert "rod, 40.0 along its line, tension 2" in str(file.scene)
    state = solve_scene(file.scene, MPI.COMM_SELF, tolerance=1e-10)
    rod = state.springs()["rod"]
    write_result(state, tmp_path)
    found = read_result(tmp_path)["forces"]["springs"][0]
    assert found["tension"] == pytest.approx([2.0 + 40.0 * rod.elongation[0]])
    assert found["name"] == "rod"
    text = StepTable(tmp_path / "steps.csv", MPI.COMM_SELF).add(state).read_text()
    assert "spring rod tension,spring rod elongation" in text
    fixed = read_scene_file(_file(point=[5, 0.5, 0.5], stiffness=[1, 0, 0]), MPI.COMM_SELF)
    assert fixed.scene.springs[0] == Spring(FIRST, (5.0, 0.5, 0.5), (1.0, 0.0, 0.0), name="rod")
    with pytest.raises(InvalidInputError, match="needs a second surface or a fixed point"):
        _ = read_scene_file(_file(stiffness=1.0), MPI.COMM_SELF).scene
    with pytest.raises(InvalidInputError, match="springs of the scene are 'rod', got 'bar'"):
        state.springs()["bar"]


def corners_alike(stiffness, held=()) -> Scene:
    """A block drawn at one corner of its end, whose displacement along x is that of the other corner."""
    mesh = block((0, 0, 0), (3, 1, 1), (3, 1, 1))
    near, far = (int(np.flatnonzero((mesh.points == (3, y, 1)).all(axis=1))[0]) for y in (0, 1))
    body = Body(replace(mesh, node_sets={"near": [near], "far": [far]}), STEEL)
    springs = [Spring(Surface("a", "near"), Surface("a", "far"), stiffness)] if stiffness else []
    supports = [Support("a", "x0"), *held]
    return Scene({"a": body}, supports, [PointForce("a", "far", (5.0, 4.0, 1.0))], springs=springs)


def test_infinite_stiffness_makes_two_nodes_move_alike_and_nothing_else() -> None:
    scene = corners_alike((np.inf, 0.0, 0.0))
    state = solve_scene(scene, MPI.COMM_WORLD, tolerance=1e-12)
    mesh, u = scene.bodies["a"].mesh, state.gather_displacement("a")
    near, far = (mesh.node_sets[name][0] for name in ("near", "far"))
    assert u[near, 0] == pytest.approx(u[far, 0], rel=1e-9)
    assert abs(u[near, 1] - u[far, 1]) > 1e-3 * abs(u[far, 0])
    # Held at that displacement both nodes together feel the load, and all others have the same equilibrium.
    given = [Support("a", name, (float(u[near, 0]), None, None)) for name in ("near", "far")]
    again = solve_scene(corners_alike(None, given), MPI.COMM_WORLD, tolerance=1e-12)
    np.testing.assert_allclose(again.gather_displacement("a"), u, atol=1e-9 * np.abs(u).max())
    needed = sum(again.reactions()[number].force[0] for number in (1, 2))
    assert abs(needed) <= 1e-8 * 5.0
    (link,) = state.springs().values()
    assert link.elongation == pytest.approx(0.0, abs=1e-12)
    assert link.tension[0] < -1.0


def test_rigid_spring_is_the_limit_of_stiff_ones() -> None:
    ends = [
        solve_scene(corners_alike((k, 0.0, 0.0)), MPI.COMM_WORLD, tolerance=1e-12).gather_displacement("a")
        for k in (1e9, np.inf)
    ]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-5 * np.abs(ends[1]).max())


def test_rigid_spring_has_no_tension_of_its_own() -> None:
    with pytest.raises(InvalidInputError, match="or an infinite one"):
        Spring(FIRST, SECOND, np.inf, tension=1.0)

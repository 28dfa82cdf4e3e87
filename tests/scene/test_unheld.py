"""Bodies that contact does not hold, that nothing resists, or that nothing presses."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI

from benchmarks.graph_partition import graph_partition
from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    FixedPoint,
    Pressure,
    RigidPlane,
    Scene,
    State,
    Support,
    Surface,
    Tie,
    TotalForce,
    Traction,
    Tresca,
    solve_scene,
)
from fenics_contact._equilibrium.rolling import rolling
from fenics_contact._fem.mechanics import HyperelasticMechanics
from fenics_contact._large_deformations.newton import NotHeldError
from fenics_contact._pairing.search import find_contact_points, without_rounding
from fenics_contact.errors import ConvergenceError, InfeasibleError, LoadStepError
from fenics_contact.feti import DualSystem, build_torn_system, decompose
from fenics_contact.feti.inverse import LocalKind
from fenics_contact.gallery import block, half_disc, rectangle
from fenics_contact.materials import IsotropicElasticity, J2Plasticity, Material, NeoHooke, PlaneStrain
from fenics_contact.mesh import refined
from fenics_contact.mesh.quality import node_volumes
from fenics_contact.qp import FaceNewton, Smalse
from tests.equilibrium.press_fits import Disc, press_fit
from tests.equilibrium.stacks import RUBBER, TURN, cut, turned_stack
from tests.scenes import Friction, block_on_plane, two_blocks


def cube_on_floor(n: int) -> Scene:
    """A cube on a floor without friction, held along x and pressed: nothing holds or loads it along y."""
    cube = Body(block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (n, n, n)), RUBBER)
    supports = [Support("cube", "x0", (0.0, None, None)), Support("cube", "z1", (None, None, -1e-3))]
    floor = RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    return Scene({"cube": cube}, supports, contacts=[ContactPair(Surface("cube", "z0"), floor)])


def left_of(state: State, body: str, motion: np.ndarray) -> float:
    """Return how far a body went along a motion of its volume, relative to how far it went at all."""
    moved, mesh = state.gather_displacement(body), state.scene.bodies[body].mesh
    share = np.sqrt(node_volumes(mesh.points, mesh.cells))[:, None]
    moved, motion = share * moved, share * motion
    return float(abs((moved * motion).sum() / np.linalg.norm(motion)) / np.linalg.norm(moved))


@pytest.mark.parametrize("n", [1, 2, 3, 5, 6, 7, 9])
def test_a_pressed_cube_stays_where_nothing_holds_it(n: int) -> None:
    state = solve_scene(cube_on_floor(n), MPI.COMM_SELF)

    assert state.solution.products <= 25
    np.testing.assert_allclose(state.contact.normal_force.sum(), 100.0 * 1e-3, rtol=1e-3)  # uniaxial stress
    assert [str(motion) for motion in state.unheld] == ["'cube': translation (0, 1, 0)"]
    assert left_of(state, "cube", np.array([[0.0, 1.0, 0.0]])) < 1e-10


@pytest.mark.parametrize("solver", [FaceNewton(1e-6), Smalse(1e-6)])
@pytest.mark.parametrize("parts", [1, 4])
def test_partition_and_solver_do_not_move_it(parts: int, solver: FaceNewton | Smalse) -> None:
    scene = cube_on_floor(5)
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene, parts), solver=solver)

    exact = 1e-3 * np.array([0.3, 0.3, -1.0]) * (scene.bodies["cube"].mesh.points - [0.0, 0.5, 0.0])
    np.testing.assert_allclose(state.gather_displacement("cube"), exact, atol=1e-8)


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_where_its_mesh_is_fine_does_not_move_it(cell: str) -> None:
    """Means over the nodes would: most of them are near one side."""
    scene = cube_on_floor(3)
    mesh = block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (3, 3, 3), cell)
    near = mesh.points[mesh.cells].mean(axis=1)[:, 1] > 0.6
    fine = refined(mesh, near).mesh
    assert fine.points[:, 1].mean() > 0.6
    scene = replace(scene, bodies={"cube": replace(scene.bodies["cube"], mesh=fine)})
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-9)

    exact = 1e-3 * np.array([0.3, 0.3, -1.0]) * (fine.points - [0.0, 0.5, 0.0])
    np.testing.assert_allclose(state.gather_displacement("cube"), exact, atol=1e-8)


@pytest.mark.parametrize("discretisation", ["node", "mortar"])
@pytest.mark.parametrize("parts", [1, 3])
def test_a_turned_block_without_friction_is_pressed_and_stays(discretisation: str, parts: int) -> None:
    scene = turned_stack(None, discretisation)
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut(scene, parts))

    force = state.contact.force.sum(axis=0)
    np.testing.assert_allclose(force, TURN @ [0.0, 0.0, 0.01 * 1.0 * 0.9], atol=1e-5)
    assert len(state.unheld) == 3
    arm = scene.bodies["upper"].mesh.points - scene.bodies["upper"].mesh.points.mean(axis=0)
    for motion in (TURN[:, 0], TURN[:, 1], np.cross(TURN[:, 2], arm)):
        assert left_of(state, "upper", np.broadcast_to(motion, arm.shape)) < 1e-10


@pytest.mark.parametrize(
    ("friction", "solver"),
    [(Coulomb(0.3), None), (Coulomb(0.3), FixedPoint(FaceNewton())), (Tresca(0.01), None)],
)
def test_friction_holds_a_turned_block(friction: Coulomb | Tresca, solver: FixedPoint | None) -> None:
    state = solve_scene(turned_stack(friction), MPI.COMM_SELF, solver=solver)

    assert state.unheld == ()
    np.testing.assert_allclose(state.contact.force.sum(axis=0), TURN @ [0.0, 0.0, 0.009], atol=1e-5)


def test_friction_elsewhere_keeps_its_steps_beside_an_unheld_body() -> None:
    """The growth of friction with the normal force is in Newton's steps although one body is not held."""
    rubbed = turned_stack(Coulomb(0.3))
    push = Traction("upper", "z1", tuple(TURN @ [0.002, 0.0, -0.01]))
    rubbed = replace(rubbed, loads=[push])
    alone = solve_scene(rubbed, MPI.COMM_SELF, partitions=cut(rubbed, 2), tolerance=1e-8)

    other = cube_on_floor(3)
    beside = replace(
        rubbed,
        bodies={**rubbed.bodies, **other.bodies},
        supports=[*rubbed.supports, *other.supports],
        contacts=[*rubbed.contacts, *other.contacts],
    )
    both = solve_scene(beside, MPI.COMM_SELF, partitions=cut(beside, 2), tolerance=1e-8)

    assert [str(motion) for motion in both.unheld] == ["'cube': translation (0, 1, 0)"]
    count = alone.contact.points.count
    np.testing.assert_allclose(both.contact.force[:count], alone.contact.force, atol=1e-9)
    assert both.solution.iterations <= alone.solution.iterations + 3


def test_bodies_tied_together_stay_together() -> None:
    low = Body(rectangle((0.0, 0.0), (1.1, 0.7), (3, 2)), PlaneStrain(100.0, 0.3))
    top = Body(rectangle((0.2, 0.7), (0.9, 1.2), (2, 3)), PlaneStrain(100.0, 0.3))
    floor = RigidPlane((0.0, 0.0), (0.0, 1.0))
    scene = Scene(
        {"low": low, "top": top},
        [Support("top", "y1", (None, -1e-3))],
        contacts=[ContactPair(Surface("low", "y0"), floor)],
        ties=[Tie(Surface("top", "y0"), Surface("low", "y1"))],
    )
    state = solve_scene(scene, MPI.COMM_SELF)

    (motion,) = state.unheld
    np.testing.assert_allclose([motion.bodies[name] for name in ("low", "top")], 2 * [[1.0, 0.0, 0.0]])
    moved = np.concatenate([state.gather_displacement(name) for name in scene.bodies])
    assert abs(moved[:, 0].mean()) < 1e-10 * np.abs(moved).max()


def test_a_load_on_what_nothing_holds_is_refused_where_systems_are_built_by_hand() -> None:
    scene = replace(cube_on_floor(3), loads=[Traction("cube", "x1", (0.0, 1e-3, 0.0))])
    torn = build_torn_system(scene, decompose(scene, cut(scene, 2), MPI.COMM_SELF))

    with pytest.raises(InfeasibleError, match=r"every loaded body must be held, a motion has load"):
        DualSystem(torn)


def test_the_next_load_of_the_same_scene_is_checked_too() -> None:
    scene = cube_on_floor(3)
    decomposition = decompose(scene, cut(scene, 2), MPI.COMM_SELF)
    torn = build_torn_system(scene, decomposition)
    known = DualSystem(torn)
    pushed = replace(scene, loads=[Traction("cube", "x1", (0.0, 1e-3, 0.0))])

    with pytest.raises(InfeasibleError, match=r"every loaded body must be held, a motion has load"):
        DualSystem(build_torn_system(pushed, decomposition, previous=torn), previous=known)


def test_unheld_motions_are_the_same_on_any_number_of_ranks(mpirun) -> None:
    script = """
        import numpy as np
        from mpi4py import MPI
        from fenics_contact import solve_scene
        from benchmarks.graph_partition import graph_partition
        from tests.equilibrium.stacks import cut, turned_stack
        scene = turned_stack()
        state = solve_scene(scene, MPI.COMM_WORLD, partitions=cut(scene, 4), tolerance=1e-9)
        words, moved = [str(motion) for motion in state.unheld], state.gather_displacement("upper")
        if MPI.COMM_WORLD.rank == 0:
            print(len(words), np.linalg.norm(moved).round(10), *moved[7].round(10))
    """
    assert mpirun(script, 1) == mpirun(script, 2)


# Nonlinear bodies that something does not hold are named with their motion before Newton's method begins.
SOFT_RUBBER = NeoHooke(3.0, 0.45)
FLAT = RigidPlane((0.0, 0.0), (0.0, 1.0))


@pytest.fixture
def no_newton(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let Newton's method fail at once."""

    def begun(*arguments: object, **options: object) -> None:
        raise AssertionError("Newton's method has begun")

    monkeypatch.setattr("fenics_contact.TangentNewton.solve", begun)


def pressed_disc(*supports: Support, friction: Friction = None) -> Scene:
    disc = Body(half_disc(5.0, 4), SOFT_RUBBER)
    pair = ContactPair(Surface("roll", "contact"), FLAT, friction)
    return Scene({"roll": disc}, supports, contacts=[pair])


def cube(material: Material = SOFT_RUBBER, **given: object) -> Scene:
    body = Body(block((0, 0, 0), (1, 1, 1), (2, 2, 2)), material)
    return Scene({"cube": body}, **given)  # type: ignore[arg-type]


def test_a_forgotten_plane_of_symmetry_is_named_before_newtons_method(no_newton: None) -> None:
    with pytest.raises(InfeasibleError, match=r"nothing resists body 'roll': translation \(1, 0\): support"):
        solve_scene(pressed_disc(Support("roll", "top", (None, -0.4))), MPI.COMM_SELF)


def test_it_is_named_too_where_a_force_presses(no_newton: None) -> None:
    scene = pressed_disc()
    pushed = Scene(scene.bodies, [], [TotalForce("roll", "top", (0.0, -1.0))], scene.contacts)
    with pytest.raises(InfeasibleError, match=r"nothing resists body 'roll': translation \(1, 0\)"):
        solve_scene(pushed, MPI.COMM_SELF)


@pytest.mark.parametrize("material", [SOFT_RUBBER, J2Plasticity(3.0, 0.3, 0.1, 0.1)], ids=["rubber", "metal"])
def test_every_motion_of_a_body_between_rollers_is_named(material: Material, no_newton: None) -> None:
    rollers = [Support("cube", side, (None, None, z)) for side, z in (("z0", 0.0), ("z1", -0.1))]
    with pytest.raises(InfeasibleError) as caught:
        solve_scene(cube(material, supports=rollers), MPI.COMM_SELF)
    for motion in ("translation (1, 0, 0)", "translation (0, 1, 0)", "rotation (0, 0, 1)"):
        assert f"body 'cube': {motion}" in str(caught.value)


def test_friction_and_supports_hold_what_is_pressed() -> None:
    rubbing = solve_scene(
        pressed_disc(Support("roll", "top", (None, -0.1)), friction=Coulomb(0.5)), MPI.COMM_SELF
    )
    guided = solve_scene(
        pressed_disc(Support("roll", "top", (None, -0.1)), Support("roll", "x0", (0.0, None))), MPI.COMM_SELF
    )
    assert rubbing.contact.normal_force.sum() > 0.0
    assert guided.contact.normal_force.sum() > 0.0


def test_a_wall_that_is_met_later_holds() -> None:
    wall = RigidPlane((1.05, 0.0, 0.0), (-1.0, 0.0, 0.0))
    guides = [Support("cube", "z0", (None, None, 0.0)), Support("cube", "y0", (None, 0.0, None))]
    pair = ContactPair(Surface("cube", "x1"), wall)
    pushed = cube(supports=guides, loads=[TotalForce("cube", "x0", (0.01, 0.0, 0.0))], contacts=[pair])
    assert solve_scene(pushed, MPI.COMM_SELF).contact.normal_force.sum() == pytest.approx(0.01, rel=1e-6)


def two_squares(gap: float) -> Scene:
    """A square that is moved towards one that nothing but the floor holds, without friction."""
    low, high = rectangle((0, 0), (1, 1), (2, 2)), rectangle((0.2, 1 + gap), (0.8, 1.5 + gap), (2, 2))
    pair = ContactPair(Surface("high", "y0"), Surface("low", "y1"), discretisation="node")
    floor = ContactPair(Surface("low", "y0"), FLAT)
    return Scene(
        {"low": Body(low, SOFT_RUBBER), "high": Body(high, SOFT_RUBBER)},
        [Support("high", "y1", (0.0, -0.1))],
        contacts=[pair, floor],
    )


def test_a_body_at_which_nothing_happens_may_wait() -> None:
    state = solve_scene(two_squares(0.2), MPI.COMM_SELF)
    np.testing.assert_allclose(state.gather_displacement("high"), [[0.0, -0.1]] * 9, atol=1e-9)


def test_a_body_that_another_one_meets_is_named_once_newtons_method_finds_it_loose(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried = []

    def loose(*arguments: object, **options: object) -> None:
        tried.append(arguments)
        raise NotHeldError("nothing holds some body")

    monkeypatch.setattr("fenics_contact.TangentNewton.solve", loose)
    with pytest.raises(InfeasibleError, match=r"nothing resists body 'low': translation \(1, 0\)") as caught:
        solve_scene(two_squares(0.05), MPI.COMM_SELF)
    assert isinstance(caught.value.__cause__, NotHeldError)
    assert len(tried) == 1


def test_a_load_step_that_ends_points_at_flat_sides_on_which_nothing_acts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def ends(*arguments: object, **options: object) -> None:
        raise ConvergenceError("no way on")

    monkeypatch.setattr("fenics_contact.TangentNewton.solve", ends)
    top, sides = Support("roll", "top", (0.0, -1.0)), Support("roll", "x0", (0.0, None))
    with pytest.raises(LoadStepError, match=r"plane of symmetry .* see surface 'x0' of body 'roll', on"):
        solve_scene(pressed_disc(top), MPI.COMM_SELF)
    with pytest.raises(LoadStepError) as caught:
        solve_scene(pressed_disc(top, sides), MPI.COMM_SELF)
    assert "symmetry" not in str(caught.value)


def test_tangents_that_are_not_finite_cut_the_step_and_end_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    stiffness = HyperelasticMechanics._stiffness

    def broken(self: HyperelasticMechanics, u: np.ndarray, origin: np.ndarray | None) -> sp.csr_matrix:
        return stiffness(self, u, origin) * (np.nan if np.abs(u).max() > 0.05 else 1.0)

    monkeypatch.setattr(HyperelasticMechanics, "_stiffness", broken)
    scene = cube(supports=[Support("cube", "z0"), Support("cube", "z1", (0.0, 0.0, -0.1))])
    message = "followed up to 0.4.* tangents must be finite, got NaN or infinity in body 'cube' at"
    with pytest.raises(LoadStepError, match=message):
        solve_scene(scene, MPI.COMM_SELF)


# Bodies held just so: as many rows as rigid motions, whose forces equilibrium alone gives.
SOFT = PlaneStrain(1.0, 0.3)


def beam_on_a_block(rows: int, tied: bool) -> Scene:
    """A beam held along x at its left end, resting with one node on a block, under pressure."""
    block = rectangle((1.5, 0.0), (2.5, 1.0), (2, 2))
    beam = rectangle((0.0, 1.0), (6.0, 2.0), (3, rows))
    over, under = Surface("beam", "y0"), Surface("block", "y1")
    return Scene(
        {"block": Body(block, SOFT), "beam": Body(beam, SOFT)},
        [Support("block", "y0", (0.0, 0.0)), Support("beam", "x0", (0.0, None))],
        [Pressure("beam", "y1", 1e-3)],
        [] if tied else [ContactPair(over, under, discretisation="node")],
        [Tie(over, under, True, "node")] if tied else [],
    )


def moments(state: State) -> np.ndarray:
    """Return what is missing to equilibrium of the beam: forces and the moment, by contact alone."""
    contact, places = state.contact, state.contact_places
    force = contact.force.sum(axis=0)
    turned = (places[:, 0] * contact.force[:, 1] - places[:, 1] * contact.force[:, 0]).sum()
    return np.array([*force, turned])


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_a_contact_force_that_equilibrium_gives(rows: int) -> None:
    state = solve_scene(beam_on_a_block(rows, tied=False), MPI.COMM_SELF)

    assert state.contact.points.count == 1
    np.testing.assert_allclose(moments(state)[1], 6e-3, rtol=1e-9)


@pytest.mark.parametrize("rows", [1, 2])
def test_a_tie_that_equilibrium_gives_bends_the_beam_as_contact_does(rows: int) -> None:
    tied, touching = (
        solve_scene(beam_on_a_block(rows, tied=tied), MPI.COMM_SELF, tolerance=1e-11)
        for tied in (True, False)
    )

    np.testing.assert_allclose(
        tied.gather_displacement("beam"), touching.gather_displacement("beam"), rtol=1e-9, atol=1e-12
    )


@pytest.mark.parametrize("kind", [LocalKind.EXPLICIT, LocalKind.IMPLICIT])
def test_the_inverse_of_such_a_body_is_one(kind: LocalKind) -> None:
    scene = beam_on_a_block(1, tied=False)
    parts = {name: np.zeros(body.mesh.n_cells, dtype=int) for name, body in scene.bodies.items()}
    torn = build_torn_system(scene, decompose(scene, parts, MPI.COMM_SELF))
    system = DualSystem(torn, kind=kind)
    beam = torn.subdomains[1]
    start = torn.subdomains[0].mesh.size
    force = np.random.default_rng(0).standard_normal(beam.mesh.size)
    modes, _ = np.linalg.qr(beam.kernel)
    force -= modes @ (modes.T @ force)  # only balanced forces bend a body that floats
    given = np.concatenate([np.zeros(start), force])

    found = system.inverse(given)[start:]

    np.testing.assert_allclose(beam.stiffness @ found, force, atol=1e-10 * np.abs(force).max())


# Gaps whose error by flat facets is not small beside what moves are told, once; others are not.
CLAMPED = "gaps of hub inner on shaft outer are uncertain: "
DISCS: list[Disc] = ["node", "mortar"]


def clamp(pressure: float, around: int = 24, **pair: Any) -> Scene:
    """A quarter of a hub that is pressed onto a shaft of the same radius, on meshes that do not match."""
    scene = press_fit(around, 6, outside=around * 4 // 3, part=0.25, **pair)
    return replace(scene, loads=[Pressure("hub", "outer", pressure)])


def told(caplog: pytest.LogCaptureFixture, scene: Scene) -> list[str]:
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        solve_scene(scene, MPI.COMM_SELF, tolerance=1e-6)
    return [record.getMessage() for record in caplog.records]


@pytest.mark.parametrize("disc", DISCS)
def test_facets_of_a_clamped_hub_are_told(disc: Disc, caplog: pytest.LogCaptureFixture) -> None:
    (words,) = told(caplog, clamp(20.0, geometry="faceted", discretisation=disc))
    assert words.startswith(f"{CLAMPED}flat facets miss the true surfaces by up to 0.")
    assert (
        "against each other: take geometry='best', give the meshes their shapes (BodyMesh.shapes, " in words
    )
    assert "ContactPair(gap=...) or interference=..., or by adjust=..." in words


@pytest.mark.parametrize("disc", DISCS)
def test_nothing_is_told_where_the_gap_is_known(disc: Disc, caplog: pytest.LogCaptureFixture) -> None:
    assert told(caplog, clamp(20.0, discretisation=disc)) == []
    for given in ({"gap": 0.0}, {"interference": 0.01}, {"adjust": 0.5}):
        unknown = {"shapes": False, "geometry": "faceted", "discretisation": disc, **given}
        assert told(caplog, clamp(20.0, **unknown)) == []


def test_facets_of_surfaces_that_stay_far_apart_are_not_told(caplog: pytest.LogCaptureFixture) -> None:
    assert told(caplog, clamp(20.0, geometry="faceted", overlap=-1.0)) == []


def test_reconstructed_surfaces_are_told_where_little_moves(caplog: pytest.LogCaptureFixture) -> None:
    (words,) = told(caplog, clamp(2.0, shapes=False))
    assert words.startswith(f"{CLAMPED}surfaces reconstructed from the nodes miss the true surfaces by up to")
    assert "geometry='best'" not in words
    assert told(caplog, clamp(20.0, 96, shapes=False)) == []


@pytest.mark.parametrize("geometry", ["reconstructed", "faceted"])
def test_a_roller_is_told_of_by_facets_alone(
    geometry: Literal["reconstructed", "faceted"], caplog: pytest.LogCaptureFixture
) -> None:
    plate, disc = rectangle((0, -5), (6, 0), (48, 24)), half_disc(10.0, 8, grading=1.0)
    meshes, steel = {"plate": plate, "roller": disc}, PlaneStrain(2.1e5, 0.3)
    guides = [Support(name, "x0", (0.0, None)) for name in meshes]
    pair = ContactPair(Surface("plate", "y1"), Surface("roller", "contact"), geometry=geometry)
    scene = Scene(
        {name: Body(mesh, steel) for name, mesh in meshes.items()},
        [Support("plate", "y0", (None, 0.0)), *guides],
        [TotalForce("roller", "top", (0.0, -2000.0))],
        [pair],
    )
    assert len(told(caplog, scene)) == (geometry == "faceted")
    # Slave nodes lie on their surface, and the plate is flat.
    turned = replace(pair, slave=pair.master, master=pair.slave)
    # Nor is the roller's mesh fine enough for its contact.
    assert all(
        " is too small for its cells" in words for words in told(caplog, replace(scene, contacts=[turned]))
    )


def test_flat_surfaces_need_no_second_search(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    from fenics_contact.feti import torn

    def once(*args: Any, finer: bool = False, **options: Any) -> Any:
        assert not finer
        return find_contact_points(*args, **options)

    monkeypatch.setattr(torn, "find_contact_points", once)
    for scene in (two_blocks(None, push=0.0), block_on_plane(None, push=0.0), clamp(20.0)):
        assert told(caplog, scene) == []
    with pytest.raises(AssertionError):
        solve_scene(clamp(20.0, shapes=False), MPI.COMM_SELF, tolerance=1e-6)


def test_a_pair_is_told_of_once(caplog: pytest.LogCaptureFixture) -> None:
    scene = clamp(20.0, geometry="faceted")
    problem, counts = ContactProblem(scene, MPI.COMM_SELF, tolerance=1e-6), []
    with caplog.at_level(logging.WARNING):
        for pressure in (1e5, 20.0, 10.0):
            problem.solve(replace(scene, loads=[Pressure("hub", "outer", pressure)]))
            counts.append(sum(each.getMessage().startswith("gaps of hub") for each in caplog.records))
    assert counts == [0, 1, 1]


def test_a_shaft_that_turns_away_is_told(caplog: pytest.LogCaptureFixture) -> None:
    scene = press_fit(24, 8, interference=0.05, discretisation="mortar")
    hub = scene.bodies["hub"]
    turn = 0.4 * 2 * np.pi / 24
    way = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    turned = replace(hub, mesh=hub.mesh.placed(way, np.zeros(2)))
    free = replace(scene, bodies={**scene.bodies, "hub": turned})
    # Weighted means over facets that are turned against each other do not face their nodes exactly, and
    # nothing else keeps the shaft from turning.
    words, further = told(caplog, free)
    assert further.startswith("body 'shaft' has turned by ")
    assert words.startswith("surfaces of hub inner on shaft outer slide by up to ")
    assert words.endswith("what only the facets keep from turning or shifting, or move it in the mesh")
    (pair,) = free.contacts
    assert told(caplog, replace(free, contacts=[replace(pair, discretisation="node")])) == []


def test_surfaces_that_press_and_slide_by_a_facet_of_the_master_are_told(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Where contact points do not follow: with small strains, also of metal."""
    low, high = rectangle((0, 0), (8, 1), (8, 2)), rectangle((1, 1), (3, 2), (3, 1))
    pair = ContactPair(Surface("high", "y0"), Surface("low", "y1"), discretisation="node")
    for material in (PlaneStrain(1e3, 0.3), J2Plasticity(1e3, 0.3, 1e3)):
        for way, facets in ((0.9, 0), (1.5, 1)):
            bodies = {"low": Body(low, material), "high": Body(high, material)}
            supports = [Support("low", "y0"), Support("high", "y1", (way, -1e-3))]
            words = told(caplog, Scene(bodies, supports, contacts=[pair]))
            assert len(words) == facets
            if facets:
                slid = "that press slide by up to 1.5 along each other, 1.5 facets of the master"
                assert words[0].startswith(f"surfaces of high y0 on low y1 {slid}")
                assert "a material for large deformations, such as StVenantKirchhoff" in words[0]


@pytest.mark.parametrize("slide", [0.0, 0.5])
@pytest.mark.parametrize("discretisation", ["mortar", "node"])
@pytest.mark.parametrize("rounded_is_slave", [True, False])
def test_a_rounded_surface_that_rolls_where_it_slides_is_told(
    rounded_is_slave: bool, discretisation: Disc, slide: float, caplog: pytest.LogCaptureFixture
) -> None:
    """It does where gaps are measured along its normals, and the force shows it: ½ slide² / R more depth."""
    radius, depth, steel = 10.0, 0.05, PlaneStrain(1e3, 0.3)
    low, high = rectangle((-4, -2), (4, 0), (48, 12)), rectangle((-3, 0), (3, 3), (48, 12))
    x, y = high.points.T
    high = high.moved(np.column_stack([x, y + x**2 / (2 * radius) * (1 - y / 3)]))
    surfaces = [Surface("high", "y0"), Surface("low", "y1")][:: 1 if rounded_is_slave else -1]
    pair = ContactPair(*surfaces, discretisation=discretisation)
    supports = [Support("low", "y0"), Support("high", "y1", (slide, -depth))]
    scene = Scene({"low": Body(low, steel), "high": Body(high, steel)}, supports, contacts=[pair])
    rolls = bool(slide) and rounded_is_slave == (discretisation == "mortar")
    words = [each for each in told(caplog, scene) if "as if it rolled" in each]
    assert len(words) == rolls
    if rolls:
        assert "'y0' of 'high' is rounded, and gaps along its normals change by up to 0.012 as" in words[0]
    force = solve_scene(scene, MPI.COMM_SELF).contact.normal_force.sum()
    assert force == pytest.approx(29.2 if rolls else 22.0, rel=0.005)


def test_a_shaft_that_turns_in_its_hole_rolls_nowhere() -> None:
    """Both surfaces are curved alike: slip along them changes no gap, and curvature alone is no doubt."""
    scene = press_fit(24, 8, interference=0.05, discretisation="mortar")
    turn = Support("shaft", "inner", (lambda x: -0.05 * x[:, 1], lambda x: 0.05 * x[:, 0]))
    state = solve_scene(replace(scene, supports=[Support("hub", "outer"), turn]), MPI.COMM_SELF)
    assert np.abs(state.contact.total_slip).max() > 0.04
    assert rolling(state, 0, 0.0).gap < 1e-3 * np.abs(state.contact.total_slip).max() ** 2


# Bodies that touch and are not loaded: the answer is zero, at once.
STEEL = IsotropicElasticity(2.1e5, 0.3)


def stack(seed: int, friction: Coulomb | None, discretisation: str, *, held: bool = True) -> Scene:
    """A block on another one, of sizes and at a place that are not exact in binary."""
    random = np.random.default_rng(seed)
    size, (x, y) = random.uniform(0.5, 3.0), random.uniform(-0.3, 0.3, 2)
    lower = block((0.0, 0.0, 0.0), (size, size, size), (3, 3, 3))
    upper = block((x, y, size), (x + 0.8 * size, y + 0.8 * size, size + 0.3), (4, 3, 2))
    below = (0.0, 0.0, 0.0) if held else (None, None, 0.0)
    return Scene(
        {"lower": Body(lower, STEEL), "upper": Body(upper, STEEL)},
        [Support("lower", "z0", below)],
        contacts=[ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), friction, discretisation)],
    )


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("discretisation", ["node", "mortar"])
@pytest.mark.parametrize("friction", [None, Coulomb(0.5)])
@pytest.mark.parametrize("held", [True, False])
def test_nothing_happens_at_once(
    seed: int, discretisation: str, friction: Coulomb | None, held: bool
) -> None:
    scene = stack(seed, friction, discretisation, held=held)
    parts = {name: graph_partition(body.mesh, 3) for name, body in scene.bodies.items()}

    for partition in (None, parts):
        state = solve_scene(scene, MPI.COMM_SELF, partitions=partition)

        assert state.solution.products == 0
        assert [step.method for step in state.solution.history] == ["start"]
        assert not state.contact.normal_force.any()
        assert not any(state.gather_displacement(name).any() for name in scene.bodies)


@pytest.mark.parametrize("solver", [FaceNewton(), Smalse()])
def test_every_solver_takes_a_start_that_is_the_answer(solver: FaceNewton | Smalse) -> None:
    scene = stack(1, None, "mortar")

    state = solve_scene(scene, MPI.COMM_SELF, solver=solver)

    assert (state.solution.products, state.solution.residuals.worst) == (0, 0.0)


def test_unloading_ends_without_any_force() -> None:
    loaded = stack(2, Coulomb(0.5), "node")
    pressed = Scene(loaded.bodies, loaded.supports, [Pressure("upper", "z1", 3.0)], loaded.contacts)

    assert solve_scene(pressed, MPI.COMM_SELF).contact.normal_force.sum() > 1.0
    assert not solve_scene(loaded, MPI.COMM_SELF).contact.normal_force.any()


def test_gaps_of_rounding_are_none_in_any_unit_and_anywhere() -> None:
    for unit in (1e-6, 1.0, 1e6):
        places = unit * np.array([[0.3, 0.7, 1.1], [1.3, 0.2, 1.1]])
        for far in (0.0, 1e5 * unit):
            rounding = np.finfo(float).eps * (places + far).max()
            gap = np.array([0.0, 3.0, -9.0, 300.0, -300.0]) * rounding

            found = without_rounding(gap, places + far)

            np.testing.assert_array_equal(found, [0.0, 0.0, 0.0, gap[3], gap[4]])

"""The plan of a scene names what will be built, and what is built is what it names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    Pressure,
    RigidPlane,
    Scene,
    Support,
    Surface,
    Tie,
    TotalForce,
    Traction,
    Tresca,
    box_partition,
    solve_scene,
)
from fenics_contact._scene.plan import ConeKind, SolverKind
from fenics_contact.feti import DualSystem
from fenics_contact.feti.direct import DirectSystem
from fenics_contact.gallery import block, half_cylinder, half_disc, hemisphere, rectangle
from fenics_contact.materials import IsotropicElasticity, Material, PlaneStrain
from fenics_contact.mesh import quadratic
from fenics_contact.results.deformed_state import AnyState
from fenics_contact.theory import contact_modulus, hertz_line, hertz_point
from tests.scenes import Friction

STEEL = IsotropicElasticity(1000.0, 0.3)
UNCUT = {"lower": (1, 1, 1), "upper": (1, 1, 1)}


def stack(**parts: Any) -> Scene:
    """Two cubes upon each other, the lower one held, the upper one pressed."""
    lower, upper = block((0, 0, 0), (1, 1, 1), (4, 4, 4)), block((0, 0, 1), (1, 1, 2), (4, 4, 4))
    scene = Scene(
        {"lower": Body(lower, STEEL), "upper": Body(upper, STEEL)},
        [Support("lower", "z0")],
        [Traction("upper", "z1", (0.1, 0.0, -1.0))],
    )
    return replace(scene, **parts)


def cuts(scene: Scene, boxes: tuple[int, ...] = (2, 1, 1)) -> dict[str, np.ndarray]:
    return {name: box_partition(body.mesh, boxes) for name, body in scene.bodies.items()}


def pair(friction: Friction = None) -> list[ContactPair]:
    return [ContactPair(Surface("upper", "z0"), Surface("lower", "z1"), friction)]


def solved(scene: Scene) -> AnyState:
    return solve_scene(scene, MPI.COMM_SELF, partitions=cuts(scene), tolerance=1e-6)


GUIDE = [
    Support("lower", "z0"),
    Support("upper", "x0", (0.0, None, None)),
    Support("upper", "y0", (None, 0, None)),
]
SCENES = {
    "frictionless": (stack(contacts=pair(), supports=GUIDE), SolverKind.FACE_NEWTON, ConeKind.BOUNDS, False),
    "no friction in a law": (
        stack(contacts=pair(Coulomb(0.0)), supports=GUIDE), SolverKind.FACE_NEWTON, ConeKind.BOUNDS, False,
    ),
    "Tresca": (stack(contacts=pair(Tresca(0.3))), SolverKind.FACE_NEWTON, ConeKind.DISCS, False),
    "Coulomb": (stack(contacts=pair(Coulomb(0.3))), SolverKind.FACE_NEWTON, ConeKind.COULOMB, True),
    "tied": (
        stack(ties=[Tie(Surface("upper", "z0"), Surface("lower", "z1"))]),
        SolverKind.PROJECTED_CG, ConeKind.NONE, False,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_the_plan_names_the_solver_and_the_cone(name: str) -> None:
    scene, solver, cone, fixed_point = SCENES[name]
    plan = scene.plan(cuts(scene))
    assert (plan.solver, plan.cone, plan.fixed_point) == (solver, cone, fixed_point)
    assert plan.subdomains == 4
    assert plan.coarse_motions == 24
    assert not plan.adjoint


@pytest.mark.parametrize("name", SCENES)
def test_what_is_built_is_what_was_planned(name: str) -> None:
    scene = SCENES[name][0]
    plan, state = scene.plan(cuts(scene)), solved(scene)
    counts = state.counts
    assert counts["torn_unknowns"] == plan.unknowns
    assert counts["subdomains"] == plan.subdomains
    assert counts["kinds"] == plan.kinds
    kinds = plan.multipliers
    assert counts["equality_multipliers"] == kinds["gluing"] + kinds["prescribed"] + kinds["tied"]
    assert counts["normal_multipliers"] == kinds["normal"]
    assert counts["tangential_multipliers"] == kinds["tangential"]
    assert state.dual.problem.coarse.m == plan.coarse_motions


def test_prescribed_nodes_on_a_seam_have_one_multiplier_a_copy() -> None:
    scene = stack(supports=[Support("lower", "x0")], ties=SCENES["tied"][0].ties)
    kinds = scene.plan(cuts(scene)).multipliers
    seam = replace(scene, supports=[Support("lower", "z0")]).plan(cuts(scene)).multipliers
    assert kinds["prescribed"] == seam["prescribed"] == 75
    assert solved(scene).counts["equality_multipliers"] == sum(kinds.values())


def test_one_body_in_one_piece_is_factored() -> None:
    scene = Scene(
        {"lower": stack().bodies["lower"]}, stack().supports, [Traction("lower", "z1", (0.1, 0, -1))]
    )
    whole = {"lower": np.zeros(64, dtype=int)}
    plan = scene.plan(whole)
    assert (plan.solver, plan.coarse_motions, sum(plan.multipliers.values())) == (SolverKind.DIRECT, 0, 0)
    state = solve_scene(scene, MPI.COMM_SELF, partitions=whole, tolerance=1e-10)
    assert isinstance(state.system, DirectSystem)
    torn = solve_scene(
        scene,
        MPI.COMM_SELF,
        partitions={"lower": box_partition(scene.bodies["lower"].mesh, (2, 2, 1))},
        tolerance=1e-10,
    )
    assert isinstance(torn.system, DualSystem)
    size = np.abs(torn.gather_displacement("lower")).max()
    difference = state.gather_displacement("lower") - torn.gather_displacement("lower")
    assert np.abs(difference).max() < 1e-8 * size
    assert state.energies.total_potential == pytest.approx(torn.energies.total_potential, rel=1e-9)
    assert state.energies.dual == pytest.approx(state.energies.primal, rel=1e-9)
    assert state.counts["f_products"] == 0
    assert state.solution.gluing_residual < 1e-12


def test_a_body_that_supports_do_not_hold_alone_is_not_factored() -> None:
    rollers = [Support("lower", "z0", (None, None, 0.0))]
    scene = Scene({"lower": stack().bodies["lower"]}, rollers, [Traction("lower", "z1", (0, 0, -1))])
    whole = {"lower": np.zeros(64, dtype=int)}
    assert scene.plan(whole).solver is SolverKind.PROJECTED_CG
    state = solve_scene(scene, MPI.COMM_SELF, partitions=whole, tolerance=1e-10)
    assert state.energies.primal == pytest.approx(-0.5 * 1.0**2 / 1000.0, rel=1e-9)


def test_sensitivities_need_multipliers_and_an_adjoint() -> None:
    scene = Scene({"lower": stack().bodies["lower"]}, stack().supports)
    plan = scene.plan({"lower": np.zeros(64, dtype=int)}, sensitivity=True)
    assert plan.adjoint
    assert plan.solver is SolverKind.PROJECTED_CG
    assert "in 1 subdomain\n" in str(plan)


def test_without_a_partition_the_plan_has_the_default_one() -> None:
    plan = stack(contacts=pair()).plan()
    assert plan.subdomains == 2
    assert stack(contacts=pair()).plan(ranks=4).subdomains == 4
    eight = stack(contacts=pair()).plan(cuts(stack(), (2, 2, 1)))
    assert eight.kinds == 2  # those of the lower cube are held, too
    assert " in 8 subdomains of 2 kinds\n" in str(eight)


def test_the_plan_in_words_names_every_decision() -> None:
    words = str(SCENES["Coulomb"][0].plan(cuts(SCENES["Coulomb"][0])))
    for part in (
        "Coulomb friction (1 pair has a friction coefficient above zero)", "900 in 4 subdomains",
        "50 tangential", "semismooth Newton on faces", "friction cones", "follow the normal forces",
        "24 rigid motions", " MB",
    ):  # fmt: skip
        assert part in words, part


def test_a_plane_scene_has_one_tangential_multiplier_a_node_and_three_motions_a_piece() -> None:
    mesh = rectangle((0, 0), (2, 1), (8, 4))
    floor = ContactPair(Surface("plate", "y0"), RigidPlane((0, 0), (0, 1)), Coulomb(0.5))
    material: Material = PlaneStrain(1000.0, 0.3)
    scene = Scene({"plate": Body(mesh, material)}, [Support("plate", "y1", (0.0, -0.01))], contacts=[floor])
    cut = {"plate": box_partition(mesh, (2, 1))}
    plan = scene.plan(cut)
    assert plan.coarse_motions == 6
    assert plan.multipliers["normal"] == plan.multipliers["tangential"] == 9
    state = solve_scene(scene, MPI.COMM_SELF, partitions=cut, tolerance=1e-6)
    assert state.counts["torn_unknowns"] == plan.unknowns == 2 * 2 * 25
    assert state.counts["tangential_multipliers"] == 9


STIFF = contact_modulus(1000.0, 0.3, np.inf, 0.0)


def ball(symmetry: Literal["xy", ""], **pair: Any) -> Scene:
    """A plate under a ball of radius 10, or a quarter of both, pressed by a force of 40 on the whole ball."""
    low = 0.0 if symmetry else -3.0
    meshes = {
        "ball": hemisphere(10.0, 8, symmetry=symmetry),
        "plate": block((low, low, -2), (3, 3, 0), (12, 12, 4) if symmetry else (24, 24, 4)),
    }
    guides = [
        Support(name, side, value)
        for name in meshes
        for side, value in (("x0", (0.0, None, None)), ("y0", (None, 0.0, None)))
    ]
    return Scene(
        {name: Body(mesh, STEEL) for name, mesh in meshes.items()},
        [Support("plate", "z0"), *guides] if symmetry else [Support("plate", "z0")],
        [TotalForce("ball", "top", (0.0, 0.0, -10.0 if symmetry else -40.0))],
        [ContactPair(Surface("plate", "z1"), Surface("ball", "contact"), **pair)],
    )


@pytest.mark.parametrize("symmetry", ["xy", ""])
def test_the_plan_tells_by_how_much_facets_miss_a_ball(symmetry: Literal["xy", ""]) -> None:
    (found,) = ball(symmetry).plan().contacts
    hertz = hertz_point(40.0, (0.1, 0.1), STIFF / 2)
    assert (found.slave, found.master) == ("flat", "Sphere")
    assert found.approach == pytest.approx(hertz.approach, rel=0.02)
    # The facets that may touch reach a little beyond √2 times Hertz's radius.
    mesh = ball(symmetry).bodies["ball"].mesh
    middles = mesh.points[mesh.surfaces["contact"]].mean(axis=1)
    missed = 10.0 - np.linalg.norm(middles - (0, 0, 10.0), axis=1)
    near = np.hypot(*middles[:, :2].T) < 1.2 * np.sqrt(2) * hertz.semi_axes[0]
    assert missed[near].min() < found.height < 1.3 * missed[near].max()
    assert found.height < 0.5 * missed.max(), "far away facets are larger, and do not count"
    assert f"{100 * found.height / hertz.approach:.1f} % of the approach" in str(found)


@pytest.mark.parametrize(
    ("geometry", "names"),
    [("reconstructed", "flat on reconstructed"), ("faceted", "facets on facets")],
)
def test_the_plan_names_the_geometry_that_was_asked_for(geometry: str, names: str) -> None:
    best, found = (ball("xy", geometry=each).plan().contacts[0].height for each in ("best", geometry))
    assert found == pytest.approx(best, rel=0.05)
    words = f"{names}; mortar, as the meshes do not match; facets miss it by up to"
    assert words in str(ball("xy", geometry=geometry).plan())


def test_facets_of_a_slave_count_where_gaps_are_means() -> None:
    (pair,) = ball("xy").contacts
    turned = ContactPair(pair.master, pair.slave)  # type: ignore[arg-type]
    for discretisation, counts in (("node", False), ("mortar", True)):
        swapped = replace(turned, discretisation=discretisation)
        (found,) = replace(ball("xy"), contacts=[swapped]).plan().contacts
        assert (found.slave, found.master) == ("Sphere", "flat")
        assert (found.height > 1e-3) == counts
    on_plane = replace(turned, master=RigidPlane((0, 0, 0), (0, 0, 1)), discretisation="mortar")
    (found,) = replace(ball("xy"), contacts=[on_plane]).plan().contacts
    assert str(found) == "Sphere on RigidPlane; node, as the master is rigid; no error by flat facets"
    assert found.approach == pytest.approx(hertz_point(40.0, (0.1, 0.1), STIFF).approach, rel=0.02)


def test_the_plan_knows_lines_of_contact() -> None:
    floor = RigidPlane((0, 0), (0, 1))
    disc = Scene(
        {"disc": Body(half_disc(10.0, 8), PlaneStrain(1000.0, 0.3))},
        [Support("disc", "x0", (0.0, None))],
        [Pressure("disc", "top", 0.1)],
        [ContactPair(Surface("disc", "contact"), floor)],
    )
    depth = 0.1 * hertz_line(2.0, 0.1, STIFF).half_width ** 2 / 2
    assert disc.plan().contacts[0].approach == pytest.approx(depth, rel=0.02)
    bar = Scene(
        {"bar": Body(half_cylinder(10.0, 5.0, 8, 3), STEEL)},
        [Support("bar", "x0", (0.0, None, None))],
        [Traction("bar", "top", (0.0, 0.0, -0.1))],
        [ContactPair(Surface("bar", "contact"), RigidPlane((0, 0, 0), (0, 0, 1)))],
    )
    (found,) = bar.plan().contacts
    assert found.slave == "Cylinder"
    assert found.approach == pytest.approx(depth, rel=0.2)


def test_an_approach_may_be_prescribed_or_unknown() -> None:
    flat = stack(contacts=pair()).plan().contacts[0]
    assert (flat.slave, flat.master, flat.height, flat.approach) == ("flat", "flat", 0.0, None)
    assert str(flat) == "flat on flat; node, as the meshes match; no error by flat facets"
    lowered = [*ball("xy").supports, Support("ball", "top", (None, None, -0.5))]
    (found,) = replace(ball("xy"), supports=lowered, loads=[]).plan().contacts
    assert found.approach == 0.5
    unknown = replace(ball("xy"), loads=[Pressure("ball", "top", lambda x: 1.0 + x[:, 0])]).plan().contacts[0]
    assert (unknown.approach, unknown.share) == (None, None)
    assert "of an unknown part of the approach" in str(unknown)
    assert unknown.height > 1.5 * ball("xy").plan().contacts[0].height, "then all facets count"


@pytest.mark.parametrize(
    ("counts", "words"),
    [
        (2, ""),
        (1, "facets of the master are 4 times as wide as the slave's, and the pressure is only as fine as"),
        (16, "facets of the slave are 4 times as wide as the master's: let the finer surface be the slave; "),
    ],
)
def test_facets_of_very_different_widths_are_named(counts: int, words: str) -> None:
    lower = block((0, 0, 0), (1, 1, 1), (counts, counts, 1))
    bodies = {"lower": Body(lower, STEEL), "upper": stack().bodies["upper"]}
    contacts = [replace(pair()[0], discretisation="node")]
    (found,) = replace(stack(), bodies=bodies, contacts=contacts).plan(ranks=1).contacts
    assert found.wider == pytest.approx(4.0 / counts)
    expected = f"flat on flat; node; {words}no error by flat facets"
    assert str(found) == expected or (words and words in str(found))
    assert replace(found, by_nodes=False).match() == (found.match() if counts < 4 else "")


@pytest.mark.parametrize("orders", [(1, 2), (2, 1), (2, 2)])
def test_a_quadratic_slave_on_a_linear_master_is_named(orders: tuple[int, int]) -> None:
    wanted, bodies = dict(zip(("lower", "upper"), orders, strict=True)), dict(stack().bodies)
    for name in wanted:
        if wanted[name] == 2:
            bodies[name] = Body(quadratic(bodies[name].mesh), STEEL)
    scene = replace(stack(), bodies=bodies, contacts=[replace(pair()[0], discretisation="mortar")])
    (found,) = scene.plan(ranks=1).contacts
    named = scene.bodies[pair()[0].slave.body].mesh.order > scene.bodies[pair()[0].master.body].mesh.order
    assert ("swapped by less than 1 %: let the linear surface be the slave" in str(found)) == named


def test_a_scene_is_made_without_what_its_plan_computes(mpirun: Callable[..., str]) -> None:
    script = """
    import sys
    from fenics_contact import Body, ContactPair, RigidPlane, Scene, Support, Surface
    from fenics_contact.gallery import block
    from fenics_contact.materials import IsotropicElasticity

    body = Body(block((0, 0, 0), (1, 1, 1), (2, 2, 2)), IsotropicElasticity(1.0, 0.3))
    pair = ContactPair(Surface("block", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)))
    scene = Scene({"block": body}, [Support("block", "z1")], contacts=[pair])
    names = ("plan", "pair_geometry")
    for make in (lambda: None, scene.plan):
        make()
        sys.stdout.write(f"{sum('fenics_contact._scene.' + name in sys.modules for name in names)} ")
    """
    assert mpirun(script, 1, fresh=True).split() == ["0", "2"]

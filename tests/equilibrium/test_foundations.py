"""Surfaces on springs to the ground move and push as formulas say."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    ElasticFoundation,
    Pressure,
    RigidPlane,
    Scene,
    Support,
    Surface,
    TotalForce,
    box_partition,
    read_scene_file,
    solve_scene,
    write_result,
)
from fenics_contact._scene_file.source import SceneFileError
from fenics_contact.errors import InfeasibleError, InvalidInputError
from fenics_contact.feti.foundations import foundation_stiffness, separated
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke, PlaneStress
from fenics_contact.mesh import quadratic
from fenics_contact.output import read_result

YOUNG = 2.1e5
STEEL = IsotropicElasticity(YOUNG, 0.0)
ROLLERS = [Support("b", "x0", (0.0, None, None)), Support("b", "y0", (None, 0.0, None))]


def cube(cell: str = "hexahedron", order: int = 1):
    mesh = block((0, 0, 0), (10, 10, 10), (2, 2, 2), cell)
    return mesh if order == 1 else quadratic(mesh)


@pytest.mark.parametrize("supports", [ROLLERS, []])
@pytest.mark.parametrize(
    ("cell", "order"), [("hexahedron", 1), ("tetrahedron", 1), ("hexahedron", 2), ("tetrahedron", 2)]
)
@pytest.mark.parametrize("given", [(1.0, 1.0, 5.0), 5.0])
def test_a_pressed_block_sinks_evenly(supports, cell, order, given) -> None:
    if not supports and given == 5.0:
        given = (2.0, 2.0, 5.0)
    mesh = cube(cell, order)
    soil = ElasticFoundation("b", "z0", given)
    scene = Scene({"b": Body(mesh, STEEL)}, supports, [Pressure("b", "z1", 2.0)], foundations=[soil])
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
    sunk = -state.gather_displacement("b")[:, 2]
    # p / k, and the block's own compression
    assert sunk == pytest.approx(2.0 / 5.0 + 2.0 / YOUNG * mesh.points[:, 2], rel=1e-7)
    assert state.energies.strain == pytest.approx(0.5 * 200.0 * (2.0 / 5.0 + 20.0 / YOUNG))
    assert state.foundations()["b z0"].force == pytest.approx([0.0, 0.0, 200.0], abs=1e-6)
    assert state.balance().imbalance < 1e-9
    assert state.balance().beds.force[2] == pytest.approx(200.0)


def test_partitions_and_a_total_stiffness_change_nothing() -> None:
    mesh, loads = cube(), [TotalForce("b", "z1", (3.0, 0.0, -200.0), at=(8.0, 5.0, 10.0))]
    found = []
    for given, total in (((1.0, 2.0, 5.0), False), ((100.0, 200.0, 500.0), True)):
        soil = ElasticFoundation("b", "z0", given, total)
        for boxes in ((1, 1, 1), (2, 1, 2), (2, 2, 2)):
            scene = Scene({"b": Body(mesh, STEEL)}, [], loads, foundations=[soil])
            parts = {"b": box_partition(mesh, boxes)}
            state = solve_scene(scene, MPI.COMM_SELF, partitions=parts, tolerance=1e-11)
            found.append(state.gather_displacement("b"))
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], atol=1e-8 * np.abs(found[0]).max())


@pytest.mark.parametrize("boxes", [(1, 1), (6, 1)])
def test_a_rail_on_soil_bends_as_hetenyi_says(boxes) -> None:
    """A long beam on springs under a single load, half of it: w = P β / (2 k), β⁴ = k / (4 E I)."""
    length, height, soil, load = 1500.0, 20.0, 0.05, 100.0
    mesh = quadratic(rectangle((0.0, 0.0), (length, height), (150, 2)))
    body = Body(mesh, PlaneStress(YOUNG, 0.3))
    scene = Scene(
        {"rail": body},
        [Support("rail", "x0", (0.0, None))],
        [TotalForce("rail", "x0", (0.0, -load / 2.0))],
        foundations=[ElasticFoundation("rail", "y0", (0.0, soil))],
    )
    parts = {"rail": box_partition(mesh, boxes)}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=parts, tolerance=1e-10)
    decay = (soil / (4.0 * YOUNG * height**3 / 12.0)) ** 0.25
    moved = state.gather_displacement("rail")[:, 1]
    low = np.flatnonzero(np.isclose(mesh.points[:, 1], 0.0))
    low = low[np.argsort(mesh.points[low, 0])]
    x = mesh.points[low, 0]
    exact = -load * decay / (2.0 * soil) * np.exp(-decay * x) * (np.cos(decay * x) + np.sin(decay * x))
    assert np.abs(moved[low] - exact).max() < 0.01 * np.abs(exact).max()
    assert state.foundations()[0].force[1] == pytest.approx(load / 2.0, rel=1e-7)


def test_a_ring_of_revolution_rests_on_its_whole_area() -> None:
    mesh = rectangle((2.0, 0.0), (4.0, 1.0), (4, 2))
    body = Body(mesh, STEEL, axisymmetric=True)
    scene = Scene(
        {"b": body}, [], [Pressure("b", "y1", 3.0)], foundations=[ElasticFoundation("b", "y0", (0.0, 6.0))]
    )
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-10)
    assert state.gather_displacement("b")[:, 1] == pytest.approx(-0.5, rel=1e-4)
    assert state.foundations()[0].force[1] == pytest.approx(3.0 * np.pi * (16.0 - 4.0))


def test_contact_with_friction_on_a_sprung_block() -> None:
    """Springs along the surface take what friction does not: the block slides on its floor against them."""
    floor = ContactPair(Surface("b", "z0"), RigidPlane((0, 0, 0), (0, 0, 1)), Coulomb(0.25))
    loads = [Pressure("b", "z1", 2.0), TotalForce("b", "z1", (80.0, 0.0, 0.0), at=(5.0, 5.0, 0.0))]
    side = ElasticFoundation("b", "z1", (0.5, 0.5, 0.0))
    scene = Scene({"b": Body(cube(), STEEL)}, [], loads, [floor], foundations=[side])
    state = solve_scene(scene, MPI.COMM_SELF, tolerance=1e-9)
    assert state.foundations()[0].force[0] == pytest.approx(0.25 * 200.0 - 80.0, rel=1e-3)


@pytest.mark.parametrize("boxes", [(1, 1, 1), (1, 1, 2)])
def test_a_rubber_block_sinks_into_the_same_springs(boxes) -> None:
    mesh = cube()
    scene = Scene(
        {"b": Body(mesh, NeoHooke(100.0, 0.0))},
        ROLLERS,
        [TotalForce("b", "z1", (0.0, 0.0, -200.0))],
        foundations=[ElasticFoundation("b", "z0", 5.0)],
    )
    state = solve_scene(scene, MPI.COMM_SELF, partitions={"b": box_partition(mesh, boxes)})
    low = np.isclose(mesh.points[:, 2], 0.0)
    assert state.gather_displacement("b")[low, 2] == pytest.approx(-200.0 / 100.0 / 5.0, rel=1e-6)
    assert state.balance().imbalance < 1e-7
    # Exact tangents: the last steps square the residual.
    assert len(state.solution.history) <= 5


def test_rubber_that_a_foundation_alone_holds_sinks_by_force_over_stiffness() -> None:
    soil, force = ElasticFoundation("b", "z0", (1.0, 1.0, 5.0)), 0.9
    mesh = cube()
    bodies = {"b": Body(mesh, NeoHooke(100.0, 0.0))}
    scene = Scene(bodies, [], [TotalForce("b", "z1", (0, 0, -force))], foundations=[soil])
    state = solve_scene(scene, MPI.COMM_SELF)
    area = np.prod(np.ptp(mesh.points, axis=0)[:2])
    below = state.gather_displacement("b")[np.unique(mesh.surfaces["z0"])]
    np.testing.assert_allclose(below, np.tile([0.0, 0.0, -force / (5.0 * area)], (len(below), 1)), atol=1e-9)


def test_what_springs_do_not_resist_must_be_held() -> None:
    loads = [TotalForce("b", "z1", (1.0, 0.0, -2.0))]
    soil = ElasticFoundation("b", "z0", 5.0)
    with pytest.raises(InfeasibleError, match=r"'b' can move away under the load: translation \(1, 0, 0"):
        solve_scene(Scene({"b": Body(cube(), STEEL)}, [], loads, foundations=[soil]), MPI.COMM_SELF)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: ElasticFoundation("b", "z0", 0.0), "must be positive, or numbers of at least zero"),
        (lambda: ElasticFoundation("b", "z0", (1.0, -1.0, 0.0)), "must be positive, or numbers"),
        (lambda: _scene(ElasticFoundation("b", "z0", (1.0, 1.0))), "must have 3 entries"),
        (lambda: _scene(ElasticFoundation("b", "under", 1.0)), "ElasticFoundation names surface 'under'"),
    ],
)
def test_foundations_that_do_not_suit_their_body_are_refused(made, message) -> None:
    with pytest.raises(InvalidInputError, match=message):
        made()


def _scene(foundation: ElasticFoundation) -> Scene:
    return Scene({"b": Body(cube(), STEEL)}, foundations=[foundation])


RANKS = """
    from mpi4py import MPI
    from fenics_contact import Body, ElasticFoundation, Scene, TotalForce, box_partition, gallery, materials
    from fenics_contact import solve_scene

    mesh = gallery.block((0, 0, 0), (10, 10, 10), (4, 2, 4))
    body = Body(mesh, materials.IsotropicElasticity(2.1e5, 0.3))
    soil = ElasticFoundation("b", "z0", (1.0, 2.0, 5.0))
    scene = Scene({"b": body}, [], [TotalForce("b", "x1", (3.0, 0.0, -20.0))], foundations=[soil])
    parts = {"b": box_partition(mesh, (2, 1, 2))}
    state = solve_scene(scene, MPI.COMM_WORLD, partitions=parts, tolerance=1e-11)
    force, lowest = state.foundations()[0], float(state.gather_displacement("b").min())
    if MPI.COMM_WORLD.rank == 0:
        print(repr([*force.force.tolist(), *force.moment.tolist(), lowest]))
"""


@pytest.mark.parametrize("ranks", [2, 4])
def test_ranks_find_the_same_forces_of_springs(ranks, mpirun) -> None:
    one, other = (eval(mpirun(RANKS, count)) for count in (1, ranks))
    assert one[:3] == pytest.approx([-3.0, 0.0, 20.0], abs=1e-7)
    np.testing.assert_allclose(other, one, rtol=1e-7, atol=1e-7)


def test_scene_files_and_results_have_foundations(tmp_path) -> None:
    file = read_scene_file(
        {
            "meshes": {"m": {"shape": "block", "lower": [0, 0, 0], "upper": [1, 1, 1], "counts": [1, 1, 1]}},
            "materials": {"s": {"young_modulus": 2.1e5, "poisson_ratio": 0.3}},
            "bodies": {"b": {"mesh": "m", "material": "s"}},
            "loads": [{"kind": "pressure", "body": "b", "surface": "z1", "value": 2.0}],
            "foundations": [{"body": "b", "surface": "z0", "stiffness": [1, 1, 5]}],
        },
        MPI.COMM_SELF,
    )
    assert "elastic foundation (1 surface rests on springs)" in str(file.scene.plan())
    write_result(solve_scene(file.scene, MPI.COMM_SELF), tmp_path)
    result = read_result(tmp_path)
    assert result["forces"]["foundations"][0]["force"] == pytest.approx([0.0, 0.0, 2.0], abs=1e-8)
    assert result["scene"]["foundations"][0]["stiffness"] == [1.0, 1.0, 5.0]


def test_radial_springs_hold_no_ring_along_its_axis() -> None:
    """Normals of quadratic edges have an axial component in the last digit."""
    mesh = quadratic(rectangle((0.6, 0.3), (1.2, 1.1), (4, 3), "triangle"))
    ring = Body(mesh, STEEL, axisymmetric=True)
    springs = foundation_stiffness([ElasticFoundation("ring", "x1", 0.1)], ring)
    along = np.tile([0.0, 1.0], mesh.n_nodes)[:, None]
    held, free = separated(springs, along)
    assert along.T @ springs @ along > 0.0
    assert (held.shape[1], free.shape[1]) == (0, 1)


@pytest.mark.parametrize(
    ("stiffness", "words"),
    [
        (-5.0, r"foundations\.0\.stiffness must be a number greater than 0, got -5.0"),
        ("soft", r"foundations\.0\.stiffness must be a number, got \"soft\""),
        ([1.0], r"foundations\.0\.stiffness must be two or three finite numbers in brackets"),
    ],
)
def test_a_wrong_stiffness_in_a_scene_file_is_one_mistake(stiffness: object, words: str) -> None:
    foundations = [{"body": "b", "surface": "z0", "stiffness": stiffness}]
    with pytest.raises(SceneFileError, match=words) as caught:
        read_scene_file({"foundations": foundations}, MPI.COMM_SELF)
    assert str(caught.value).count("stiffness must be") == 1


@pytest.mark.parametrize("boxes", [1, 4])
@pytest.mark.parametrize("young", [1e9, 1e10, 1e12])
def test_a_stiff_block_on_a_soft_bed_sinks_and_tips_as_a_rigid_one(young: float, boxes: int) -> None:
    """By N / (k A) − x M / (k I); its bed is softer than it by up to a billion."""
    mesh, bed, force, moment = block((-3.0, 0.0, 0.0), (3.0, 1.0, 2.0), (12, 1, 4)), 1e3, 900.0, 1350.0
    scene = Scene(
        {"f": Body(mesh, IsotropicElasticity(young, 0.0))},
        [Support("f", "y0", (None, 0.0, None))],
        [TotalForce("f", "z1", (0.0, 0.0, -force), moment=(0.0, moment, 0.0))],
        foundations=[ElasticFoundation("f", "z0", (bed, bed, bed))],
    )
    partitions = {"f": box_partition(mesh, (boxes, 1, 1))}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=partitions)
    exact = -force / (bed * 6.0) - mesh.points[:, 0] * moment / (bed * 18.0)
    np.testing.assert_allclose(state.gather_displacement("f")[:, 2], exact, atol=3e-6)
    assert state.solution.products < 30

"""The displacement of a surface is extended into the mesh, and derivatives are pulled back the same way."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, BodyMesh, Scene, Support, SurfaceDesign, box_partition
from fenics_contact.design.motion import DesignGeometry, MeshMotion, motion_of
from fenics_contact.errors import InvalidInputError
from fenics_contact.feti import decompose
from fenics_contact.gallery import LinkShape, block, box_lattice, chain_link
from fenics_contact.mesh.quality import thickness
from tests.shape.blocks import RUBBER
from tests.shape.chains import chain_problem, crossed_links

CELLS = ("hexahedron", "tetrahedron")


@cache
def brick(cell: str) -> Scene:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.5), (4, 3, 3), cell)
    return Scene({"brick": Body(mesh, RUBBER)}, [Support("brick", "z0")])


def marks(body: Body, nodes: np.ndarray) -> np.ndarray:
    held = np.zeros(body.mesh.points.shape, dtype=bool)
    held[nodes] = True
    return held


def extension(cell: str, held: str = "z0") -> MeshMotion:
    scene = brick(cell)
    body = scene.bodies["brick"]
    decomposition = decompose(scene, {"brick": box_partition(body.mesh, (2, 1, 1))}, MPI.COMM_SELF)
    top, bottom = (np.unique(body.mesh.surfaces[name]) for name in ("z1", held))
    return MeshMotion(decomposition, "brick", body, top, marks(body, np.setdiff1d(bottom, top)))


@pytest.mark.parametrize("cell", CELLS)
def test_prescribed_values_are_met_and_held_nodes_stay(cell: str) -> None:
    motion, mesh = extension(cell), brick(cell).bodies["brick"].mesh
    given = np.random.default_rng(1).standard_normal((len(motion.moving), 3))
    moved = motion.extend(given)
    assert moved.shape == mesh.points.shape
    assert moved[motion.moving] == pytest.approx(given, abs=1e-14)
    assert np.all(moved[np.unique(mesh.surfaces["z0"])] == 0.0)
    inside = np.setdiff1d(np.arange(mesh.n_nodes), np.unique([*mesh.surfaces["z0"], *mesh.surfaces["z1"]]))
    assert np.abs(moved[inside]).min() > 0.0


@pytest.mark.parametrize("cell", CELLS)
def test_a_top_that_moves_as_a_whole_stretches_the_body_evenly(cell: str) -> None:
    motion, mesh = extension(cell), brick(cell).bodies["brick"].mesh
    shift = np.array([0.3, -0.2, 0.1])
    moved = motion.extend(np.tile(shift, (len(motion.moving), 1)))
    assert moved == pytest.approx(mesh.points[:, 2:] / 1.5 * shift, abs=1e-13)


@pytest.mark.parametrize("cell", CELLS)
def test_pulling_back_is_the_transpose_of_extending(cell: str) -> None:
    motion, rng = extension(cell), np.random.default_rng(2)
    given = rng.standard_normal((len(motion.moving), 3))
    by_points = rng.standard_normal(brick(cell).bodies["brick"].mesh.points.shape)
    forth, back = np.sum(motion.extend(given) * by_points), np.sum(given * motion.pull_back(by_points))
    assert abs(forth) > 1.0
    assert back == pytest.approx(forth, rel=1e-12)


def test_components_do_not_mix() -> None:
    motion = extension("hexahedron")
    given = np.zeros((len(motion.moving), 3))
    given[:, 1] = 1.0
    moved = motion.extend(given)
    assert np.all(moved[:, [0, 2]] == 0.0)
    assert moved[:, 1].max() == 1.0


@pytest.mark.parametrize("stiffening", [0.0, 1.0, 2.0])
def test_cells_deform_as_much_as_their_volume_to_the_stiffening(stiffening: float) -> None:
    mesh = box_lattice([np.linspace(0.0, 1.0, 3), np.linspace(0.0, 1.0, 3), np.array([0.0, 1.0, 1.25, 1.5])])
    scene = Scene({"brick": Body(mesh, RUBBER)}, [Support("brick", "z0")])
    decomposition = decompose(scene, {"brick": box_partition(mesh, (2, 1, 1))}, MPI.COMM_SELF)
    top, bottom = (np.unique(mesh.surfaces[name]) for name in ("z1", "z0"))
    held = marks(scene.bodies["brick"], bottom)
    motion = MeshMotion(decomposition, "brick", scene.bodies["brick"], top, held, stiffening=stiffening)
    moved = motion.extend(np.tile([0.0, 0.0, 0.1], (len(top), 1)))[:, 2]
    levels = [moved[np.isclose(mesh.points[:, 2], z)] for z in (0.0, 1.0, 1.25, 1.5)]
    assert max(np.ptp(level) for level in levels) < 1e-13
    thick, thin, top_strain = np.diff([level[0] for level in levels]) / [1.0, 0.25, 0.25]
    assert thin == pytest.approx(top_strain)
    assert thick / thin == pytest.approx(4.0**stiffening)


def test_small_cells_on_a_crown_let_it_move_farther() -> None:
    links = chain_link(LinkShape(n_around=24, n_a=4, n_b=10, grading=2.5))
    scene = Scene({"link": Body(links.mesh, RUBBER)}, [Support("link", "grip")])
    decomposition = decompose(scene, {"link": box_partition(links.mesh, (2, 1, 1))}, MPI.COMM_SELF)
    design = SurfaceDesign("link", links.crown, (7, 4))
    motion = motion_of(decomposition, scene, design)
    even = MeshMotion(decomposition, "link", scene.bodies["link"], motion.moving, motion.held, stiffening=0.0)
    given = design.displacement(np.random.default_rng(3).uniform(-1.0, 1.0, 28))
    far, near = (largest(links.mesh, way.extend(given)) for way in (motion, even))
    assert far > 2.5 * near > 0.0


def largest(mesh: BodyMesh, moved: np.ndarray) -> float:
    """How often the displacement can be applied before a cell inverts."""
    steps = np.geomspace(0.01, 10.0, 100)
    sound = [bool(thickness(mesh.points + step * moved, mesh.cells).min() > 0.0) for step in steps]
    return float(steps[np.argmin(sound) - 1]) if not all(sound) else float(steps[-1])


def test_nodes_that_are_to_move_and_to_stay_are_refused() -> None:
    scene = brick("hexahedron")
    body = scene.bodies["brick"]
    decomposition = decompose(scene, {"brick": box_partition(body.mesh, (2, 1, 1))}, MPI.COMM_SELF)
    top, side = (np.unique(body.mesh.surfaces[name]) for name in ("z1", "x0"))
    with pytest.raises(
        InvalidInputError, match=r"4 nodes of body 'brick' lie on both: choose another surface"
    ):
        MeshMotion(decomposition, "brick", body, top, marks(body, side))


def test_a_chain_follows_its_crowns_and_stays_where_it_is_held_or_pulled() -> None:
    problem, links = chain_problem(None), crossed_links()
    points = problem.points_of(np.full(problem.size, 0.2))
    for design, link in zip(problem.designs, (links.first, links.second), strict=True):
        moved = points[design.body] - link.mesh.points
        grip = np.unique(link.mesh.surfaces["grip"])
        assert len(grip) > 10
        assert np.all(moved[grip] == 0.0)
        assert moved[link.crown.nodes] == pytest.approx(0.2 * link.crown.directions, abs=1e-12)
        assert np.all(
            moved[design.nodes_beyond_transition(link.mesh, np.zeros(link.mesh.points.shape, dtype=bool))]
            == 0.0
        )
        distance = np.linalg.norm(moved, axis=1)
        # Smooth: between the crown and what stays, nodes go part of the way.
        assert np.count_nonzero((distance > 0.01) & (distance < 0.19)) > 20
        assert distance.max() <= 0.2 + 1e-12


def test_a_plane_of_symmetry_holds_only_what_is_across_it() -> None:
    mesh = block((0.0, 0.0, 0.0), (2.0, 1.0, 1.5), (4, 3, 3))
    mesh = mesh.moved(mesh.points + 0.1 * (mesh.points[:, 2:] / 1.5) ** 2 * mesh.points[:, :1] * [0, 0, -1.0])
    sides = [Support("brick", "x0", (0.0, None, None)), Support("brick", "y0", (None, 0.0, None))]
    scene = Scene({"brick": Body(mesh, RUBBER)}, [*sides, Support("brick", "z0")])
    decomposition = decompose(scene, {"brick": box_partition(mesh, (2, 1, 1))}, MPI.COMM_SELF)
    geometry = DesignGeometry(scene, decomposition, [SurfaceDesign("brick", "z1", (3, 2), transition=2.0)])
    (design,) = geometry.designs
    alpha = 1.0 + np.random.default_rng(4).random(6)
    moved = geometry.points_of(0.1 * alpha)["brick"] - mesh.points
    on_x, on_y = (np.unique(mesh.surfaces[side]) for side in ("x0", "y0"))
    assert np.abs(moved[on_x, 0]).max() == np.abs(moved[on_y, 1]).max() == 0.0
    inner = np.setdiff1d(on_x, [*mesh.surfaces["z1"].ravel(), *mesh.surfaces["z0"].ravel()])
    assert np.abs(moved[inner, 2]).min() > 1e-3
    assert moved[design.lattice.nodes] == pytest.approx(design.displacement(0.1 * alpha), abs=1e-14)
    assert np.all(moved[np.unique(mesh.surfaces["z0"])] == 0.0)
    by_points = np.random.default_rng(5).standard_normal(mesh.points.shape)
    assert geometry.pull_back(by_points) @ alpha == pytest.approx(10.0 * np.sum(moved * by_points), rel=1e-12)
    with pytest.raises(InvalidInputError, match="16 nodes of that on 'brick' would leave it"):
        DesignGeometry(scene, decomposition, [SurfaceDesign("brick", "x0", (3, 2))])

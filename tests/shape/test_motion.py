"""The displacement of a surface is extended into the mesh, and derivatives are pulled back the same way."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact.errors import InvalidInputError
from fenics_contact.feti import decompose
from fenics_contact.gallery import block
from fenics_contact.partition import box_partition
from fenics_contact.scene import Body, Scene, Support
from fenics_contact.shape import HarmonicExtension, SurfaceDesign
from fenics_contact.shape.geometry import DesignGeometry
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


def extension(cell: str, held: str = "z0") -> HarmonicExtension:
    scene = brick(cell)
    body = scene.bodies["brick"]
    decomposition = decompose(scene, {"brick": box_partition(body.mesh, (2, 1, 1))}, MPI.COMM_SELF)
    top, bottom = (np.unique(body.mesh.surfaces[name]) for name in ("z1", held))
    return HarmonicExtension(decomposition, "brick", body, top, marks(body, np.setdiff1d(bottom, top)))


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


def test_nodes_that_are_to_move_and_to_stay_are_refused() -> None:
    scene = brick("hexahedron")
    body = scene.bodies["brick"]
    decomposition = decompose(scene, {"brick": box_partition(body.mesh, (2, 1, 1))}, MPI.COMM_SELF)
    top, side = (np.unique(body.mesh.surfaces[name]) for name in ("z1", "x0"))
    with pytest.raises(
        InvalidInputError, match=r"4 nodes of body 'brick' lie on both: choose another surface"
    ):
        HarmonicExtension(decomposition, "brick", body, top, marks(body, side))


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

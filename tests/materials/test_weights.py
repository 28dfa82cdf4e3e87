"""Weights and centrifugal forces of regions."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fenics_contact import Body, Scene, Support, box_partition, centrifugal, gravity, solve_scene
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import block
from fenics_contact.mesh.quality import cell_volumes
from tests.materials.bodies import bent, box, in_halves, steel
from tests.materials.elements import CELLS, load_by_node, whole
from tests.scenes import Load


@pytest.mark.parametrize("cell", CELLS)
def test_weights_of_regions_are_those_of_their_volumes(cell: str) -> None:
    """Each region has its own weight, and both with one density that of the whole body, node by node."""
    mesh = bent(in_halves(box(cell)))
    given = (0.5, -1.0, 2.0)[: mesh.dim]

    def nodal(*loads: Load) -> np.ndarray:
        return load_by_node(whole(Body(mesh, steel(mesh.dim)), loads))

    halves = [nodal(gravity("cell", 2.0, given, region=name)) for name in ("left", "right")]
    for name, half in zip(("left", "right"), halves, strict=True):
        volume = cell_volumes(mesh.points, mesh.cells)[mesh.regions[name]].sum()
        np.testing.assert_allclose(half.sum(axis=0), 2.0 * volume * np.array(given), rtol=1e-12)
        beyond = np.setdiff1d(np.arange(mesh.n_nodes), mesh.cells[mesh.regions[name]])
        assert len(beyond)
        assert not half[beyond].any()
    np.testing.assert_allclose(sum(halves), nodal(gravity("cell", 2.0, given)), atol=1e-14)
    turning = [centrifugal("cell", 2.0, 3.0, given, region=name) for name in (None, "left", "right")]
    every, *parts = map(nodal, turning)
    np.testing.assert_allclose(sum(parts), every, atol=1e-13 * np.abs(every).max())


def test_weights_of_regions_in_subdomains_with_one_of_them_or_both() -> None:
    mesh = in_halves(block((0, 0, 0), (2, 1, 1), (6, 2, 2)))
    body = Body(mesh, steel(3))
    loads = [gravity("body", density, (0, 1, -10), name) for name, density in (("left", 0.1), ("right", 0.4))]
    scene = Scene({"body": body}, [Support("body", "x0")], loads)

    def moved(boxes: tuple[int, int, int]) -> np.ndarray:
        pieces = {"body": box_partition(mesh, boxes)}
        return solve_scene(scene, MPI.COMM_SELF, partitions=pieces, tolerance=1e-12).gather_displacement(
            "body"
        )

    one = moved((1, 1, 1))
    np.testing.assert_allclose(moved((3, 1, 2)), one, atol=1e-8 * np.abs(one).max())


def test_a_load_on_a_region_that_is_not_there_is_refused() -> None:
    mesh = in_halves(box("hexahedron"))
    with pytest.raises(
        InvalidInputError, match=r"names region 'top' of body 'cell', whose mesh has \['left'"
    ):
        Scene({"cell": Body(mesh, steel(3))}, loads=[gravity("cell", 1.0, (0, 0, -1), "top")])

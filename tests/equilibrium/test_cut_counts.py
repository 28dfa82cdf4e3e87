"""The default cut needs about as few products as the best boxes, METIS's not many more."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.cases.scenes import block_mesh, block_on_plane
from benchmarks.graph_partition import graph_partition
from fenics_contact import BodyMesh, Scene, box_partition, solve_scene
from fenics_contact.gallery import LinkShape, two_links
from fenics_contact.mesh.bisection import default_partition
from fenics_contact.qp import FaceNewton
from fenics_contact.study.scenes.chain_links import chain

pytestmark = pytest.mark.slow

#: Of the products of the best boxes, as many as there are subdomains; METIS's boundaries are never plane.
DEFAULT, METIS, METIS_GRADED = 1.15, 1.6, 2.2


def links(counts: tuple[int, int, int], grading: float) -> Scene:
    around, through, across = counts
    shape = LinkShape(n_around=around, n_a=through, n_b=across, grading=grading)
    return chain(two_links(shape))


def products(scene: Scene, cut: Callable[[BodyMesh], np.ndarray]) -> int:
    parts: Mapping[str, np.ndarray] = {name: cut(body.mesh) for name, body in scene.bodies.items()}
    state = solve_scene(scene, MPI.COMM_SELF, partitions=parts, solver=FaceNewton(tolerance=1e-6))
    return state.dual.products


def compared(scene: Scene, nodes: float | None, boxes: list[tuple[int, int, int]]) -> tuple[float, float]:
    """Return the products of the default and of METIS's cut over those of the best boxes."""
    best = min(products(scene, lambda mesh, each=each: box_partition(mesh, each)) for each in boxes)
    default = products(scene, lambda mesh: default_partition(mesh, nodes=nodes))
    parts = int(np.prod(boxes[0]))
    metis = products(scene, lambda mesh: graph_partition(mesh, parts))
    return default / best, metis / best


BOXES = {
    "equal cells": (0.0, [(12, 1, 1), (6, 1, 2), (6, 2, 1)]),
    "graded cells": (2.5, [(12, 1, 1), (6, 1, 2), (6, 2, 1)]),
}


@pytest.mark.parametrize("cells", BOXES)
def test_links_need_as_few_products_as_in_the_best_boxes(cells: str) -> None:
    grading, boxes = BOXES[cells]
    default, metis = compared(links((36, 4, 10), grading), 6.0**3, boxes)
    assert default <= DEFAULT
    assert metis <= (METIS_GRADED if grading else METIS)


@pytest.mark.claim
def test_graded_links_of_the_published_size_need_fewer_products_than_in_boxes() -> None:
    default, metis = compared(links((48, 8, 20), 2.5), None, [(16, 1, 1), (8, 1, 2)])
    assert default <= 1.0
    assert metis <= METIS_GRADED


@pytest.mark.claim
def test_a_block_needs_as_few_products_as_in_the_best_boxes() -> None:
    scene = block_on_plane(block_mesh((24, 12, 12)), 0.3)
    default, metis = compared(scene, 7.0**3, [(4, 2, 2)])
    assert default <= DEFAULT
    assert metis <= METIS

"""Cuts of a structured mesh into equal boxes of cells, of which many are alike.

Subdomains of the same shape share their factors, and products with their matrices are made for all of them at
once. Halving 50 cells again and again gives pieces of 12 and 13, and boxes of 5 or 10 cells are equal.
"""

from __future__ import annotations

import numpy as np

from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.faces import vector_areas
from fenics_contact.mesh.partition import box_partition, face_areas
from fenics_contact.mesh.quality import cell_volumes


def equal_boxes(
    mesh: BodyMesh,
    target: int,
    least: int,
    faces: tuple[np.ndarray, np.ndarray] | None = None,
    *,
    members: int = 8,
    near: float = 1.6,
    size: float = 0.35,
    uneven: float = 0.08,
    slender: float = 1.1,
    longest: float = 1.5,
) -> np.ndarray | None:
    """Cut a structured mesh into boxes of cells, if enough of them have the same shape, else return None.

    Of the numbers of boxes along the directions those are taken for which

        c · exp(size · |ln(n / target)| + uneven · m),   c = surfaces of all / (2d n^(1/d) volume^(1 − 1/d))

    is least: compact ones (cubes have c = 1, boxes of 2 : 2 : 1 have 1.06), of a size that is suitable, and
    equal; m counts the directions in which they differ by a layer of cells. `members`: how many boxes there
    must be for each shape; `near`: factor by which the number of boxes may miss the target; `slender`:
    largest c; `longest`: largest second moment of any box, relative to that of a cube of its volume (2 : 1 :
    1 has 1.26): where cells are graded, boxes of as many cells are long somewhere.
    """
    first, last = max(least, members, target / near), near * target
    if mesh.grid is None or mesh.hanging or mesh.cuts or first > last:
        return None
    counts = mesh.grid.max(axis=0) + 1
    if len(np.unique(np.ravel_multi_index(tuple(mesh.grid.T), tuple(counts)))) < counts.prod():
        return None
    crossed, surface = _areas(mesh, mesh.grid, counts, *(faces or face_areas(mesh)))
    n, differing = np.ones(1), np.zeros(1)
    along = []
    for count, areas in zip(counts, crossed, strict=True):
        along.append(np.unique(-(-count // np.arange(1, count + 1))))
        cut = np.array([areas[_ends(count, boxes)].sum() for boxes in along[-1]])
        n = n[..., None] * along[-1]
        surface = surface[..., None] + 2.0 * cut
        differing = differing[..., None] + (count % along[-1] > 0)
    volumes = cell_volumes(mesh.points, mesh.cells)
    volume = float(volumes.sum())
    c = surface / (2.0 * mesh.dim * n ** (1.0 / mesh.dim) * volume ** (1.0 - 1.0 / mesh.dim))
    cost = c * np.exp(size * np.abs(np.log(n / target)) + uneven * differing)
    cost[(n < first) | (n > last) | (c > slender) | (n < members * (1.0 + differing))] = np.inf
    # The first of those that rounding makes different.
    best = np.unravel_index(np.argmax(cost <= 1.000001 * cost.min()), cost.shape)
    if np.isinf(cost[best]):
        return None
    boxes = tuple(int(along[d][k]) for d, k in enumerate(best[1:]))
    partition = box_partition(mesh, boxes)
    shapes, length = _shapes(mesh, partition, volumes)
    return partition if np.prod(boxes) >= members * shapes and length <= longest else None


def _ends(count: int, boxes: int) -> np.ndarray:
    """Return the last layers of cells of the boxes along one direction; none if there is one box."""
    box = np.append(np.arange(count) * boxes // count, boxes)
    return np.flatnonzero(np.diff(box)) if boxes > 1 else np.zeros(0, dtype=np.int64)


def _areas(
    mesh: BodyMesh, grid: np.ndarray, counts: np.ndarray, pairs: np.ndarray, areas: np.ndarray
) -> tuple[list[np.ndarray], np.ndarray]:
    """Return the areas of faces behind each layer of cells in every direction, and of the boundary, (1,)."""
    first, other = np.sort(grid[pairs], axis=1).transpose(1, 0, 2)
    crossed = []
    for d, count in enumerate(counts):
        across = np.flatnonzero(other[:, d] > first[:, d])
        # Where the grid closes on itself, the last layer has the first one behind it.
        closing = other[across, d] - first[across, d] > 1
        crossed.append(np.bincount(np.where(closing, count - 1, first[across, d]), areas[across], count))
    outside = vector_areas(mesh.points, mesh.boundary[0])
    return crossed, np.linalg.norm(outside, axis=1).sum(keepdims=True)


def _shapes(mesh: BodyMesh, partition: np.ndarray, volumes: np.ndarray, places: int = 6) -> tuple[int, float]:
    """Return how many shapes subdomains have up to rotations and mirrors, and the largest second moment.

    Shapes are distinguished by volume and principal moments; that of a cube of the same volume is one.
    """
    centres = mesh.points[mesh.cells].mean(axis=1)
    whole = np.bincount(partition, volumes)
    middle = np.stack([np.bincount(partition, volumes * x) / whole for x in centres.T], axis=1)
    arms = centres - middle[partition]
    moments = np.array([[np.bincount(partition, volumes * x * y) for y in arms.T] for x in arms.T])
    principal = np.linalg.eigvalsh(moments.transpose(2, 0, 1))
    largest, power = whole.max(), 1.0 + 2.0 / mesh.dim
    known = np.column_stack([whole / largest, principal / largest**power])
    moment = 12.0 / mesh.dim * principal.sum(axis=1) / whole**power
    return len(np.unique(np.round(known, places) + 0.0, axis=0)), float(moment.max())

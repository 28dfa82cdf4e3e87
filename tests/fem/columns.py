"""Columns of cells that are no boxes, whose centres follow the other nodes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact import BodyMesh
from fenics_contact.gallery import block, rectangle
from fenics_contact.mesh import quadratic, serendipity


def bent(mesh: BodyMesh) -> BodyMesh:
    """A column whose cells are no boxes, with its last corner as node set "tip"; its centres follow."""
    points, height = mesh.points.copy(), mesh.points[:, -1]
    points[:, 0] += 0.1 * np.sin(2 * height) * (height < 3)
    if mesh.dim == 3:
        points[:, 1] *= 1 + 0.2 * height * (3 - height)
    tip = np.flatnonzero((mesh.points == mesh.points.max(axis=0)).all(axis=1))
    return serendipity(quadratic(replace(mesh, points=points, grid=None, node_sets={"tip": tip})))


COLUMN = bent(block((0, 0, 0), (1, 1, 3), (1, 1, 3)))
STRIP = bent(rectangle((1, 0), (2, 3), (1, 3)))

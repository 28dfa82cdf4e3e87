"""Contact points of bodies of revolution that may twist: they can slip around the axis, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact._pairing.points import ContactPoints
from fenics_contact._scene.scene import Scene


def with_turn(points: ContactPoints, scene: Scene) -> ContactPoints:
    """Return points of a section with a third component of vectors, around the axis.

    Normals lie in the section. The second tangent points around the axis; with the first and the normal it is
    right-handed in space. On the axis nothing slips around it.
    """
    on_axis = np.concatenate([body.on_axis for body in scene.bodies.values()])[points.slave]
    across = ((0, 0), (0, 1))
    around = np.broadcast_to([0.0, 0.0, 1.0], (points.count, 1, 3))
    return replace(
        points,
        normal=np.pad(points.normal, across),
        tangents=np.concatenate([np.pad(points.tangents, ((0, 0), *across)), around], axis=1),
        axes=np.pad(points.axes, across),
        symmetric=np.column_stack([points.symmetric, on_axis]),
        oblique_normals=np.pad(points.oblique_normals, ((0, 0), *across)),
    )

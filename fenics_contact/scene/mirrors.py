"""Planes of symmetry: flat sides on rollers, beyond which the body continues as its mirror image."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fenics_contact.mesh import vector_areas
from fenics_contact.scene.rigid_surfaces import RigidSurface

if TYPE_CHECKING:
    from fenics_contact.scene.parts import SceneParts

#: A facet is normal to an axis if the cosine of its normal differs from one by no more than this.
ACROSS = 1e-9


def mirrored(scene: SceneParts, body: str) -> np.ndarray:
    """Return which nodes of a body lie on a plane of symmetry normal to each axis, shape (n_nodes, dim).

    A plane of symmetry is a flat side normal to an axis on which a support prescribes only that component.
    """
    mesh = scene.bodies[body].mesh
    marks = np.zeros(mesh.points.shape, dtype=bool)
    for support in scene.supports:
        if isinstance(support, RigidSurface):
            continue
        given = [axis for axis, value in enumerate(support.value) if value is not None]
        if support.body != body or len(given) != 1 or callable(support.value[given[0]]):
            continue
        facets = mesh.surfaces[support.surface]
        areas = vector_areas(mesh.points, facets)
        across = np.abs(areas[:, given[0]]) >= (1.0 - ACROSS) * np.linalg.norm(areas, axis=1)
        marks[facets[across].ravel(), given[0]] = True
    return marks

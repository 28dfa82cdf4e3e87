"""Designs on refined meshes: the same functions of their variables."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fenics_contact._adaptive.refined_scene import SceneRefinement, refine_scene
from fenics_contact._base.sparse import LAST_PLACES
from fenics_contact._equilibrium.starts import interpolated
from fenics_contact._scene.scene import Scene
from fenics_contact.design.design import SurfaceDesign
from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery.links import DesignSurface
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.mesh.cell_types import CELL_TYPES
from fenics_contact.mesh.refinement import Refinement


def refined_for_designs(scene: Scene, marked: Mapping[str, np.ndarray]) -> SceneRefinement:
    """Refine the reference shape of designs.

    Bodies of quadrilaterals and hexahedra with a marked cell are halved everywhere: designs cannot move
    hanging nodes.
    """
    whole = {
        name: cells if CELL_TYPES[mesh.cell_type].is_simplex else np.arange(mesh.n_cells)
        for name, cells in marked.items()
        for mesh in (scene.bodies[name].mesh,)
    }
    return refine_scene(scene, whole)


def refined_design(
    design: SurfaceDesign, before: BodyMesh, refinement: Refinement | None, after: BodyMesh
) -> SurfaceDesign:
    """Return a design on a refined mesh: old nodes move as they did, new ones as the surface between them.

    Parameters and directions of new nodes are interpolated by the shape functions of their coarse facets, so
    that a variable moves the surface along the same normals by the same polynomial of the same parameters.
    """
    if refinement is None:
        return design
    lattice, dim = design.lattice, before.dim
    nodal = np.zeros((before.n_nodes, 2 * dim))
    nodal[lattice.nodes] = np.hstack(
        [np.ones((len(lattice.nodes), 1)), lattice.parameters, lattice.directions]
    )
    values = interpolated(before, refinement, after, nodal)
    facets, _ = after.boundary
    inside = np.abs(values[:, 0] - 1.0) < 1e-9  # sums of shape functions: 1 up to rounding, or away from it
    nodes = np.unique(facets[inside[facets].all(axis=1)])
    parameters, directions = np.split(values[nodes, 1:], [dim - 1], axis=1)
    order = np.lexsort(parameters.round(9).T[::-1])
    lengths = np.linalg.norm(directions, axis=1)
    if not (lengths > LAST_PLACES).all():
        raise InvalidInputError(
            f"a design on {design.body!r} needs directions that turn by less than half a turn from node to "
            "node, so that there is one between them: give it more nodes there, or finer cells"
        )
    counts = tuple(len(np.unique(column.round(9))) for column in parameters.T)
    surface = DesignSurface(nodes[order], parameters[order], (directions / lengths[:, None])[order], counts)
    return SurfaceDesign(design.body, surface, design.net, design.transition)

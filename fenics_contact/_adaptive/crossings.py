"""Places of plane bodies where stiff and soft materials cross, which need far smaller cells than others."""

from __future__ import annotations

import numpy as np

from fenics_contact._adaptive.refined_scene import SceneRefinement, refine_scene
from fenics_contact._scene.body import Body
from fenics_contact.materials.elastic import isotropic_constants
from fenics_contact.mesh.cell_types import CELL_TYPES


def refined_at_crossings(found: SceneRefinement, halvings: int = 3) -> SceneRefinement:
    """Halve the cells around the crossings of plane bodies some more times.

    Displacements at a crossing grow with a small power α of the distance, by Young's moduli 100:1 with about
    0.15, and halving the cells there leaves 2^(−2α) of the error, four fifths. Estimates see little of it,
    as stresses next to it are even: where cells became smaller at the rate of others, what `solve_to` stated
    was half of the error. A crossing is a node, and these cells are few.

    `found`: the meshes; `halvings`: how often the cells around crossings are halved.
    """
    for _ in range(halvings):
        around = {name: around_crossings(body) for name, body in found.scene.deforming.items()}
        marked = {name: cells for name, cells in around.items() if len(cells)}
        if not marked:
            break
        found = refine_scene(found.scene, marked).after(found)
    return found


def around_crossings(body: Body, contrast: float = 10.0, least: int = 4, finest: float = 1e-7) -> np.ndarray:
    """Return the cells around nodes of a plane body in which stiff and soft materials cross.

    None of bodies in space, where they lie on lines, of anisotropic or nonlinear materials, or of quadratic
    quadrilaterals, which are halved all together.

    `contrast`: ratio of Young's moduli on both sides of an edge; `least`: number of such edges that meet in a
    crossing; `finest`: width of cells that are not halved any more, relative to the body.
    """
    mesh, kind = body.mesh, CELL_TYPES[body.mesh.cell_type]
    constants = [isotropic_constants(material) for material in body.materials]
    local = mesh.order == 1 or kind.is_simplex
    if mesh.dim != 2 or len(constants) < 2 or None in constants or not local:
        return np.zeros(0, dtype=np.int64)
    stiffness = np.array([each[0] for each in constants if each is not None])[body.material_of_cells]
    edges = np.sort(mesh.cells[:, [face[:2] for face in kind.faces]].reshape(-1, 2), axis=1)
    order, cell = np.lexsort(edges.T), np.repeat(np.arange(mesh.n_cells), len(kind.faces))
    shared = np.flatnonzero((edges[order][1:] == edges[order][:-1]).all(axis=1))
    one, other = (stiffness[cell[order[shared + k]]] for k in (0, 1))
    between = shared[np.maximum(one, other) >= contrast * np.minimum(one, other)]
    crosses = np.bincount(edges[order[between]].ravel(), minlength=mesh.n_nodes) >= least
    width = np.ptp(mesh.points[mesh.cells], axis=1).max(axis=1)
    large = width > finest * np.ptp(mesh.points, axis=0).max()
    return np.flatnonzero(crosses[mesh.cells].any(axis=1) & large)

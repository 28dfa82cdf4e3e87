"""Typical nodal stiffness of cells, for weighting stiff and soft neighbours."""

from __future__ import annotations

import numpy as np

from fenics_contact.fem.forms import FormLibrary
from fenics_contact.scene import Scene


def cell_stiffness(scene: Scene, forms: FormLibrary) -> dict[str, np.ndarray]:
    """Return a typical nodal stiffness of every cell of every body, [force / length].

    It is a material's stiffness on a unit cell, times the mean cell size of the body: within a body of one
    material it is the same everywhere.

    Args:
        scene: The scene.
        forms: Its prepared forms.
    """
    stiffness = {}
    for name, body in scene.bodies.items():
        size = (body.mesh.volume / body.mesh.n_cells) ** (1.0 / scene.dim)
        cell_type = body.mesh.cell_type
        moduli = np.array([forms.typical_modulus(material, cell_type) for material in body.materials])
        stiffness[name] = moduli[body.material_of_cells] * size ** (scene.dim - 2)
    return stiffness

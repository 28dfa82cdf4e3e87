"""Where a mesh is too coarse for the stresses of a state, of any material: an indicator, no error."""

from __future__ import annotations

import numpy as np

from fenics_contact.mesh.quality import cell_volumes
from fenics_contact.results.state import State


def stress_indicator(state: State, name: str) -> np.ndarray:
    """Return √∫ |σ* − σ|² dx over each cell of a body, shape (n_cells,), replicated. Collective.

    σ is the mean stress of the cell, σ* the mean at its nodes over the cells of its material around them. It
    falls with the size of the cells where stresses are smooth, and says nothing of how a quantity depends on
    them. Of quadratic cells, within which the stress varies, it is larger than of linear ones.

    References:
        O. C. Zienkiewicz, J. Z. Zhu, A simple error estimator and adaptive procedure for practical
        engineering analysis, Int. J. Numer. Meth. Engng 24 (1987) 337-357.
    """
    body = state.scene.bodies[name]
    own, nodal = state.gather_stress(name), state.gather_nodal_stress(name)
    cells = body.mesh.cells
    missed = nodal[body.material_of_cells[:, None], cells] - own[:, None]
    squares = np.einsum("cnij,cnij->c", missed, missed) / cells.shape[1]
    return np.asarray(np.sqrt(cell_volumes(body.mesh.points, cells) * squares))

"""Shape functions of displacements on facets and on linear pieces of them, and their reverse mode.

A quadratic facet is cut into linear pieces between its nodes. On them both surfaces are clipped, and the dual
functions are those of the piecewise linear functions of the nodes: all multipliers have positive areas, and
their cones are independent of each other. Displacements are those of the whole facet, so that a uniform
pressure makes the nodal forces that it has in the bodies. Popp et al. transform the quadratic functions
instead, so that they have positive means; their dual functions reach over whole facets. Triangles and
quadrilaterals of one surface are cut into triangles in the same way.

References:
    Popp, A., Wohlmuth, B. I., Gee, M. W., Wall, W. A.: Dual quadratic mortar finite element methods for 3D
    finite deformation contact. SIAM Journal on Scientific Computing 34 (2012).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact._pairing.mortar.cells import Cells
from fenics_contact._surfaces.facets import FacetedSurface, shape_functions


def trace_slopes(surface: FacetedSurface, facet: np.ndarray, local: np.ndarray) -> np.ndarray:
    """Return the derivatives of `Uncut.functions` by local coordinates of pieces, (n, q, nodes, dim − 1).

    `facet`: facet of each group of points, shape (n,); `local`: coordinates on it, shape (n, q, dim − 1).
    """
    count, points, width = local.shape
    values, slopes = shape_functions(local.reshape(-1, width), surface.corners)
    slopes = surface.cut.gradients(np.repeat(facet, points), values, slopes)
    return np.asarray(slopes.reshape(count, points, -1, width))


@dataclass(frozen=True)
class Traces:
    """The functions that are integrated with the dual functions over pairs of facets.

    Attributes:
        slave: Nodes of the slave in its mean at each pair, none where that is the node alone, (n_pairs, k).
        master: Nodes of the master, shape (n_pairs, m).
        functions: Shape functions of the master, then those of the slave, at the quadrature points of the
            cells, shape (n, q, m + k).
    """

    slave: np.ndarray
    master: np.ndarray
    functions: np.ndarray

    @classmethod
    def of(
        cls,
        cells: Cells,
        surfaces: tuple[FacetedSurface, FacetedSurface],
        pairs: tuple[np.ndarray, np.ndarray],
    ) -> Traces:
        """Evaluate the functions on cells.

        `pairs`: slave facet and master facet of each pair, shape (n_pairs,) each.
        """
        (slave, master), (here, there) = surfaces, pairs
        opposite = master.cut.functions(there[cells.pair], cells.master)
        own = slave.cut.mean_functions(here[cells.pair], cells.slave)
        nodes = slave.cut.mean_nodes(slave.facets, here), master.cut.nodes(master.facets, there)
        return cls(*nodes, np.concatenate([opposite, own], axis=2))

    def pulled_back(
        self,
        cells: Cells,
        surfaces: tuple[FacetedSurface, FacetedSurface],
        pairs: tuple[np.ndarray, np.ndarray],
        by: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Vector-Jacobian product of the functions with respect to the cells' linear ones of both surfaces.

        `by`: derivative by the functions, in their shape.

        Derivatives by ``cells.slave`` and ``cells.master``, in their shapes.
        """
        (slave, master), (here, there) = surfaces, pairs
        width = self.master.shape[1]
        at_master = master.cut.pulled_back(there[cells.pair], cells.master, by[:, :, :width])
        at_slave = slave.cut.means_pulled_back(here[cells.pair], cells.slave, by[:, :, width:])
        return at_slave, at_master

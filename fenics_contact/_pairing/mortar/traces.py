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
from fenics_contact._surfaces.pieces import (
    shape_weight_gradients,
    shape_weights,
    shape_weights_pulled_back,
    whole_nodes,
)


def trace_nodes(surface: FacetedSurface, facet: np.ndarray) -> np.ndarray:
    """Return the nodes whose displacements move facets, or pieces of them, shape (n, nodes)."""
    if surface.whole is None:
        return np.asarray(surface.facets[facet])
    return whole_nodes(surface, facet)


def trace_functions(surface: FacetedSurface, facet: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the shape functions of displacements at points of pieces, shape (n, q, nodes).

    `facet`: facet of each group of points, shape (n,); `values`: its linear shape functions, shape (n, q,
    corners).
    """
    if surface.whole is None:
        return values
    count, points, corners = values.shape
    at_points = np.repeat(facet, points), values.reshape(count * points, corners)
    _, functions = shape_weights(surface, *at_points)
    return functions.reshape(count, points, functions.shape[1])


def trace_functions_pulled_back(
    surface: FacetedSurface, facet: np.ndarray, values: np.ndarray, by: np.ndarray
) -> np.ndarray:
    """Vector-Jacobian product of `trace_functions` with respect to the linear ones, in their shape."""
    if surface.whole is None:
        return by
    count, points, corners = values.shape
    at_points = np.repeat(facet, points), values.reshape(count * points, corners)
    by = by.reshape(count * points, by.shape[2])
    return shape_weights_pulled_back(surface, *at_points, by).reshape(values.shape)


def trace_slopes(surface: FacetedSurface, facet: np.ndarray, local: np.ndarray) -> np.ndarray:
    """Return the derivatives of `trace_functions` by local coordinates of pieces, (n, q, nodes, dim − 1).

    `facet`: facet of each group of points, shape (n,); `local`: coordinates on it, shape (n, q, dim − 1).
    """
    count, points, width = local.shape
    values, slopes = shape_functions(local.reshape(-1, width), surface.corners)
    if surface.whole is not None:
        slopes = shape_weight_gradients(surface, np.repeat(facet, points), values, slopes)
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
        opposite = trace_functions(master, there[cells.pair], cells.master)
        if slave.whole is None:
            return cls(np.zeros((len(here), 0), dtype=np.int64), trace_nodes(master, there), opposite)
        own = trace_functions(slave, here[cells.pair], cells.slave)
        functions = np.concatenate([opposite, own], axis=2)
        return cls(trace_nodes(slave, here), trace_nodes(master, there), functions)

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
        at_master = trace_functions_pulled_back(master, there[cells.pair], cells.master, by[:, :, :width])
        if slave.whole is None:
            return np.zeros_like(cells.slave), at_master
        at_slave = trace_functions_pulled_back(slave, here[cells.pair], cells.slave, by[:, :, width:])
        return at_slave, at_master

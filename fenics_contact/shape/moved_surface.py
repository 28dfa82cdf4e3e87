"""The surface that a design moves as a smooth function of the net's parameters."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import Any

import numpy as np
from scipy.interpolate import RectBivariateSpline, make_interp_spline

from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.mesh import BodyMesh
from fenics_contact.shape.bernstein import tensor_bernstein
from fenics_contact.shape.design import SurfaceDesign
from fenics_contact.surface_shapes import SurfaceShape, tensor_grid
from fenics_contact.surfaces import height_over


@displayed
@dataclass(frozen=True, eq=False)
class MovedSurface:
    """X(s, t) + w(s, t) n(s, t), at the nodes exactly where the design moves them, and smooth between them.

    X is a cubic spline through the nodes, moved onto the true shape of the surface where the mesh knows it; n
    are the nodes' unit directions, interpolated likewise, and w is the design's Bernstein polynomial.

    Attributes:
        design: The design, with its nodes (`SurfaceDesign.on`), as in ``problem.designs``.
        mesh: The body in its reference shape.
        alpha: Variables of this design, shape (size,), [length].

    Raises:
        InvalidInputError: If alpha has another size, or the nodes do not form a grid in the parameters.

    Example:
        >>> from fenics_contact.gallery import block, side_of
        >>> mesh = block((0, 0, 0), (4, 2, 1), (8, 4, 2))
        >>> lid = MovedSurface(SurfaceDesign("lid", side_of(mesh, "z1"), (2, 1)), mesh, np.array([0.0, 0.2]))
        >>> lid.after(np.array([[0.5, 0.5]])).round(6)
        array([[2. , 1. , 1.1]])
    """

    design: SurfaceDesign
    mesh: BodyMesh
    alpha: np.ndarray

    def __post_init__(self) -> None:
        """Check the variables and the nodes' parameters."""
        if np.shape(self.alpha) != (self.design.size,):
            raise InvalidInputError(
                f"the variables of the design on {self.design.body!r} must have shape ({self.design.size},), "
                f"got {np.shape(self.alpha)}: give its part of alpha"
            )
        counts = self.design.lattice.counts
        grid = tensor_grid(self.ticks)
        rising = all((np.diff(ticks) > 0).all() for ticks in self.ticks)
        if not rising or not np.allclose(grid, self.design.lattice.parameters, rtol=0.0, atol=1e-9):
            raise InvalidInputError(
                f"the nodes of a design on {self.design.body!r} must form a grid in its parameters, "
                f"{counts} nodes with rising parameters, got others: list them with s running slowest"
            )

    def _facts(self) -> dict[str, Any]:
        return {"body": self.design.body, "nodes": self.design.lattice.counts, "alpha": self.alpha}

    @property
    def parameters(self) -> np.ndarray:
        """Parameters of the nodes, shape (n_nodes, dim − 1)."""
        return self.design.lattice.parameters

    @cached_property
    def ticks(self) -> tuple[np.ndarray, ...]:
        """Parameters of the nodes along each direction, ascending."""
        lattice = self.design.lattice
        strides = [prod(lattice.counts[k + 1 :]) for k in range(len(lattice.counts))]
        return tuple(
            lattice.parameters[: count * stride : stride, k]
            for k, (count, stride) in enumerate(zip(lattice.counts, strides, strict=True))
        )

    def movement(self, parameters: np.ndarray) -> np.ndarray:
        """Return w at parameters of shape (n, dim − 1), shape (n,), [length]."""
        return np.asarray(tensor_bernstein(parameters, self.design.counts) @ self.alpha)

    def directions(self, parameters: np.ndarray) -> np.ndarray:
        """Return n at parameters of shape (n, dim − 1), shape (n, dim)."""
        vectors = self._interpolated(self.design.lattice.directions, parameters)
        return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, None])

    def before(self, parameters: np.ndarray) -> np.ndarray:
        """Return X at parameters of shape (n, dim − 1), shape (n, dim), [length]."""
        nodes = self.mesh.points[self.design.lattice.nodes]
        points = self._interpolated(nodes, parameters)
        if self.shape is None:
            return points
        directions = self.directions(parameters)
        off_nodes = height_over(nodes, self.design.lattice.directions, self.shape)[:, None]
        above = height_over(points, directions, self.shape)[:, None]
        return np.asarray(points + (above - self._interpolated(off_nodes, parameters)) * directions)

    def after(self, parameters: np.ndarray) -> np.ndarray:
        """Return X + w n at parameters of shape (n, dim − 1), shape (n, dim), [length]."""
        return self.before(parameters) + self.movement(parameters)[:, None] * self.directions(parameters)

    @cached_property
    def shape(self) -> SurfaceShape | None:
        """The true shape of the mesh's surface that has all nodes of the design, None if it is not known."""
        nodes, mesh = self.design.lattice.nodes, self.mesh.origin
        for name, shape in mesh.shapes.items():
            if np.isin(nodes, mesh.surfaces[name]).all():
                return shape
        return None

    def _interpolated(self, values: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Return values of the nodes, shape (n_nodes, m), between them."""
        degrees = [min(3, len(ticks) - 1) for ticks in self.ticks]
        if len(self.ticks) == 1:
            return np.asarray(make_interp_spline(self.ticks[0], values, k=degrees[0])(parameters[:, 0]))
        grid, (kx, ky) = values.reshape(*self.design.lattice.counts, -1), degrees
        columns = np.moveaxis(grid, 2, 0)
        splines = (RectBivariateSpline(*self.ticks, column, kx=kx, ky=ky, s=0) for column in columns)
        return np.stack([spline.ev(*parameters.T) for spline in splines], axis=1)

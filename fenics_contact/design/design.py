"""Design variables: control points that move a surface, or a curve of a plane body, along its normals."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import prod
from typing import Any

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import comb

from fenics_contact._base.display import counted, displayed
from fenics_contact._base.fingerprint import described, require_alike
from fenics_contact._base.libraries import MPI
from fenics_contact._base.sparse import LAST_PLACES
from fenics_contact._scene.parts import mirrored, planes_of
from fenics_contact._scene.scene import Scene
from fenics_contact._surfaces.facets import within_planes
from fenics_contact._surfaces.true_surface import height_over
from fenics_contact.errors import InvalidInputError, together
from fenics_contact.gallery.links import DesignSurface
from fenics_contact.gallery.side import side_of
from fenics_contact.mesh.body_mesh import BodyMesh
from fenics_contact.shapes.parametric import tensor_grid
from fenics_contact.shapes.simple import SurfaceShape


def bernstein(parameters: np.ndarray, count: int) -> np.ndarray:
    """Evaluate all Bernstein polynomials of degree count − 1, B_k(t) = C(n,k) t^k (1 − t)^(n − k)."""
    k = np.arange(count)
    t = parameters[:, None]
    return comb(count - 1, k) * t**k * (1 - t) ** (count - 1 - k)


def tensor_bernstein(parameters: np.ndarray, counts: tuple[int, ...]) -> np.ndarray:
    """Evaluate products B_k(s) B_l(t), on a curve B_k(s).

    Returns values, shape (m, product of the counts); l runs fastest.
    """
    values = np.ones((len(parameters), 1))
    for along, count in zip(parameters.T, counts, strict=True):
        values = (values[:, :, None] * bernstein(along, count)[:, None]).reshape(len(parameters), -1)
    return values


#: Default width of the transition strip, relative to the extent of the design surface.
TRANSITION = 0.15
#: Parameters of a design surface to what a net on it needs, in words, and to one such net.
_KINDS = {1: "a curve in the plane is a number of control points", 2: "a surface is a pair of numbers"}
_NETS: dict[int, int | tuple[int, int]] = {1: 7, 2: (7, 4)}
#: Distance from the surface, relative to its extent, beyond which nothing moves: behind a fixed boundary the
#: displacement has decayed there.
FAR = 0.4


@displayed
@dataclass(frozen=True, eq=False)
class SurfaceDesign:
    """A net of control points over a design surface; each moves along the surface's normals.

    Design variable k displaces the surface by B_k(s, t) times the outward unit normal of the reference
    surface, B_k a tensor-product Bernstein polynomial. α = 0 is the reference shape, positive α adds
    material. In plane scenes the surface is a curve, moved by B_k(s).

    Attributes:
        body: Name of the body.
        surface: Nodes of the surface, their parameters and directions; or the name of a side of a structured
            mesh, in the plane of any open curve, see `gallery.side_of`.
        net: Number of control points along s and t; of a curve in the plane, which has no default, along s.
        transition: Width of the strip of boundary around the surface that follows it smoothly; the rest of
            the boundary is fixed, [length]. By default 0.15 times the extent of the surface. Inner nodes far
            from the surface are fixed, too.
    """

    body: str
    surface: DesignSurface | str
    net: int | tuple[int, int] = (7, 4)
    transition: float | None = None

    def __post_init__(self) -> None:
        """Reject a net without points or with more points than the surface has nodes."""
        if min(self.counts) < 1:
            raise InvalidInputError(
                f"a net needs control points each way, got {self.net}: try (7, 4), for a curve in the plane 7"
            )
        if isinstance(self.surface, str):
            return  # its nodes are counted once it is `on` a scene
        nodes, number = self.lattice.counts, len(self.lattice.counts)
        if len(self.counts) != number:
            raise InvalidInputError(
                f"a net on {_KINDS[number]}, got {self.net} on {self.body!r}: give net={_NETS[number]}"
            )
        if any(points > most for points, most in zip(self.counts, nodes, strict=True)):
            raise InvalidInputError(
                f"a net {self.net} needs as many nodes each way, got {nodes}: use fewer points or finer cells"
            )

    def on(self, scene: Scene) -> SurfaceDesign:
        """Return the design with the nodes of its surface, where that is given by name.

        Raises:
            InvalidInputError: If the scene has no such body, the surface is no grid, or the net is finer than
                the mesh.
        """
        if self.body not in scene.bodies:
            raise InvalidInputError(
                f"a design names body {self.body!r}, the scene has {sorted(scene.bodies)}: use one of them"
            )
        mesh, surface = scene.bodies[self.body].mesh, self.surface
        whole = side_of(mesh, surface) if isinstance(surface, str) else surface
        placed = replace(self, surface=self._within(whole, scene))
        placed._check_resolved()
        return placed

    def _check_resolved(self) -> None:
        """Raise unless the nodes distinguish all control points of the net."""
        _, sizes, ways = np.linalg.svd(self.basis, full_matrices=False)
        lost = ways[sizes <= LAST_PLACES * sizes[0]]
        if lost.size:
            names = ", ".join(map(str, np.flatnonzero(np.abs(lost).max(axis=0) > 0.1)))
            raise InvalidInputError(
                f"the surface mesh of {self.body!r} is too coarse for a net {self.net}, nodes move only in "
                f"{self.size - len(lost)} ways (variables {names} depend on one another): use fewer points"
            )

    def _within(self, surface: DesignSurface, scene: Scene) -> DesignSurface:
        """Return the surface with directions within the planes of symmetry of a scene."""
        cut = mirrored(scene, self.body)
        at = np.flatnonzero(cut[surface.nodes].any(axis=1))
        inside = within_planes(surface.directions[at], cut[surface.nodes[at]], planes_of(scene))
        length = np.linalg.norm(inside, axis=1)
        leaving = int(np.count_nonzero(length <= LAST_PLACES))
        if leaving:
            raise InvalidInputError(
                f"design surfaces may end at planes of symmetry, {counted(leaving, 'node')} of that on "
                f"{self.body!r} would leave one: choose another surface"
            )
        directions = surface.directions.copy()
        directions[at] = inside / length[:, None]
        return replace(surface, directions=directions)

    @property
    def lattice(self) -> DesignSurface:
        """The surface with its nodes.

        Raises:
            InvalidInputError: If it is given by name and was not put `on` a scene.
        """
        if isinstance(self.surface, str):
            raise InvalidInputError(
                f"surface {self.surface!r}, given by name, needs a scene for its nodes: take design.on(scene)"
            )
        return self.surface

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of control points along each parameter."""
        return (self.net,) if isinstance(self.net, int) else tuple(self.net)

    @property
    def size(self) -> int:
        """Number of design variables."""
        return prod(self.counts)

    @property
    def basis(self) -> np.ndarray:
        """Values of the B_k at the surface's nodes, shape (n_nodes, size)."""
        return tensor_bernstein(self.lattice.parameters, self.counts)

    def displacement(self, alpha: np.ndarray) -> np.ndarray:
        """Return the displacement of the surface's nodes, shape (n_nodes, dim), [length].

        Args:
            alpha: Design variables, shape (size,), [length].
        """
        return (self.basis @ alpha)[:, None] * self.lattice.directions

    def pull_back(self, gradient: np.ndarray) -> np.ndarray:
        """Vector-Jacobian product of `displacement` with respect to the design variables.

        Args:
            gradient: Derivative by the nodes' displacements, shape (n_nodes, dim).

        Returns:
            Derivative by α, shape (size,).
        """
        return self.basis.T @ np.einsum("nd,nd->n", gradient, self.lattice.directions)

    def nodes_beyond_transition(self, mesh: BodyMesh, cut: np.ndarray) -> np.ndarray:
        """Return the nodes of the body that do not follow the surface.

        Only subdomains with other nodes are reassembled and refactored for a new design.

        Args:
            mesh: The body in its reference shape.
            cut: Which nodes lie on which plane of symmetry, shape (n_nodes, n_planes): behind it the body
                continues.
        """
        surface = mesh.points[self.lattice.nodes]
        extent = float(np.linalg.norm(np.ptp(surface, axis=0)))
        width = TRANSITION * extent if self.transition is None else self.transition
        distance, _ = cKDTree(surface).query(mesh.points)
        far = distance > max(FAR * extent, width)
        facets, _ = mesh.boundary
        facets = facets[~cut[facets].all(axis=1).any(axis=1)]
        boundary = np.setdiff1d(facets, self.lattice.nodes)
        far[boundary] |= distance[boundary] > width
        return np.flatnonzero(far)

    def control_points(self, points: np.ndarray, alpha: np.ndarray) -> np.ndarray:
        """Return positions for drawing the control points, shape ``(*counts, dim)``, [length].

        Each is drawn at its Greville abscissa on the reference surface, moved by its own variable.

        Args:
            points: Reference coordinates of the body, shape (n_nodes, dim).
            alpha: Design variables, shape (size,), [length].
        """
        ticks = [np.linspace(0, 1, count) if count > 1 else np.array([0.5]) for count in self.counts]
        wanted = tensor_grid(ticks)
        distance = np.linalg.norm(self.lattice.parameters[None] - wanted[:, None], axis=2)
        nearest = np.argmin(distance, axis=1)
        moved = points[self.lattice.nodes[nearest]] + alpha[:, None] * self.lattice.directions[nearest]
        return moved.reshape(*self.counts, -1)


def checked_variables(alpha: np.ndarray, size: int, comm: MPI.Comm) -> np.ndarray:
    """Return design variables as a checked array. Collective on ``comm``."""
    with together(comm):
        variables = np.asarray(alpha, dtype=float)
        _require_size(variables, size, "alpha")
        if not np.isfinite(variables).all():
            first = int(np.flatnonzero(~np.isfinite(variables))[0])
            raise InvalidInputError(f"alpha must be finite, got {variables[first]} in entry {first}")
    require_alike(comm, described(variables, "alpha"))
    return variables


def _require_size(alpha: np.ndarray, size: int, what: str) -> None:
    """Check the number of variables."""
    if np.shape(alpha) != (size,):
        raise InvalidInputError(
            f"{what} must have shape ({size},), got {np.shape(alpha)}: one number per control point"
        )


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
        _require_size(self.alpha, self.design.size, f"alpha of the design on {self.design.body!r}")
        counts = self.design.lattice.counts
        grid = tensor_grid(self.ticks)
        rising = all((np.diff(ticks) > 0).all() for ticks in self.ticks)
        whole = grid.shape == self.design.lattice.parameters.shape
        if not rising or not whole or not np.allclose(grid, self.parameters, rtol=0.0, atol=1e-9):
            raise InvalidInputError(
                f"the nodes of a design on {self.design.body!r} must form a grid in its parameters, {counts} "
                "that rise, s slowest, got others: of a refined mesh take the problem on the first one"
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
        from scipy.interpolate import RectBivariateSpline, make_interp_spline  # scene files load designs

        degrees = [min(3, len(ticks) - 1) for ticks in self.ticks]
        if len(self.ticks) == 1:
            return np.asarray(make_interp_spline(self.ticks[0], values, k=degrees[0])(parameters[:, 0]))
        grid, (kx, ky) = values.reshape(*self.design.lattice.counts, -1), degrees
        columns = np.moveaxis(grid, 2, 0)
        splines = (RectBivariateSpline(*self.ticks, column, kx=kx, ky=ky, s=0) for column in columns)
        return np.stack([spline.ev(*parameters.T) for spline in splines], axis=1)

"""Designed surfaces and bodies as STEP files for CAD programs, through gmsh's OpenCASCADE."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError, collectively, together
from fenics_contact.io.exact_planes import corners_in_planes, rims_in_planes
from fenics_contact.io.flat_sides import Edge, FlatSide, flat_sides
from fenics_contact.io.moved_bodies import moved_body, moved_surfaces
from fenics_contact.io.replacing import replacing
from fenics_contact.io.spline_fit import DEGREE, CadError, SplineFit, fitted
from fenics_contact.mesh_io import gmsh_model, silenced

if TYPE_CHECKING:
    from fenics_contact.shape import LoadPath, ShapeProblem


@displayed
@dataclass(frozen=True)
class StepFile:
    """A STEP file that was written.

    Attributes:
        path: The file.
        deviation: Largest distance of its B-splines from the designed surfaces, [length].
        points: Number of control points of each B-spline along a parameter.
        volume: Volume of the body in it, in the plane its area; None for surfaces alone, [length³].
        sides: Largest distance of the mesh's other boundary nodes from the flat sides of the body, [length].
    """

    path: Path
    deviation: float
    points: tuple[int, ...]
    volume: float | None
    sides: float


@collectively("write_step", lambda problem, *_, **__: problem.comm)
def write_step(
    problem: ShapeProblem | LoadPath,
    alpha: np.ndarray,
    path: str | Path,
    *,
    body: str | None = None,
    solid: bool = True,
    tolerance: float = 1e-6,
    scale: float = 1.0,
) -> StepFile:
    """Write a designed body, or its designed surfaces alone, as a STEP file. Collective.

    The designed surfaces are B-splines of degree five through points of `shape.MovedSurface`. The body is
    closed by the flat sides of the reference shape; where these are not flat, as beside the crown of a chain
    link, only the surfaces can be written. A plane body is a plane face, its other edges are straight lines
    from node to node.

    Args:
        problem: The problem with the design.
        alpha: Design variables of all its designs, shape (size,), [length]: ``result.x``.
        path: File to write, .step or .stp; its folder is created.
        body: Name of the body; needed if designs move several.
        solid: Whether to write the body, or the designed surfaces alone.
        tolerance: Largest deviation of the B-splines, relative to the extent of their surface.
        scale: Millimetres in the scene's unit of length: coordinates in the file are in millimetres.

    Returns:
        The file, how far its surfaces deviate, and the volume of its body; `mesh_io.read_cad` reads it.

    Raises:
        InvalidInputError: If the body is not designed, alpha does not fit, or the file has another suffix.
        CadError: If a surface folds or cannot be fitted, or the body has other sides than flat ones.
        MissingRequirementError: If gmsh is missing, too old or cannot be loaded.

    Example:
        >>> write_step(problem, result.x, "output/pad.step").deviation  # doctest: +SKIP
        3.1e-07
    """
    target = Path(path)
    with together(problem.comm):
        if target.suffix.lower() not in (".step", ".stp") or not 0.0 < scale < np.inf:
            raise InvalidInputError(
                f"write_step needs a file .step or .stp and a scale above zero, got {target.name!r} and "
                f"{scale}: give millimetres in the scene's unit of length"
            )
    name, mesh = moved_body(problem, alpha, body)
    surfaces = [one for one in moved_surfaces(problem, alpha) if one.design.body == name]
    written: StepFile | None = None
    with together(problem.comm):
        if problem.comm.rank == 0:
            fits = [fitted(surface, tolerance) for surface in surfaces]
            lattices = [one.design.lattice for one in surfaces]
            sides = flat_sides(problem.scene.bodies[name].mesh, mesh.points, lattices) if solid else []
            fits = rims_in_planes(fits, sides, tolerance)
            with replacing(target) as (temporary,), gmsh_model("fenics_contact STEP") as gmsh:
                drawing = _Drawing(gmsh, fits, corners_in_planes(mesh.points, sides), scale)
                volume: float | None = None
                with _reasons():
                    if solid:
                        volume = drawing.body(sides)
                    else:
                        drawing.surfaces()
                    with silenced(1):
                        gmsh.write(str(temporary))
            counts = tuple(len(fit.points) for fit in fits)
            off = max((side.off for side in sides), default=0.0)
            written = StepFile(target, max(fit.deviation for fit in fits), counts, volume, off)
    return problem.comm.bcast(written)


@contextmanager
def _reasons() -> Iterator[None]:
    """Say what gmsh says."""
    try:
        yield
    except CadError:
        raise
    except Exception as reason:  # gmsh raises no other class
        raise CadError(
            f"OpenCASCADE must be able to build the sides of a body, it says: {reason}: write the surfaces "
            "alone with solid=False"
        ) from reason


class _Drawing:
    """Surfaces and sides in gmsh's current model, in millimetres."""

    def __init__(
        self, gmsh: ModuleType, fits: Sequence[SplineFit], corners: Mapping[int, np.ndarray], scale: float
    ) -> None:
        self._gmsh, self._occ = gmsh, gmsh.model.occ
        self._fits, self._corners, self._scale = fits, corners, scale

    def surfaces(self) -> None:
        """Draw the designed surfaces alone."""
        self._keep([self._spline(fit) for fit in self._fits])

    def body(self, sides: Sequence[FlatSide]) -> float:
        """Draw the body that surfaces and flat sides enclose; return its volume in the scene's units."""
        body = 2, self._face(sides[0])
        if self._fits[0].points.ndim == 3:
            faces = [body, *((2, self._face(side)) for side in sides[1:])]
            faces += [self._spline(fit) for fit in self._fits]
            # Sides meet along edges of the same control points.
            shell = self._occ.addSurfaceLoop([tag for _, tag in faces], sewing=True)
            body = 3, self._occ.addVolume([shell])
        self._occ.synchronize()
        edges = self._gmsh.model.getBoundary(self._gmsh.model.getBoundary([body]), combined=True)
        if edges:
            raise CadError(
                f"the sides of a body in a CAD file must enclose it, {len(sides)} flat ones and "
                f"{len(self._fits)} designed surfaces leave {len(edges)} open edges: write the surfaces "
                "alone with solid=False"
            )
        self._keep([body])
        return float(abs(self._occ.getMass(*body)) / self._scale ** body[0])

    def _keep(self, wanted: list[tuple[int, int]]) -> None:
        """Remove everything but some entities and what they consist of."""
        self._occ.synchronize()
        model = self._gmsh.model
        parts = {(dim, abs(tag)) for dim, tag in wanted}
        level = list(parts)
        while level and level[0][0] > 0:
            level = [(dim, abs(tag)) for dim, tag in model.getBoundary(level, combined=False)]
            parts |= set(level)
        for dim in (2, 1, 0):
            self._occ.remove([entity for entity in model.getEntities(dim) if entity not in parts])
        self._occ.synchronize()

    def _spline(self, fit: SplineFit) -> tuple[int, int]:
        """Draw a designed surface or curve."""
        if fit.points.ndim == 2:
            return 1, self._curve(fit.points, fit.knots)
        tags = [self._point(point) for point in np.swapaxes(fit.points, 0, 1).reshape(-1, 3)]
        knots, times = _counted(fit.knots)
        return 2, self._occ.addBSplineSurface(
            tags, len(fit.points), degreeU=DEGREE, degreeV=DEGREE, knotsU=knots, knotsV=knots,
            multiplicitiesU=times, multiplicitiesV=times,
        )  # fmt: skip

    def _face(self, side: FlatSide) -> int:
        """Draw a flat side."""
        wires = [
            self._occ.addWire([self._edge(edge) for edge in loop], checkClosed=True) for loop in side.loops
        ]
        return int(self._occ.addPlaneSurface(wires))

    def _edge(self, edge: Edge) -> int:
        if edge.surface is None:
            ends = (self._corners[int(node)] for node in edge.nodes[[0, -1]])
            return int(self._occ.addLine(*[self._point(end) for end in ends]))
        fit = self._fits[edge.surface]
        points = fit.sides[edge.side]
        return self._curve(points[::-1] if edge.reversed else points, fit.knots)

    def _curve(self, points: np.ndarray, knots: np.ndarray) -> int:
        distinct, times = _counted(knots)
        tags = [self._point(point) for point in points]
        return int(self._occ.addBSpline(tags, degree=DEGREE, knots=distinct, multiplicities=times))

    def _point(self, point: np.ndarray) -> int:
        x, y, *z = self._scale * point
        return int(self._occ.addPoint(x, y, *(z or [0.0])))


def _counted(knots: np.ndarray) -> tuple[Any, Any]:
    """Return the distinct knots, and how often each counts."""
    distinct, times = np.unique(knots, return_counts=True)
    return distinct.tolist(), times.tolist()

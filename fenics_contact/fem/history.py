"""What the materials of a scene remember, at the Gauss points of its bodies."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from fenics_contact._libraries import MPI
from fenics_contact.display import displayed
from fenics_contact.errors import InvalidInputError
from fenics_contact.fem.templates import quadrature_degree
from fenics_contact.mesh import CELL_TYPES, BodyMesh, quadrature
from fenics_contact.scene import Body, HistoryMaterial, Scene


@displayed
@dataclass(frozen=True, eq=False)
class History:
    """Internal variables of the bodies whose materials have some, replicated on all ranks.

    They are kept by the cells of the bodies' meshes, so that they do not depend on subdomains and ranks. A
    body that moves keeps them.

    Attributes:
        values: Name of a body to its internal variables, shape (n_cells, n_gauss, k); where several
            materials have different numbers of them, the first ones count.
    """

    values: Mapping[str, np.ndarray]
    _cells: Mapping[str, str] = field(repr=False)

    @classmethod
    def unloaded(cls, scene: Scene) -> History:
        """Return the history of a scene to which nothing has happened: zeros."""
        bodies = {name: body for name, body in scene.bodies.items() if history_size(body)}
        values = {name: np.zeros(_shape(body)) for name, body in bodies.items()}
        return cls(values, {name: _described(body.mesh) for name, body in bodies.items()})

    def require(self, scene: Scene) -> None:
        """Reject a scene to which the history does not belong.

        Raises:
            InvalidInputError: If its bodies, their cells or the numbers of internal variables are others.
        """
        needed = {name: _shape(body) for name, body in scene.bodies.items() if history_size(body)}
        if set(needed) != set(self.values):
            raise InvalidInputError(
                f"a history must be that of the bodies with such materials, {sorted(needed)}, got one of "
                f"{sorted(self.values)}: take the one that came with the last state of this scene, or none"
            )
        for name, shape in needed.items():
            if self.values[name].shape != shape or self._cells[name] != _described(scene.bodies[name].mesh):
                raise InvalidInputError(
                    f"the history of body {name!r} must belong to its mesh and materials, with shape {shape} "
                    f"(cells, Gauss points, internal variables), got that of other cells, shape "
                    f"{self.values[name].shape}: take the one that came with the last state of this scene; "
                    "from mesh to mesh none is transferred"
                )

    def on(self, body: str, cells: np.ndarray) -> np.ndarray | None:
        """Return what some cells of a body remember, (n_cells, n_gauss, k); None where nothing does."""
        return self.values[body][cells] if body in self.values else None

    def advanced(self, comm: MPI.Comm, parts: Iterable[tuple[str, np.ndarray, np.ndarray | None]]) -> History:
        """Return the history after a step. Collective on ``comm``.

        Args:
            comm: Communicator of the ranks that hold the subdomains.
            parts: For each of this rank's subdomains its body, its cells of the body's mesh and what they
                remember, as in `on`.
        """
        values = {name: array.copy() for name, array in self.values.items()}
        mine = [part for part in parts if part[0] in values]
        for every in comm.allgather(mine) if comm.size > 1 else [mine]:
            for body, cells, new in every:
                values[body][cells] = new
        return History(values, self._cells)


def history_size(body: Body) -> int:
    """Return the largest number of internal variables of a body's materials, 0 without any."""
    return max((each.history_size for each in body.materials if isinstance(each, HistoryMaterial)), default=0)


def _shape(body: Body) -> tuple[int, int, int]:
    cell_type = body.mesh.cell_type
    points = len(quadrature(CELL_TYPES[cell_type], quadrature_degree(cell_type))[1])
    return body.mesh.n_cells, points, history_size(body)


def _described(mesh: BodyMesh) -> str:
    """Describe the cells of a mesh, whatever their coordinates."""
    return hashlib.sha256(np.ascontiguousarray(mesh.cells).tobytes()).hexdigest()

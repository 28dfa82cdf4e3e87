"""Placement of meshes: scaled, rotated, moved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field, PositiveFloat
from scipy.spatial.transform import Rotation

from fenics_contact.errors import InvalidInputError
from fenics_contact.gallery import DesignSurface
from fenics_contact.mesh import BodyMesh, quadratic
from fenics_contact.scene_file.part import Part
from fenics_contact.scene_file.values import Triple, Vector

if TYPE_CHECKING:
    from mpi4py import MPI


@dataclass(frozen=True, eq=False)
class Shaped:
    """A mesh with its shape.

    Attributes:
        mesh: The mesh.
        crown: The smooth surface that a design may move, of chain links.
    """

    mesh: BodyMesh
    crown: DesignSurface | None = None

    def placed(self, rotation: np.ndarray, translation: np.ndarray, scale: float) -> Shaped:
        """Return the shape scaled and rotated about the origin, then moved."""
        mesh = self.mesh.placed(rotation, translation, scale)
        crown = self.crown
        if crown is not None:
            crown = replace(crown, directions=crown.directions @ rotation.T)
        return Shaped(mesh, crown)


class Placed(Part):
    """Keys that every mesh may have."""

    quadratic: bool = Field(False, description="cells of second order")
    scale: PositiveFloat = Field(
        1.0, description="factor on all coordinates, about the origin, applied first"
    )
    axis: Triple = Field(
        (0.0, 0.0, 1.0), description="axis through the origin about which the mesh is turned"
    )
    degrees: float = Field(0.0, description="angle by which the mesh is turned about `axis`, in degrees")
    translate: Vector | None = Field(None, description="displacement of the mesh, applied last, [length]")

    def build(self, folder: Path, comm: MPI.Comm) -> Mapping[str, Shaped]:
        """Return the bodies by the names that `part` takes, "" for the only one. Collective.

        Raises:
            InvalidInputError: If they cannot be meshed or placed.
        """
        return {name: self.arranged(shape) for name, shape in self.shapes(folder, comm).items()}

    def shapes(self, folder: Path, comm: MPI.Comm) -> Mapping[str, Shaped]:
        """Return the bodies before placement. Collective."""
        return {"": Shaped(self.made())}

    def arranged(self, shape: Shaped) -> Shaped:
        """Return a shape placed by the keys.

        Raises:
            InvalidInputError: If its cells are quadratic already, or a vector does not fit.
        """
        if self.quadratic:
            shape = replace(shape, mesh=quadratic(shape.mesh))
        dim = shape.mesh.dim
        move = np.zeros(dim) if self.translate is None else np.array(self.translate)
        if len(move) != dim:
            raise InvalidInputError(
                f"translate must have {dim} entries like the mesh, got {list(move)}: give {dim} numbers"
            )
        if self.degrees == 0.0 and self.scale == 1.0 and not move.any():
            return shape
        return shape.placed(_rotation(self.axis, self.degrees)[:dim, :dim], move, self.scale)


def _rotation(axis: tuple[float, ...], degrees: float) -> np.ndarray:
    """Return the rotation matrix, (3, 3)."""
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        raise InvalidInputError(f"axis must not be zero, got {list(axis)}: (0, 0, 1) turns about z")
    turn = Rotation.from_rotvec(degrees / length * np.array(axis), degrees=True)
    return np.asarray(np.round(turn.as_matrix(), 15))  # makes quarter turns exact

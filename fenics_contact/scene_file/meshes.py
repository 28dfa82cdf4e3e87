"""Meshes: shapes that the package builds, and files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Field, Tag

from fenics_contact import geometry
from fenics_contact.geometry.arguments import MOST
from fenics_contact.geometry.block import checked_corners, checked_counts
from fenics_contact.geometry.hemisphere import graded
from fenics_contact.scene_file.links import ChainMesh, LinkMesh, TwoLinksMesh
from fenics_contact.scene_file.mesh_files import MeshFile
from fenics_contact.scene_file.placing import Placed, Shaped
from fenics_contact.scene_file.values import CountPair, Counts, CountTriple, Pair, Triple, chooser

if TYPE_CHECKING:
    from mpi4py import MPI

SolidCell: TypeAlias = Literal["hexahedron", "tetrahedron"]
PlaneCell: TypeAlias = Literal["quadrilateral", "triangle"]
_GRADING = (
    "logarithm of the ratio of the largest to the smallest cell along each axis; positive: small cells at "
    "the lower corner, negative: at the upper one, 0: equal cells"
)


def _ticks(low: float, high: float, count: int, grading: float) -> np.ndarray:
    """Divide an interval into cells that grow, or, where the grading is negative, shrink."""
    if grading == 0.0:
        return np.linspace(low, high, count + 1)
    share = graded(count, abs(grading))
    return low + (high - low) * share if grading > 0 else high - (high - low) * share[::-1]


class _Single(Placed):
    """A mesh of one body."""

    def build(self, folder: Path, comm: MPI.Comm) -> Mapping[str, Shaped]:
        """Return the body under the name that needs no `part`. Collective."""
        return {"": self.arranged(self.shaped())}

    def shaped(self) -> Shaped:
        """Return the mesh before it is placed."""
        raise NotImplementedError


class BlockMesh(_Single):
    """A box of hexahedra or tetrahedra with surfaces x0, x1, y0, y1, z0, z1."""

    shape: Literal["block"]
    lower: Triple = Field(description="lower corner, [length]")
    upper: Triple = Field(description="upper corner, [length]")
    counts: CountTriple = Field(description="cells along x, y and z")
    cell: SolidCell = Field("hexahedron", description="type of the cells")
    grading: Triple = Field((0.0, 0.0, 0.0), description=_GRADING)

    def shaped(self) -> Shaped:
        """Return the box."""
        if not any(self.grading):
            return Shaped(geometry.block(self.lower, self.upper, self.counts, self.cell))
        checked_corners(self.lower, self.upper, "xyz")
        checked_counts(self.counts, "xyz")
        ticks = [
            _ticks(*each) for each in zip(self.lower, self.upper, self.counts, self.grading, strict=True)
        ]
        return Shaped(geometry.box_lattice(ticks, self.cell))


class RectangleMesh(_Single):
    """A rectangle of quadrilaterals or triangles with surfaces x0, x1, y0, y1."""

    shape: Literal["rectangle"]
    lower: Pair = Field(description="lower left corner, [length]")
    upper: Pair = Field(description="upper right corner, [length]")
    counts: CountPair = Field(description="cells along x and y")
    cell: PlaneCell = Field("quadrilateral", description="type of the cells")
    grading: Pair = Field((0.0, 0.0), description=_GRADING)

    def shaped(self) -> Shaped:
        """Return the rectangle."""
        if not any(self.grading):
            return Shaped(geometry.rectangle(self.lower, self.upper, self.counts, self.cell))
        checked_corners(self.lower, self.upper, "xy")
        checked_counts(self.counts, "xy")
        ticks = [
            _ticks(*each) for each in zip(self.lower, self.upper, self.counts, self.grading, strict=True)
        ]
        return Shaped(geometry.rectangle_lattice(ticks, self.cell))


class _Hertz(_Single):
    """What the bodies of Hertz share."""

    radius: float = Field(gt=0, description="radius, [length]")
    n: int = Field(ge=2, description="cells from the spot of contact to the edge of the contact surface")
    grading: float = Field(
        3.0, ge=0, le=8, description="logarithm of the largest to the smallest cell on the way to the contact"
    )


class HemisphereMesh(_Hertz):
    """The lower half of a ball on the plane z = 0; surfaces contact, side, top and the cuts x0, y0."""

    shape: Literal["hemisphere"]
    symmetry: Literal["xy", "x", ""] = Field("xy", description="planes of symmetry that it is cut at")

    def shaped(self) -> Shaped:
        """Return the half ball."""
        return Shaped(geometry.hemisphere(self.radius, self.n, symmetry=self.symmetry, grading=self.grading))


class HalfCylinderMesh(_Hertz):
    """The lower half of a cylinder along y on the plane z = 0; surfaces contact, side, top, y0, y1, x0."""

    shape: Literal["half_cylinder"]
    length: float = Field(gt=0, description="the body reaches from y = 0 to this, [length]")
    n_length: int = Field(1, ge=1, description="cells along the axis")
    symmetry: Literal["x", ""] = Field("x", description="plane of symmetry that it is cut at")

    def shaped(self) -> Shaped:
        """Return the half cylinder."""
        mesh = geometry.half_cylinder(
            self.radius, self.length, self.n, self.n_length, symmetry=self.symmetry, grading=self.grading
        )
        return Shaped(mesh)


class HalfDiscMesh(_Hertz):
    """The lower half of a disc on the line y = 0, plane; surfaces contact, side, top and the cut x0."""

    shape: Literal["half_disc"]
    symmetry: Literal["x", ""] = Field("x", description="plane of symmetry that it is cut at")

    def shaped(self) -> Shaped:
        """Return the half disc."""
        return Shaped(geometry.half_disc(self.radius, self.n, symmetry=self.symmetry, grading=self.grading))


class DrilledPlateMesh(_Single):
    """Half a strip with a round hole at the z-axis; surfaces bottom, top, hole, x0, x1, y0, y1."""

    shape: Literal["drilled_plate"]
    hole: float = Field(gt=0, description="radius of the hole, [length]")
    half_width: float = Field(gt=0, description="the strip reaches from y = 0 to this, [length]")
    ends: Pair = Field(description="x of both ends, at or beyond the square around the hole, [length]")
    heights: Pair = Field(description="z of bottom and top, [length]")
    n_layers: int = Field(ge=1, le=MOST, description="cells through the thickness")
    n: int = Field(ge=1, description="cells along an eighth of the hole")
    n_radial: int | None = Field(None, ge=1, description="cells from the hole to the square around it")

    def shaped(self) -> Shaped:
        """Return the plate."""
        heights = np.linspace(*self.heights, self.n_layers + 1)
        return Shaped(
            geometry.drilled_plate(
                self.hole, self.half_width, self.ends, heights, self.n, n_radial=self.n_radial
            )
        )


class BoltMesh(_Single):
    """Half a bolt along the z-axis with head and nut; surfaces head, nut, shank, side, top, bottom, y0."""

    shape: Literal["bolt"]
    shank: float = Field(gt=0, description="radius of the shank, [length]")
    head: float = Field(gt=0, description="radius of head and nut, [length]")
    grip: Pair = Field(description="z between which the shank is free, [length]")
    head_height: float = Field(gt=0, description="height of head and nut, [length]")
    n: int = Field(ge=1, description="cells along an eighth of the circumference")
    n_radial: int | None = Field(None, ge=1, description="cells from the shank's surface to the head's")
    layers: CountPair = Field((4, 2), description="cells along the shank, and through head and nut")

    def shaped(self) -> Shaped:
        """Return the bolt."""
        return Shaped(
            geometry.bolt(
                self.shank,
                self.head,
                self.grip,
                self.head_height,
                self.n,
                n_radial=self.n_radial,
                layers=self.layers,
            )
        )


SHAPES = (
    "block", "rectangle", "hemisphere", "half_cylinder", "half_disc", "drilled_plate", "bolt",
    "chain_link", "two_links", "chain",
)  # fmt: skip


def _tag(value: Any) -> str | None:
    if not isinstance(value, Mapping):
        return None if not hasattr(value, "build") else f"<{getattr(value, 'shape', 'file')}>"
    if "file" in value and "shape" not in value:
        return "<file>"
    return f"<{value['shape']}>" if value.get("shape") in SHAPES else None


Mesh: TypeAlias = Annotated[
    Annotated[BlockMesh, Tag("<block>")]
    | Annotated[RectangleMesh, Tag("<rectangle>")]
    | Annotated[HemisphereMesh, Tag("<hemisphere>")]
    | Annotated[HalfCylinderMesh, Tag("<half_cylinder>")]
    | Annotated[HalfDiscMesh, Tag("<half_disc>")]
    | Annotated[DrilledPlateMesh, Tag("<drilled_plate>")]
    | Annotated[BoltMesh, Tag("<bolt>")]
    | Annotated[LinkMesh, Tag("<chain_link>")]
    | Annotated[TwoLinksMesh, Tag("<two_links>")]
    | Annotated[ChainMesh, Tag("<chain>")]
    | Annotated[MeshFile, Tag("<file>")],
    chooser(_tag, "shape", SHAPES),
]

__all__ = ["SHAPES", "Counts", "Mesh"]

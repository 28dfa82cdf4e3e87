"""Meshes of built-in shapes: keys are the arguments of their functions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from fenics_contact import gallery
from fenics_contact.checks import MOST, STEEPEST
from fenics_contact.gallery import Link, LinkShape
from fenics_contact.mesh import BodyMesh
from fenics_contact.scene_file.mesh_files import MeshFile
from fenics_contact.scene_file.part import keys_of
from fenics_contact.scene_file.placing import Placed, Shaped
from fenics_contact.scene_file.values import Pair, Triple, one_of

if TYPE_CHECKING:
    from mpi4py import MPI

SolidCell: TypeAlias = Literal["hexahedron", "tetrahedron"]
Grading: TypeAlias = Annotated[float, Field(ge=0, le=STEEPEST)]


@keys_of(gallery.block)
class BlockMesh(Placed):
    """A box of hexahedra or tetrahedra with surfaces x0, x1, y0, y1, z0, z1."""

    shape: Literal["block"]
    lower: Triple
    upper: Triple
    grading: Triple
    cell: SolidCell


@keys_of(gallery.rectangle)
class RectangleMesh(Placed):
    """A rectangle of quadrilaterals or triangles with surfaces x0, x1, y0, y1."""

    shape: Literal["rectangle"]
    lower: Pair
    upper: Pair
    grading: Pair
    cell: Literal["quadrilateral", "triangle"]


class _Hertz(Placed):
    radius: PositiveFloat
    n: Annotated[int, Field(ge=2)]
    grading: Grading


@keys_of(gallery.hemisphere)
class HemisphereMesh(_Hertz):
    """The lower half of a ball on the plane z = 0; surfaces contact, side, top and the cuts x0, y0."""

    shape: Literal["hemisphere"]
    symmetry: Literal["xy", "x", ""]


@keys_of(gallery.half_cylinder)
class HalfCylinderMesh(_Hertz):
    """The lower half of a cylinder along y on the plane z = 0; surfaces contact, side, top, y0, y1, x0."""

    shape: Literal["half_cylinder"]
    length: PositiveFloat
    n_length: PositiveInt
    symmetry: Literal["x", ""]


@keys_of(gallery.half_disc)
class HalfDiscMesh(_Hertz):
    """The lower half of a disc on the line y = 0, plane; surfaces contact, side, top and the cut x0."""

    shape: Literal["half_disc"]
    symmetry: Literal["x", ""]


def _plate(
    hole: float,
    half_width: float,
    ends: tuple[float, float],
    heights: tuple[float, float],
    n_layers: int,
    n: int,
    n_radial: int | None = None,
) -> BodyMesh:
    """Mesh a drilled plate with layers of equal height.

    Args:
        hole: Radius of the hole, [length].
        half_width: The strip reaches from y = 0 to this, [length].
        ends: x of both ends, at or beyond the square around the hole, [length].
        heights: z of bottom and top, [length].
        n_layers: Cells through the thickness.
        n: Cells along an eighth of the hole.
        n_radial: Cells from the hole to the square around it; n unless given.
    """
    levels = np.linspace(*heights, n_layers + 1)
    return gallery.drilled_plate(hole, half_width, ends, levels, n, n_radial=n_radial)


@keys_of(_plate)
class DrilledPlateMesh(Placed):
    """Half a strip with a round hole at the z-axis; surfaces bottom, top, hole, x0, x1, y0, y1."""

    shape: Literal["drilled_plate"]
    hole: PositiveFloat
    half_width: PositiveFloat
    n_layers: Annotated[int, Field(ge=1, le=MOST)]
    n: PositiveInt
    n_radial: PositiveInt | None


@keys_of(gallery.bolt)
class BoltMesh(Placed):
    """Half a bolt along the z-axis with head and nut; surfaces head, nut, shank, side, top, bottom, y0."""

    shape: Literal["bolt"]
    shank: PositiveFloat
    head: PositiveFloat
    head_height: PositiveFloat
    n: PositiveInt
    n_radial: PositiveInt | None


class _Links(Placed):
    inner_radius: PositiveFloat
    straight: PositiveFloat
    thickness: PositiveFloat
    width: PositiveFloat
    roundness: Annotated[float, Field(gt=0, le=1)]
    n_around: Annotated[int, Field(ge=12)]
    n_a: PositiveInt
    n_b: Annotated[int, Field(ge=2)]
    grading: Grading
    cell: SolidCell

    def shapes(self, folder: Path, comm: MPI.Comm) -> Mapping[str, Shaped]:
        """Return the links by the names that `part` takes. Collective."""
        return {name: Shaped(link.mesh, link.crown) for name, link in self.links_of(comm).items()}

    def links_of(self, comm: MPI.Comm) -> Mapping[str, Link]:
        """Return the links, a single one unless it is overridden. Collective."""
        return {"": gallery.chain_link(self.made(), comm)}


@keys_of(LinkShape)
class LinkMesh(_Links):
    """One chain link; surfaces contact (inner side of the contact crown) and grip (of the far crown)."""

    shape: Literal["chain_link"]


@keys_of(LinkShape)
class TwoLinksMesh(_Links):
    """Two interlocked links that touch, parts "first" and "second"; surfaces contact and grip."""

    shape: Literal["two_links"]
    gap: NonNegativeFloat = Field(0.0, description="clearance along the pull axis, [length]")

    def links_of(self, comm: MPI.Comm) -> Mapping[str, Link]:
        """Return both links. Collective."""
        links = gallery.two_links(self.made(), gap=self.gap, comm=comm)
        return {"first": links.first, "second": links.second}


@keys_of(LinkShape)
class ChainMesh(_Links):
    """A straight chain of links, parts "1", "2", ...; each bears with contact on the grip of the next."""

    shape: Literal["chain"]
    links: Annotated[int, Field(ge=2, le=10_000, description="number of links")]
    gap: NonNegativeFloat = Field(0.0, description="clearance between neighbours, [length]")

    def links_of(self, comm: MPI.Comm) -> Mapping[str, Link]:
        """Return all links. Collective."""
        chain = gallery.chain([self.made()] * self.links, gap=self.gap, comm=comm)
        return {str(number): link for number, link in enumerate(chain.links, 1)}


Mesh: TypeAlias = Annotated[
    Any,
    one_of(
        "shape",
        BlockMesh, RectangleMesh, HemisphereMesh, HalfCylinderMesh, HalfDiscMesh, DrilledPlateMesh, BoltMesh,
        LinkMesh, TwoLinksMesh, ChainMesh,
        other=MeshFile,
        when=lambda table: "file" in table and "shape" not in table,
    ),
]  # fmt: skip

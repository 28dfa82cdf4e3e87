"""Chain links, alone, in pairs and in chains."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from fenics_contact.geometry import Link, LinkShape, chain, chain_link, two_links
from fenics_contact.scene_file.placing import Placed, Shaped

if TYPE_CHECKING:
    from mpi4py import MPI

_DEFAULT = LinkShape()


class _Links(Placed):
    """Proportions and mesh size of the links."""

    inner_radius: float = Field(
        _DEFAULT.inner_radius, gt=0, description="radius of the inner side of the crowns, [length]"
    )
    straight: float = Field(_DEFAULT.straight, gt=0, description="length of the straight legs, [length]")
    thickness: float = Field(
        _DEFAULT.thickness, gt=0, description="size of the wire in the plane of the ring, [length]"
    )
    width: float = Field(_DEFAULT.width, gt=0, description="size of the wire across the ring, [length]")
    roundness: float = Field(
        _DEFAULT.roundness, gt=0, le=1, description="1 for a round wire, less for a flatter"
    )
    n_around: int = Field(_DEFAULT.n_around, ge=12, description="cells around the ring, a multiple of 6")
    n_a: int = Field(_DEFAULT.n_a, ge=1, description="cells through the thickness")
    n_b: int = Field(_DEFAULT.n_b, ge=2, description="cells across the width")
    grading: float = Field(
        _DEFAULT.grading, ge=0, le=8,
        description="logarithm of the largest to the smallest cell of the crowns on the way to the contact",
    )  # fmt: skip
    cell: Literal["hexahedron", "tetrahedron"] = Field("hexahedron", description="type of the cells")

    @property
    def _link(self) -> LinkShape:
        names = (
            "inner_radius", "straight", "thickness", "width", "roundness",
            "n_around", "n_a", "n_b", "grading", "cell",
        )  # fmt: skip
        return LinkShape(**{name: getattr(self, name) for name in names})

    def _shapes(self, links: Mapping[str, Link]) -> Mapping[str, Shaped]:
        return {name: self.arranged(Shaped(link.mesh, link.crown)) for name, link in links.items()}


class LinkMesh(_Links):
    """One chain link; surfaces contact (inner side of the contact crown) and grip (of the far crown)."""

    shape: Literal["chain_link"]

    def build(self, folder: Path, comm: MPI.Comm) -> Mapping[str, Shaped]:
        """Return the link. Collective."""
        return self._shapes({"": chain_link(self._link, comm)})


class TwoLinksMesh(_Links):
    """Two interlocked links that touch, parts "first" and "second"; surfaces contact and grip."""

    shape: Literal["two_links"]
    gap: float = Field(0.0, description="clearance along the pull axis, [length]")

    def build(self, folder: Path, comm: MPI.Comm) -> Mapping[str, Shaped]:
        """Return both links. Collective."""
        links = two_links(self._link, gap=self.gap, comm=comm)
        return self._shapes({"first": links.first, "second": links.second})


class ChainMesh(_Links):
    """A straight chain of links, parts "1", "2", ...; each bears with contact on the grip of the next."""

    shape: Literal["chain"]
    links: int = Field(ge=2, le=10_000, description="number of links")
    gap: float = Field(0.0, description="clearance between neighbours, [length]")

    def build(self, folder: Path, comm: MPI.Comm) -> Mapping[str, Shaped]:
        """Return all links. Collective."""
        found = chain([self._link] * self.links, gap=self.gap, comm=comm)
        return self._shapes({str(number): link for number, link in enumerate(found.links, 1)})

"""Blocks and regions of very different stiffness."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from fenics_contact import Body, BodyMesh, ContactPair, Coulomb, RigidPlane, Scene, Support, Surface, Traction
from fenics_contact.gallery import block
from fenics_contact.materials import IsotropicElasticity
from tests.scenes import crowned

#: Cells along an edge of a block, which is cut into 2 x 2 x 2 subdomains.
CELLS = 6


FRICTION = Coulomb(0.4)


@cache
def blocks() -> tuple[BodyMesh, BodyMesh]:
    """Return the lower and the crowned upper block."""
    counts = (CELLS,) * 3
    upper = block((0.05, 0.05, 1), (0.95, 0.95, 1.9), counts)
    return block((0, 0, 0), (1, 1, 1), counts), crowned(upper, 0.005)


def elastic(young: float) -> IsotropicElasticity:
    return IsotropicElasticity(young, 0.3)


@dataclass(frozen=True)
class Blocks:
    """A crowned block on a clamped one, pressed so that the soft one yields by a hundredth.

    Attributes:
        soft: Which block is soft.
        slave: Which block is the slave.
        friction: With friction the upper block is pushed as well, without it guides hold it.
        discretisation: Of the contact pair.
    """

    soft: str
    slave: str
    friction: Coulomb | None
    discretisation: str = "node"

    def scene(self, contrast: float) -> Scene:
        law = {name: elastic(1.0 if name == self.soft else contrast) for name in ("lower", "upper")}
        bodies = {name: Body(mesh, law[name]) for name, mesh in zip(law, blocks(), strict=True)}
        faces = Surface("upper", "z0"), Surface("lower", "z1")
        pair = ContactPair(*faces[:: 1 if self.slave == "upper" else -1], self.friction, self.discretisation)  # type: ignore[call-arg]
        supports = [Support("lower", "z0")]
        if self.friction is None:
            supports += [Support("upper", "x0", (0.0, None, None)), Support("upper", "y0", (None, 0.0, None))]
        push = 0.0 if self.friction is None else 0.003
        return Scene(bodies, supports, [Traction("upper", "z1", (push, 0.0, -0.01))], [pair])


@dataclass(frozen=True)
class Regions:
    """A block of two materials, clamped, or on a rigid floor with friction that alone holds it.

    Attributes:
        soft: Which half is soft: the lower one, or where halves stand side by side the left one, is "a".
        axis: Normal of the plane between them.
        inside: Whether the plane runs through subdomains, and not between them.
        friction: Law on the floor; None clamps the block.
    """

    soft: str
    axis: int
    inside: bool
    friction: Coulomb | None

    def scene(self, contrast: float) -> Scene:
        mesh, _ = blocks()
        middle = mesh.points[mesh.cells].mean(axis=1)[:, self.axis]
        first = middle < 0.5 + self.inside / CELLS
        mesh = replace(mesh, regions={"a": np.flatnonzero(first), "b": np.flatnonzero(~first)})
        body = Body(mesh, {region: elastic(1.0 if region == self.soft else contrast) for region in "ab"})
        load = Traction("block", "z1", (0.002, 0.0, -0.01))
        if self.friction is None:
            return Scene({"block": body}, [Support("block", "z0")], [load])
        floor = ContactPair(
            Surface("block", "z0"), RigidPlane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), self.friction
        )
        return Scene({"block": body}, [], [load], [floor])

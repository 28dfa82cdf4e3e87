"""A scene: bodies, supports, loads and contact pairs. Nothing numerical has happened yet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fenics_contact.display import displayed
from fenics_contact.partition import default_partition
from fenics_contact.scene.automatic import AutomaticContact
from fenics_contact.scene.chosen_discretisation import with_discretisation
from fenics_contact.scene.effects import Effect, effects_of
from fenics_contact.scene.materials import is_nonlinear
from fenics_contact.scene.parts import SceneParts
from fenics_contact.scene.plan import Plan, make_plan


@displayed
@dataclass(frozen=True)
class Scene(SceneParts):
    """Elastic bodies that may touch.

    Attributes:
        bodies: Bodies by name.
        supports: Prescribed displacements.
        loads: Forces.
        contacts: Pairs of surfaces that may touch; `AutomaticContact` finds them, and names the surfaces.
            Each has the discretisation that it was given or that the scene chose for it, see `plan`.
        ties: Pairs of surfaces that stay together, likewise.

    Raises:
        InvalidInputError: If a part names a body or a surface that is not there, does not suit the body's
            dimension or material, or a load is not one of the package's.

    Example:
        >>> from fenics_contact.gallery import block
        >>> from fenics_contact.scene import Coulomb, IsotropicElasticity, RigidPlane, Traction
        >>> steel = IsotropicElasticity(2.1e5, 0.3)  # N/mm²
        >>> floor = RigidPlane((0, 0, 0), (0, 0, 1))
        >>> scene = Scene(
        ...     bodies={"block": Body(block((0, 0, 0), (2, 1, 1), (4, 2, 2)), steel)},  # mm
        ...     supports=[Support("block", "x0")],
        ...     loads=[Traction("block", "z1", (0.0, 0.0, -500.0))],  # N/mm²
        ...     contacts=[ContactPair(Surface("block", "z0"), floor, Coulomb(0.3))],
        ... )
        >>> [effect.name.value for effect in scene.effects()]
        ['elasticity', 'prescribed displacement', 'surface load', 'contact', 'Coulomb friction']
    """

    def __post_init__(self) -> None:
        """Check the parts, and find the contact pairs if that is wanted."""
        super().__post_init__()
        if isinstance(self.contacts, AutomaticContact):
            bodies, pairs = self.contacts.found(self)
            object.__setattr__(self, "bodies", bodies)
            object.__setattr__(self, "contacts", pairs)
            super().__post_init__()
        object.__setattr__(self, "contacts", with_discretisation(self, self.contacts))
        object.__setattr__(self, "ties", with_discretisation(self, self.ties))

    def partition(self, ranks: int = 1) -> dict[str, np.ndarray]:
        """Cut every body into subdomains of a suitable size.

        Args:
            ranks: Number of ranks that need a subdomain each.

        Returns:
            Body name -> subdomain of every cell, numbered from 0 within the body.
        """
        each = -(-ranks // len(self.bodies))
        return {name: default_partition(body.mesh, each, body=name) for name, body in self.bodies.items()}

    @property
    def is_nonlinear(self) -> bool:
        """Whether some material's stress is no linear function of the displacement."""
        return any(is_nonlinear(each) for body in self.bodies.values() for each in body.materials)

    def _facts(self) -> dict[str, Any]:
        return {
            "bodies": {name: body.in_words for name, body in self.bodies.items()},
            "nodes": f"{sum(body.mesh.n_nodes for body in self.bodies.values())} in {self.dim} dimensions",
            "supports": [support.in_words for support in self.supports],
            "loads": [
                f"{type(load).__name__} {load.body} {getattr(load, 'surface', '')}".rstrip()
                for load in self.loads
            ],
            "contacts": [
                f"{pair.place}, {pair.friction or 'without friction'}, {pair.given_gap}".removesuffix(", ")
                for pair in self.contacts
            ],
            "ties": [tie.place for tie in self.ties],
        }

    def effects(self) -> tuple[Effect, ...]:
        """List the effects in the scene; only what these need is built."""
        return effects_of(self)

    def plan(
        self,
        partitions: Mapping[str, np.ndarray] | None = None,
        *,
        ranks: int = 1,
        sensitivity: bool = False,
    ) -> Plan:
        """Return what will be built: unknowns, multipliers, solver, memory.

        Args:
            partitions: Body name -> subdomain of every cell; by default what `partition` returns.
            ranks: Number of ranks, if the partition is left open.
            sensitivity: Whether derivatives by the shape are wanted.

        Example:
            >>> print(scene.plan())  # doctest: +SKIP
        """
        cut = self.partition(ranks) if partitions is None else partitions
        return make_plan(self, cut, sensitivity=sensitivity)

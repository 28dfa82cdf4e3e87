"""What is known at the nodes and cells of bodies: all that pictures, pages and files ask of a result."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from fenics_contact._base.libraries import MPI
from fenics_contact._scene.scene import Scene
from fenics_contact.errors import collectively
from fenics_contact.results.fields import GatheredFields

if TYPE_CHECKING:
    import dolfinx
    import pyvista

    from fenics_contact.results.tools import ToolResult


class OnBodies(ABC):
    """A result with fields on bodies, such as a `State`."""

    @property
    @abstractmethod
    def comm(self) -> MPI.Comm:
        """The communicator of the ranks that know it."""

    @property
    @abstractmethod
    def geometry(self) -> Scene:
        """The scene that has its meshes, surfaces and obstacles."""

    @property
    def time(self) -> float:
        """The time at which obstacles that move are where they are: with small displacements zero."""
        return 0.0

    @property
    def unit_names(self) -> dict[str, str]:
        """Names of its units that are not those of `pictures.Units`."""
        return {}

    def tools(self) -> dict[str, ToolResult]:
        """Return where rigid tools are, by name. Collective."""
        return {}

    @abstractmethod
    def gather_fields(self, body: str) -> GatheredFields:
        """Return all fields of a body on every rank. Collective."""

    @abstractmethod
    def functions(self, body: str) -> list[dolfinx.fem.Function]:
        """Return the fields of a body that are spread over the ranks, on one mesh. Collective."""

    @collectively("to_pyvista", lambda self, *_, **__: self.comm)
    def to_pyvista(
        self, deformed: float = 0.0, *, linear: bool = False, revolved: float = 0.0
    ) -> pyvista.MultiBlock:
        """Return all bodies with their fields for pyvista, the same on every rank. Collective.

        Args:
            deformed: Scale factor of the displacement added to the points; 0 for the undeformed bodies.
            linear: Cut quadratic cells into linear ones on the same nodes, as `pictures` do.
            revolved: Angle in degrees by which the sections of bodies of revolution are turned around their
                axis, then that of z, into linear cells of space with vectors and stresses there; 0 leaves
                the sections.

        Returns:
            A ``pyvista.MultiBlock`` with an ``UnstructuredGrid`` for each body under its name, which holds
            the fields of `gather_fields`, which `write_vtu` writes: of a state on points ``displacement``,
            stresses ``nodal_...`` and contact ``contact_...``, on cells ``von_mises``, ``stress``,
            ``principal_stress`` and ``subdomain``. Plane bodies lie in the plane z = 0.

        Raises:
            InvalidInputError: If ``deformed`` is not finite, or other bodies are to be turned, or further
                than 360 degrees.
            MissingRequirementError: If pyvista is not installed.

        Example:
            >>> blocks = state.to_pyvista(deformed=10.0)  # doctest: +SKIP
            >>> blocks["block"].plot(scalars="von_mises")  # doctest: +SKIP
        """
        from fenics_contact.results.multi_block import multi_block

        meshes = {name: body.mesh for name, body in self.geometry.deforming.items()}
        if not revolved:
            return multi_block(self.comm, meshes, self.gather_fields, deformed, linear=linear)
        from fenics_contact.results.revolved import check_turned, turned_around

        check_turned(revolved, self.geometry.axisymmetric)
        blocks = multi_block(self.comm, meshes, self.gather_fields, deformed, linear=True)
        for name in meshes:
            blocks[name] = turned_around(blocks[name], revolved)
        return blocks

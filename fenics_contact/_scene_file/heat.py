"""Scene files with the section [heat]: bodies that conduct."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from fenics_contact._scene_file.reading import Builder, SceneFile, made_of
from fenics_contact.errors import together

if TYPE_CHECKING:
    from fenics_contact._scene_file.heat_tables import HeatDocument
    from fenics_contact.heat.scene import HeatScene
    from fenics_contact.heat.state import HeatState


class _HeatBuilder(Builder):
    """Builds what conducts, part by part."""

    def heat(self) -> HeatScene:
        """Return the scene of heat. Collective."""
        from fenics_contact.heat.scene import ConductingBody, HeatScene

        document: Any = self._document
        shapes, bodies, materials = self.shapes(), dict[str, Any](), dict[str, Any]()
        for name, each in document.heat.materials.items():
            with self._at("heat", "materials", name):
                materials[name] = each.made()
        self._check()
        for name, part in document.bodies.items():
            with self._at("bodies", name):
                mesh, material = self._part_of(name, part, shapes[part.mesh]).mesh, part.heat.material
                of = made_of(material, materials)
                bodies[name] = ConductingBody(mesh, of, part.axisymmetric, part.heat.thickness)
        self._check()
        self._check_surfaces(bodies)
        found: dict[str, list[Any]] = {"held": [], "loads": [], "contacts": [], "ties": []}
        for key, made in found.items():
            for number, each in enumerate(getattr(document.heat, key)):
                with self._at("heat", key, number):
                    one: Any = {key: [each.made()]}
                    HeatScene(bodies, **one)  # rejects what does not suit the bodies
                    made += one[key]
        self._check()
        return HeatScene(bodies, **found)


@dataclass(frozen=True, eq=False)
class HeatFile(SceneFile):
    """A scene file of heat alone; its scene is a `HeatScene`, its states are those of heat."""

    document: HeatDocument
    steps = ()  # type: ignore[assignment]

    @classmethod
    def documents(cls) -> type[HeatDocument]:
        """Return the form of its data."""
        from fenics_contact._scene_file.heat_tables import HeatDocument

        return HeatDocument

    @cached_property
    def scene(self) -> HeatScene:  # type: ignore[override]
        """The scene. Collective on first use."""
        return _HeatBuilder(self.source, self._complete, self.comm).heat()

    @cached_property
    def partitions(self) -> dict[str, np.ndarray]:
        """Body name -> subdomain of every cell. Collective on first use."""
        field = self.scene.field
        with self._at("solver", "subdomains"), together(self.comm):
            return self.document.solver.cut(field, self.comm.size)

    def solve(self) -> HeatState:  # type: ignore[override]
        """Compute the temperatures. Collective.

        Raises:
            InfeasibleError: If nothing gives a temperature to a body.
            ConvergenceError: If a solver does not reach its tolerance.
        """
        from fenics_contact.heat.problem import solve_heat

        with self._at("heat"):
            return solve_heat(self.scene, self.comm, partitions=self.partitions, **self.document.solver.fixed)

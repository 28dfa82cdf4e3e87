"""What all loads answer, and those on surfaces."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Self, cast

import numpy as np

from fenics_contact._scene.body import Body
from fenics_contact._scene.effects import EffectName
from fenics_contact._scene.fields import OfPosition, Ufl
from fenics_contact._scene.part import Around, Part
from fenics_contact.mesh.body_mesh import BodyMesh


class LoadPart(Part):
    """What all loads answer.

    Attributes:
        body: Name of the body.
        value: What it is, numbers, a function of points or `Ufl`.
    """

    body: str
    value: Any
    #: What its form is called.
    kind = "surface load"
    #: Whether it acts by the areas of a surface, through materials, or as a field constant on cells.
    on_surface = by_materials = by_cell = False
    #: Whether its value is one number.
    is_scalar = False

    @property
    def on_region(self) -> str:
        """Name of the region of its body on which alone it acts, empty if there is none."""
        return ""

    @property
    def is_function(self) -> bool:
        """Whether its value is a function of points."""
        return callable(self.value)

    @property
    def function(self) -> OfPosition:
        """Its value, if that is a function of points."""
        return cast("OfPosition", self.value)

    @property
    def is_ufl(self) -> bool:
        """Whether its value is written in UFL."""
        return isinstance(self.value, Ufl)

    @property
    def numbers(self) -> tuple[float, ...]:
        """Its value if it is given by numbers, else nothing."""
        return () if self.is_function or self.is_ufl else tuple(np.atleast_1d(self.value).tolist())

    @property
    def in_words(self) -> str:
        """What acts where."""
        return f"{type(self).__name__} {self.body}"

    def in_regions(self, regions: Iterable[str]) -> tuple[Self, ...]:
        """Return it region by region, if it acts on the volume of all of its body."""
        return (self,)

    def width(self, components: int) -> tuple[int, ...]:
        """Return the shape of its value at a point of a body with so many components of displacement."""
        return () if self.is_scalar else (components,)

    def nodes_in(self, mesh: BodyMesh) -> np.ndarray:
        """Return the nodes of the mesh of its body on which it acts, ascending."""
        return np.arange(mesh.n_nodes)

    def resultant(self, body: Body) -> np.ndarray | None:
        """Return its resultant, [force]; None where no numbers give it, or the body has a thickness."""
        return None if body.has_thickness or not self.numbers else self._total(body, np.array(self.value))

    def _total(self, body: Body, value: np.ndarray) -> np.ndarray:
        """Return the resultant of a value."""
        return value

    @property
    def at_points(self) -> tuple[Any, ...]:
        """The load, if it acts at single nodes."""
        return ()

    @property
    def temperatures(self) -> tuple[Any, ...]:
        """The load, if it is a change of temperature."""
        return ()

    @property
    def stresses(self) -> tuple[Any, ...]:
        """The load, if it is an initial stress."""
        return ()

    def following(self, scene: Around) -> tuple[Any, ...]:
        """Return the load if it follows its surface."""
        return ()


class RegionLoad(LoadPart):
    """What acts on the volume of a body, or of a region of it.

    Attributes:
        region: Name of the region of the mesh of its body.
    """

    region: str | None

    @property
    def on_region(self) -> str:
        """Name of the region of its body on which alone it acts, empty if there is none."""
        return self.region or ""

    def in_regions(self, regions: Iterable[str]) -> tuple[Self, ...]:
        """Return it region by region, if it acts on all of its body."""
        return (self,) if self.on_region else tuple(replace(self, region=each) for each in regions)  # type: ignore[type-var]


class SurfaceLoad(LoadPart):
    """What acts on a surface.

    Attributes:
        surface: Name of the surface of its body.
    """

    surface: str
    effect = EffectName.SURFACE_LOAD
    on_surface = True

    @property
    def in_words(self) -> str:
        """What acts where."""
        return f"{super().in_words} {self.surface}"

    def nodes_in(self, mesh: BodyMesh) -> np.ndarray:
        """Return the nodes of its surface, ascending."""
        return mesh.nodes_of(self.surface)

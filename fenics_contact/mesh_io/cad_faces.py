"""The faces of a CAD model: their kinds, sizes and places."""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType

import numpy as np

from fenics_contact.display import displayed
from fenics_contact.mesh_io.gmsh_geometry import shape_seen
from fenics_contact.surface_shapes import Circle, Cylinder, Plane, Sphere, SurfaceShape, Torus

#: Names of kinds of faces (dimension 2) and of curves (1).
_KINDS: dict[type, dict[int, str]] = {
    Plane: {2: "plane", 1: "line"},
    Cylinder: {2: "cylinder"},
    Sphere: {2: "sphere"},
    Circle: {1: "circle"},
    Torus: {2: "torus"},
}


@displayed
@dataclass(frozen=True, eq=False)
class CadFace:
    """A face of a CAD model, of a plane part a curve.

    Attributes:
        number: Its number in gmsh.
        name: Its name in the file, without a name its number as text.
        kind: "plane", "cylinder", "sphere", "torus", of a plane part "line" or "circle", else gmsh's word for
            its surface.
        area: Area, of a curve the length; NaN if another kernel than Open CASCADE built it.
        centroid: Centre of mass, NaN likewise, (3,), [length].
        lower: Least coordinates, (3,), [length].
        upper: Largest coordinates, (3,), [length].
        shape: Its true shape if it is one of those kinds; the side of the body is not known.
        near: Distance up to which places on the model count as the same, [length].
    """

    number: int
    name: str
    kind: str
    area: float
    centroid: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    shape: SurfaceShape | None
    near: float

    @property
    def radius(self) -> float | None:
        """Radius of a cylinder, sphere or circle."""
        return self.shape.radius if isinstance(self.shape, Cylinder | Sphere) else None

    @property
    def in_words(self) -> str:
        """One line: ``7 'bore' (cylinder, radius 2, area 62.83, centroid (5, 10, 2.5))``."""
        facts = [self.kind]
        if self.radius is not None:
            facts.append(f"radius {self.radius:.6g}")
        if np.isfinite(self.area):
            place = ", ".join(f"{x:.4g}" for x in np.round(self.centroid, 9) + 0.0)
            facts.append(f"area {self.area:.4g}, centroid ({place})")
        name = "" if self.name == str(self.number) else f" {self.name!r}"
        return f"{self.number}{name} ({', '.join(facts)})"


def faces_of(gmsh: ModuleType, dim: int) -> list[CadFace]:
    """Return the faces (dimension 2), of a plane part the curves (1), of gmsh's current model."""
    box = np.array(gmsh.model.getBoundingBox(-1, -1))
    near = 1e-6 * float(np.linalg.norm(box[3:] - box[:3]))
    return [_face(gmsh, (dim, int(tag)), near) for _, tag in gmsh.model.getEntities(dim)]


def name_of(gmsh: ModuleType, dim: int, tag: int) -> str:
    """Return the name of an entity in its file, else its number as text."""
    name = str(gmsh.model.getEntityName(dim, tag)).rpartition("/")[2]
    # The library that writes STEP files calls everything "Open CASCADE ...".
    return str(tag) if not name or name.startswith("Open CASCADE") else name


def _face(gmsh: ModuleType, entity: tuple[int, int], near: float) -> CadFace:
    shape = shape_seen(gmsh, entity)
    try:
        area, centroid = gmsh.model.occ.getMass(*entity), gmsh.model.occ.getCenterOfMass(*entity)
    except Exception:  # gmsh raises no other class; entities of its own kernel have no mass
        area, centroid = np.nan, (np.nan,) * 3
    box = np.array(gmsh.model.getBoundingBox(*entity))
    kind = _KINDS.get(type(shape), {}).get(entity[0], gmsh.model.getType(*entity).lower())
    name = name_of(gmsh, *entity)
    return CadFace(entity[1], name, kind, float(area), np.array(centroid), box[:3], box[3:], shape, near)

"""How the scene is solved: solver, tolerance, subdomains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, PlainValidator, WithJsonSchema

from fenics_contact.contact.equilibrium import default_solver
from fenics_contact.geometry import box_partition, graph_partition
from fenics_contact.qp import DualSolver, FaceNewton, ProjectedCG, Smalse
from fenics_contact.scene import Scene, choose_solver
from fenics_contact.scene_file.values import Part, is_number, needs

if TYPE_CHECKING:
    from fenics_contact.contact.tolerance import Tolerance

BALANCED = "balanced"


def _tolerance(value: Any) -> float | str:
    if value == BALANCED:
        return BALANCED
    if not is_number(value) or not 0.0 < value < 1.0:
        raise needs(f'a number between 0 and 1, or "{BALANCED}"')
    return float(value)


def _is_count(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value > 0


def _is_cut(value: object) -> bool:
    boxes = isinstance(value, list | tuple) and len(value) in (2, 3) and all(map(_is_count, value))
    return boxes or _is_count(value)


def _subdomains(value: Any) -> Any:
    if value == "auto" or _is_cut(value):
        return tuple(value) if isinstance(value, list) else value
    if isinstance(value, Mapping) and value and all(map(_is_cut, value.values())):
        return {name: tuple(cut) if isinstance(cut, list) else cut for name, cut in value.items()}
    raise needs(
        '"auto", a positive integer, three integers in brackets (boxes of a structured mesh; two in the '
        "plane), or a table: body = integer or boxes"
    )


_COUNT: dict[str, Any] = {"type": "integer", "minimum": 1}
_CUT: dict[str, Any] = {"anyOf": [_COUNT, {"type": "array", "items": _COUNT, "minItems": 2, "maxItems": 3}]}
_CUTS = {"anyOf": [{"const": "auto"}, *_CUT["anyOf"], {"type": "object", "additionalProperties": _CUT}]}
_TOLERANCE = {
    "anyOf": [{"const": BALANCED}, {"type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1}]
}


class SolverPart(Part):
    """How the scene is solved; everything has a default."""

    method: Literal["auto", "face_newton", "smalse", "projected_cg"] = Field(
        default="auto", description="dual solver; auto takes the one that suits the scene"
    )
    tolerance: Annotated[float | str, PlainValidator(_tolerance), WithJsonSchema(_TOLERANCE)] = Field(
        default=BALANCED,
        description="largest relative residual, or balanced: as accurate as the mesh deserves",
    )
    max_products: int | None = Field(
        default=None, ge=1, description="give up after that many products with F"
    )
    subdomains: Annotated[Any, PlainValidator(_subdomains), WithJsonSchema(_CUTS)] = Field(
        default="auto",
        description="subdomains of every body, or by body: a number, or boxes of a structured mesh",
    )

    def accuracy(self) -> Tolerance:
        """Return the tolerance as solvers take it."""
        if isinstance(self.tolerance, float):
            return self.tolerance
        from fenics_contact.accuracy import Balanced  # a fixed tolerance does not load it

        return Balanced()

    def chosen(self, scene: Scene, partitions: Mapping[str, np.ndarray]) -> DualSolver | None:
        """Return the dual solver that the keys ask for, None for the default one."""
        kinds: dict[str, DualSolver] = {
            "face_newton": FaceNewton(),
            "smalse": Smalse(),
            "projected_cg": ProjectedCG(),
        }
        solver = kinds.get(self.method)
        if self.max_products is None:
            return solver
        if solver is None:
            subdomains = sum(int(part.max()) + 1 for part in partitions.values())
            solver = default_solver(choose_solver(scene, subdomains))
        return replace(solver, max_products=self.max_products)  # type: ignore[type-var]

    def cut(self, scene: Scene, ranks: int) -> dict[str, np.ndarray]:
        """Cut every body into subdomains, body name -> subdomain of every cell.

        Args:
            scene: The scene.
            ranks: Number of ranks, each of which needs a subdomain where the number is left open.

        Raises:
            InvalidInputError: If a body has fewer cells than subdomains or is not structured.
        """
        asked = self.subdomains if isinstance(self.subdomains, Mapping) else {}
        everywhere = None if asked or self.subdomains == "auto" else self.subdomains
        parts = {} if everywhere or set(asked) >= set(scene.bodies) else scene.partition(ranks)
        for name, body in scene.bodies.items():
            cut = asked.get(name, everywhere)
            if isinstance(cut, tuple):
                parts[name] = box_partition(body.mesh, cut)
            elif cut is not None:
                parts[name] = graph_partition(body.mesh, cut, name)
        return parts

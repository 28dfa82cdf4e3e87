"""How the scene is solved: solver, tolerance, subdomains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Field, PositiveInt

from fenics_contact.contact import default_solver
from fenics_contact.errors import InvalidInputError
from fenics_contact.partition import box_partition, graph_partition
from fenics_contact.qp import DualSolver, FaceNewton, ProjectedCG, Smalse
from fenics_contact.scene import Scene, choose_solver
from fenics_contact.scene_file.newton import NewtonPart
from fenics_contact.scene_file.part import Part
from fenics_contact.scene_file.values import Read, with_message

if TYPE_CHECKING:
    from fenics_contact.contact import Tolerance
    from fenics_contact.nonlinear import AutomaticSteps

BALANCED = "balanced"


_TOLERANCES = with_message(f'a number between 0 and 1, or "{BALANCED}"')
_Tolerance = Annotated[Annotated[float, Field(gt=0, lt=1)] | Literal["balanced"], _TOLERANCES]
_Boxes = Annotated[list[PositiveInt], Field(min_length=2, max_length=3, strict=False), AfterValidator(tuple)]
_ByBody = Annotated[dict[str, PositiveInt | _Boxes], Field(min_length=1)]
_CUTS = with_message(
    '"auto", a positive integer, three integers in brackets (boxes of a structured mesh; two in the plane), '
    "or a table: body = integer or boxes"
)
_Cuts = Annotated[Literal["auto"] | PositiveInt | _Boxes | _ByBody, _CUTS]


class SolverPart(Part):
    """How the scene is solved; everything has a default."""

    method: Literal["auto", "face_newton", "smalse", "projected_cg"] = Field(
        default="auto", description="dual solver; auto takes the one that suits the scene"
    )
    tolerance: Annotated[float | str, Read(_Tolerance)] = Field(
        default=BALANCED,
        description="largest relative residual, or balanced: as accurate as the mesh deserves",
    )
    max_products: PositiveInt | None = Field(
        default=None, description="give up after that many products with F"
    )
    newton: NewtonPart | None = Field(
        default=None, description="how loads on nonlinear materials are followed, in parts"
    )
    subdomains: Annotated[Any, Read(_Cuts)] = Field(
        default="auto",
        description="subdomains of every body, or by body: a number, or boxes of a structured mesh",
    )

    def accuracy(self, scene: Scene) -> Tolerance:
        """Return the tolerance for solvers; None, their own, where errors of the mesh are not estimated."""
        if scene.is_nonlinear and "tolerance" not in self.model_fields_set:
            return None
        if isinstance(self.tolerance, float):
            return self.tolerance
        from fenics_contact.accuracy import BalancedTolerance  # not imported for a fixed tolerance

        return BalancedTolerance()

    def chosen(self, scene: Scene, partitions: Mapping[str, np.ndarray]) -> DualSolver | None:
        """Return the dual solver given by the keys, None for the default one.

        Raises:
            InvalidInputError: If one is given for nonlinear materials, whose Newton's method has its own.
        """
        if scene.is_nonlinear and (self.method != "auto" or self.max_products is not None):
            raise InvalidInputError(
                "method and max_products are for linear materials, this scene has others, which Newton's "
                f"method solves, got method {self.method!r} and max_products {self.max_products}: leave them "
                "out, or set 'newton'"
            )
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

    def following(self, scene: Scene) -> AutomaticSteps | None:
        """Return how loads on nonlinear materials are followed, None for the default.

        Raises:
            InvalidInputError: If it is given for linear materials, or its parts contradict each other.
        """
        if self.newton is None:
            return None
        if not scene.is_nonlinear:
            keys = ", ".join(sorted(self.newton.model_fields_set)) or "no key"
            raise InvalidInputError(
                f"newton is for nonlinear materials, all of this scene are linear, got {keys}: leave it out"
            )
        return self.newton.made()

    def cut(self, scene: Scene, ranks: int) -> dict[str, np.ndarray]:
        """Cut every body into subdomains, body name -> subdomain of every cell.

        Args:
            scene: The scene.
            ranks: Number of ranks, each of which needs a subdomain if no number is given.

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

"""How Newton's method follows the load of nonlinear materials."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field, PositiveInt

from fenics_contact.scene_file.part import Part

if TYPE_CHECKING:
    from fenics_contact.nonlinear import AutomaticSteps


class NewtonPart(Part):
    """How the load of a load step is followed in parts, which are halved where Newton's method fails."""

    first: float | None = Field(
        default=None, gt=0, le=1, description="first part of a load step that is tried, the whole by default"
    )
    smallest: float | None = Field(
        default=None,
        gt=0,
        le=1,
        description="smallest part; one that fails ends the run with what is reached",
    )
    snaps: bool | None = Field(
        default=None,
        description="whether bodies without an equilibrium near move on through a viscous medium to the next "
        "one, false by default",
    )
    finer_history: bool | None = Field(
        default=None,
        description="whether each part is a step of its own for slip and histories of materials, false by "
        "default: a load step is one step of them, however it is followed",
    )
    max_steps: PositiveInt | None = Field(
        default=None, description="Newton steps after which a part is halved"
    )
    max_products: PositiveInt | None = Field(
        default=None, description="products with F of one Newton step at most"
    )

    def made(self) -> AutomaticSteps:  # type: ignore[override]
        """Return the load steps of Python; raises as `AutomaticSteps` does."""
        from fenics_contact.nonlinear import AutomaticSteps, TangentNewton  # not for linear materials

        given = self.model_dump(exclude_none=True)
        of_parts = ("first", "smallest", "snaps", "finer_history")
        parts = {name: given.pop(name) for name in of_parts if name in given}
        return AutomaticSteps(TangentNewton(**given), **parts)

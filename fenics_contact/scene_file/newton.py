"""How Newton's method follows the load of nonlinear materials."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field, PositiveInt

from fenics_contact.scene_file.part import Part

if TYPE_CHECKING:
    from fenics_contact.nonlinear import AutomaticSteps


class NewtonPart(Part):
    """How the load of a load step is followed in parts, which are halved where Newton's method fails."""

    first: float = Field(1.0, gt=0, le=1, description="first part of a load step that is tried")
    smallest: float = Field(
        1.0 / 256, gt=0, le=1, description="smallest part; one that fails ends the run with what is reached"
    )
    max_steps: PositiveInt = Field(25, description="Newton steps after which a part is halved")
    max_products: PositiveInt = Field(400, description="products with F of one Newton step at most")

    def made(self) -> AutomaticSteps:  # type: ignore[override]
        """Return the load steps of Python; raises as `AutomaticSteps` does."""
        from fenics_contact.nonlinear import AutomaticSteps, TangentNewton  # not for linear materials

        newton = TangentNewton(max_steps=self.max_steps, max_products=self.max_products)
        return AutomaticSteps(newton, self.first, self.smallest)

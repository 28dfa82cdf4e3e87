"""Displacements that are prescribed."""

from __future__ import annotations

from pydantic import Field

from fenics_contact.scene import Support
from fenics_contact.scene_file.expression import Expression
from fenics_contact.scene_file.values import FREE, Components, Part


class SupportPart(Part):
    """Displacement prescribed on a surface, component by component."""

    name: str | None = Field(None, description="how load steps call it")
    body: str = Field(description="name of the body")
    surface: str = Field(description="name of its surface")
    value: Components | None = Field(
        None,
        description=f'displacement along x, y and z (x, y of a plane body), [length]: a number, "{FREE}", or '
        "a formula in x, y, z in quotes; zero in all directions by default",
    )

    def build(self, dim: int, value: tuple[float | str, ...] | None = None) -> Support:
        """Return the support.

        Args:
            dim: Dimension of the bodies.
            value: What a load step prescribes instead.
        """
        chosen = value or self.value or (0.0,) * dim
        return Support(self.body, self.surface, tuple(map(_component, chosen)))


def _component(value: float | str) -> float | Expression | None:
    if value == FREE:
        return None
    return Expression(value) if isinstance(value, str) else value

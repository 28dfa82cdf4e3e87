"""The accuracy that a scene file asks for: of which quantity, how small an error, and what it may cost."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, PositiveFloat, Tag

from fenics_contact._adaptive.levels import Limits
from fenics_contact._adaptive.quantities import QUANTITIES
from fenics_contact._scene_file.part import Part, keys_of
from fenics_contact._scene_file.values import MARK, Read, Vector, is_reference


def _form(value: Any) -> str:
    return f"{MARK}{'own' if is_reference(value) else 'name'}"


_Quantity = Annotated[
    Any,
    Read(
        Annotated[
            Annotated[Literal[tuple(QUANTITIES)], Tag(f"{MARK}name")]  # type: ignore[valid-type]
            | Annotated[str, Field(pattern=r"\.py:"), Tag(f"{MARK}own")],
            Discriminator(_form),
        ]
    ),
]


@keys_of(Limits)
class AccuracyPart(Part):
    """A quantity and its largest error: meshes are refined until an estimate of the error is below it."""

    quantity: _Quantity = Field("peak_pressure", description='its name, or "file.py:NAME", an Objective')
    relative_error: Annotated[float, Field(gt=0, lt=1)] = Field(
        description="largest error of the quantity relative to it, such as 0.01"
    )
    surface: str | None = Field(None, description='body and surface, "block top"; of a pair its slave')
    body: str | None = Field(None, description="name of a body; the only one needs none")
    at: Vector | None = Field(None, description="a place of the body, [length]")
    direction: Vector | None = Field(None, description="a direction, of any length")
    component: str | None = Field(None, description="von_mises, or xx, xy, ... of a stress")
    radius: PositiveFloat | None = Field(
        None, description="radius of the mean around a place, [length]; a twentieth of the body by default"
    )

    @property
    def where(self) -> dict[str, Any]:
        """What is given with the name of the quantity."""
        names = ("surface", "body", "at", "direction", "component", "radius")
        return {name: value for name in names if (value := getattr(self, name)) is not None}

    @property
    def in_words(self) -> str:
        """What is asked for, for a line of text."""
        return f"{self.quantity} to {100 * self.relative_error:.3g} %"


#: Keys of a scene file that cannot be kept where meshes are refined, and why.
NOT_REFINED = {
    ("steps",): "load steps have a history on their meshes, which solve_steps_to carries on in Python: leave "
    "[[steps]] out, or [accuracy]",
    ("solver", "subdomains"): "every mesh is cut anew: leave it out",
    ("solver", "newton"): "loads are followed in parts of the default size: leave it out",
}


def not_refined(document: Any) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield the keys of a document with an accuracy that cannot be kept, with what to do."""
    for path, words in NOT_REFINED.items():
        part = document
        for key in path[:-1]:
            part = getattr(part, key)
        if path[-1] in part.model_fields_set and getattr(part, path[-1]):
            yield path, words

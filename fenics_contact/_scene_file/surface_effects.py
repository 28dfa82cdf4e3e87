"""Tables of what acts between surfaces in contact: fluid that enters, and wear."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import Field

from fenics_contact._scene.fluid import FluidPressure
from fenics_contact._scene.pairs import ContactPair
from fenics_contact._scene.wear import Wear, WearTable
from fenics_contact._scene_file.part import Part, keys_of, table_of
from fenics_contact._scene_file.values import NotNegativeField, Read, field_or

_TABLE = field_or(table_of(WearTable), "{pressure = [...], coefficient = [...]}")


@keys_of(FluidPressure)
class FluidPart(Part):
    """Fluid that enters a contact as far as it is open."""

    enters: str = Field(description="surface of the slave's body with which the slave shares an edge")


@keys_of(Wear)
class WearPart(Part):
    """Wear by Archard's law: a contact loses depth k p per sliding distance."""

    coefficient: Annotated[Any, Read(_TABLE)] = Field(
        description="wear coefficient, [length²/force]; a table is linear between pressures, constant beyond"
    )
    sliding: NotNegativeField | None = Field(
        None, description="distance by which surfaces slide in each cycle, in place of their slip, [length]"
    )


def check_wear(made: ContactPair, nodes: np.ndarray) -> None:
    """Evaluate the wear of a pair at the slave's nodes."""
    for wear in made.wears:
        wear.factor_at(made.place, nodes)
        wear.distance_at(made.place, nodes, np.zeros(len(nodes)))

"""Sizes, places and partitions that must not matter, and what must be refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_contact import Body, LoadStep, RigidPlane, Scene, Support, Traction
from fenics_contact.errors import LoadStepError
from fenics_contact.gallery import rectangle
from fenics_contact.materials import NeoHooke, StVenantKirchhoff
from tests.hard.deformed.case import Case, States, case, displacement, ways
from tests.hard.deformed.materials import SOFT, rounded, top


def scaled(length: float, stress: float, shift: float = 0.0) -> Case:
    """A block pressed on a plane and dragged, in other units or elsewhere."""
    scene = rounded(NeoHooke(stress, 0.3), 0.3)
    mesh = scene.bodies["block"].mesh
    (pair,) = scene.contacts
    points = length * mesh.points + (shift, shift)
    scene = replace(
        scene,
        bodies={"block": Body(replace(mesh, points=points), NeoHooke(stress, 0.3))},
        contacts=[replace(pair, master=RigidPlane((shift, shift), (0.0, 1.0)))],
    )
    return Case(scene, ways(top(0.0, 0.2 * length), top(0.2 * length, 0.2 * length)))


def as_usual(length: float) -> dict[str, object]:
    def usual() -> np.ndarray:
        return length * displacement(scaled(1.0, 1.0).solve()[-1])

    return {"twins": {"in units of one": usual}}


@case
def a_millionth_of_a_metre_in_pascals() -> Case:
    return replace(scaled(1e-6, 1e6), **as_usual(1e-6))  # type: ignore[arg-type]


@case
def a_thousand_kilometres_in_pascals() -> Case:
    return replace(scaled(1e6, 1e11), **as_usual(1e6))  # type: ignore[arg-type]


@case
def a_block_ten_thousand_lengths_from_the_origin() -> Case:
    return replace(scaled(1.0, 1.0, 1e4), **as_usual(1.0), agreement=1e-5)  # type: ignore[arg-type]


@case
def a_block_cut_into_sixty_four_subdomains() -> Case:
    scene = rounded(SOFT, 0.3, cells=16)
    return Case(scene, ways(top(0.0, 0.2), top(0.2, 0.2)), pieces=64, other=1)


@case
def a_block_of_which_every_cell_is_a_subdomain() -> Case:
    scene = rounded(SOFT, 0.3, cells=6)
    return Case(scene, ways(top(0.0, 0.2), top(0.2, 0.2)), pieces=36, other=1)


@case
def displacements_of_a_ten_thousand_millionth() -> Case:
    """What is left after rounding of strains and gaps."""
    scene = rounded(SOFT, 0.3)

    def presses(states: States) -> None:
        assert states[-1].contact.normal_force.max() > 0.0

    return Case(scene, ways(top(0.0, 1e-10)), checks=presses, agreement=1e-4)


@case
def a_material_that_softens_under_pressure() -> Case:
    """St. Venant-Kirchhoff's energy gives way beyond a shortening of 42 %."""
    mesh = rectangle((0.0, 0.0), (1.0, 1.0), (4, 4))
    body = Body(mesh, StVenantKirchhoff(1.0, 0.3))
    loads = [Traction("block", "y1", (0.0, -1.0))]
    scene = Scene({"block": body}, [Support("block", "y0"), Support("block", "x0", (0.0, None))], loads)
    return Case(scene, [LoadStep("crush")], error=LoadStepError, match="can be followed up to")

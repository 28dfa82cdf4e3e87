"""The pairs of bodies, in units of the round body's radius and of the soft body's modulus; no friction.

The master is round, and its facets are felt by the nodes of a finer slave. A force presses both together.
Planes of symmetry leave a half of them in the plane, a quarter in space.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.true_surfaces.bodies import bar, pad, ring, seat, stamp
from fenics_contact import Body, BodyMesh, ContactPair, Scene, Support, Surface, TotalForce
from fenics_contact.gallery import half_cylinder
from fenics_contact.gallery.blocks import graded
from fenics_contact.materials import IsotropicElasticity, PlaneStrain
from fenics_contact.theory import contact_modulus, hertz_line, hertz_point, pin_in_hole

POISSON = 0.3
#: How much stiffer the round body is than what it is pressed on, so that its own coarse cells do not count.
CONTRAST = 1000.0
MODULUS = contact_modulus(1.0, POISSON, CONTRAST, POISSON)
#: Half width or radius of Hertz's contacts.
REACH = 0.1
#: Radius of seat or bush less that of ball or shaft.
CLEARANCE = 0.01
UPSIDE_DOWN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@dataclass(frozen=True)
class Model:
    """A scene and what theory says of it.

    Attributes:
        scene: The scene.
        peak: Peak pressure, or None where Hertz's theory does not hold.
        area: Area of contact of the part that is meshed, in the plane its length, or None.
    """

    scene: Scene
    peak: float | None = None
    area: float | None = None


def disc_on_block(facets: int, fineness: int = 1) -> Model:
    """A stiff disc on a block in plane strain."""
    force = np.pi * MODULUS * REACH**2 / 4
    exact = hertz_line(force, 1.0, MODULUS)
    block = Body(pad(2, 5.0, 40 * fineness, 5.0), PlaneStrain(1.0, POISSON))
    scene = Scene(
        {"disc": Body(stamp(2, facets), PlaneStrain(CONTRAST, POISSON)), "block": block},
        [Support("block", "y0", (0.0, 0.0)), *_symmetric("block", 2), *_symmetric("disc", 2)],
        [TotalForce("disc", "top", (0.0, -force / 2))],
        [ContactPair(Surface("block", "y1"), Surface("disc", "contact"), discretisation="node")],
    )
    return Model(scene, exact.peak_pressure, exact.half_width)


def ball_on_block(facets: int, fineness: int = 1) -> Model:
    """A stiff ball on a block."""
    force = 4 * MODULUS * REACH**3 / 3
    exact = hertz_point(force, (1.0, 1.0), MODULUS)
    scene = Scene(
        _stiff_and_soft("ball", stamp(3, facets), "block", pad(3, 1.5, 22 * fineness, 3.2)),
        [Support("block", "z0"), *_symmetric("block", 3), *_symmetric("ball", 3)],
        [TotalForce("ball", "top", (0.0, 0.0, -force / 4))],
        [ContactPair(Surface("block", "z1"), Surface("ball", "contact"), discretisation="node")],
    )
    return Model(scene, exact.peak_pressure, exact.area / 4)


def crossed_cylinders(facets: int, fineness: int = 1) -> Model:
    """A cylinder across a stiff one of the same radius."""
    force = 4 * MODULUS * REACH**3 / 3
    exact = hertz_point(force, (1.0, 1.0), MODULUS)
    lower = half_cylinder(1.0, 1.0, facets // 2, 4, grading=0.0).placed(UPSIDE_DOWN, np.zeros(3))
    turned = [Support("lower", "x0", (None, 0.0, None)), Support("lower", "y0", (0.0, None, None))]
    scene = Scene(
        _stiff_and_soft("lower", lower, "upper", bar(14 * fineness, 4.0)),
        [Support("lower", "top"), *turned, *_symmetric("upper", 3)],
        [TotalForce("upper", "top", (0.0, 0.0, -force / 4))],
        [ContactPair(Surface("upper", "contact"), Surface("lower", "contact"), discretisation="node")],
    )
    return Model(scene, exact.peak_pressure, exact.area / 4)


def ball_in_seat(facets: int, fineness: int = 1) -> Model:
    """A stiff ball in a seat, with a contact that reaches too far around for Hertz's theory."""
    socket = seat(1.0 + CLEARANCE + 1.5 * graded(8 * fineness, 2.5), 24 * fineness)
    scene = Scene(
        _stiff_and_soft("ball", stamp(3, facets), "seat", socket),
        [Support("seat", "base"), *_symmetric("seat", 3), *_symmetric("ball", 3)],
        [TotalForce("ball", "top", (0.0, 0.0, -5e-4))],
        [ContactPair(Surface("seat", "contact"), Surface("ball", "contact"), discretisation="node")],
    )
    return Model(scene)


def shaft_in_bush(facets: int, fineness: int = 1) -> Model:
    """A shaft in a bush of the same material in plane strain; the force acts in its middle.

    It starts half the clearance above the bush, which changes nothing, so that no facet cuts into it.
    """
    modulus = contact_modulus(1.0, POISSON, 1.0, POISSON)
    force = 0.7 * modulus * CLEARANCE
    exact = pin_in_hole(force, 1.0, CLEARANCE, modulus)
    count, hole = 70 * fineness, 1.0 + CLEARANCE
    shaft = ring(np.linspace(0.05, 1.0, count // 2 + 1), count)
    bush = ring(hole * 20.0 ** np.linspace(0.0, 1.0, 2 * facets + 1), facets)
    plane = PlaneStrain(1.0, POISSON)
    scene = Scene(
        {
            "shaft": Body(shaft.placed(np.eye(2), np.array([0.0, -CLEARANCE / 2])), plane),
            "bush": Body(bush, plane),
        },
        [Support("bush", "outer", (0.0, 0.0)), *_symmetric("bush", 2), *_symmetric("shaft", 2)],
        [TotalForce("shaft", "inner", (0.0, -force / 2))],
        [ContactPair(Surface("shaft", "outer"), Surface("bush", "inner"), discretisation="node")],
    )
    return Model(scene, exact.peak_pressure, exact.half_angle)


CASES: dict[str, Callable[..., Model]] = {
    "crossed cylinders": crossed_cylinders,
    "disc on a block": disc_on_block,
    "ball on a block": ball_on_block,
    "ball in a seat": ball_in_seat,
    "shaft in a bush": shaft_in_bush,
}


def _stiff_and_soft(stiff: str, round_: BodyMesh, soft: str, other: BodyMesh) -> dict[str, Body]:
    return {
        stiff: Body(round_, IsotropicElasticity(CONTRAST, POISSON)),
        soft: Body(other, IsotropicElasticity(1.0, POISSON)),
    }


def _symmetric(body: str, dim: int) -> list[Support]:
    """Hold the planes of symmetry."""
    return [
        Support(body, f"{axis}0", tuple(0.0 if other == axis else None for other in "xyz"[:dim]))
        for axis in "xyz"[: dim - 1]
    ]

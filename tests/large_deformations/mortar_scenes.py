"""Scenes of large deformations whose bodies meet by mortar."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    DeformedState,
    LoadStep,
    Scene,
    Support,
    Surface,
    solve_steps,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import NeoHooke
from tests.large_deformations.scenes import RUBBER


def by_mortar(scene: Scene) -> Scene:
    return replace(scene, contacts=[replace(pair, discretisation="mortar") for pair in scene.contacts])


def stacked(cells: str, depth: float, *, held: bool, friction: float) -> Scene:
    """Two cubes, or squares, on one another whose meshes do not match, pressed together.

    All sides glide on planes, or the sides away from two of them are free.
    """
    if cells in ("hexahedron", "tetrahedron"):
        low, high = (
            block((0, 0, 0), (1, 1, 1), (2, 3, 2), cells),
            block((0, 0, 1), (1, 1, 2), (3, 4, 2), cells),
        )
        top, under = "z1", "z0"
    else:
        low, high = (
            rectangle((0, 0), (1, 1), (4, 3), cells),
            rectangle((0, 1), (1, 2), (7, 5), cells),
        )
        top, under = "y1", "y0"
    dim = low.points.shape[1]

    def gliding(body: str, side: str, axis: int, value: float = 0.0) -> Support:
        return Support(body, side, tuple(value if a == axis else None for a in range(dim)))

    sides = [f"{'xy'[axis]}{end}" for axis in range(dim - 1) for end in range(2 if held else 1)]
    supports = [gliding(body, side, "xy".index(side[0])) for side in sides for body in ("low", "high")]
    supports += [gliding("low", under, dim - 1), gliding("high", top, dim - 1, -depth)]
    law = Coulomb(friction) if friction else None
    pair = ContactPair(Surface("high", under), Surface("low", top), law, "mortar")
    return Scene({"low": Body(low, RUBBER), "high": Body(high, RUBBER)}, supports, contacts=[pair])


def pressed_and_pushed(rotation: np.ndarray) -> list[Scene]:
    """A small stiff block with a round underside on a soft one, pressed and then drawn over its facets."""
    low = block((0, 0, 0), (2, 2, 1), (4, 4, 2))
    high = block((0.53, 0.57, 1), (1.53, 1.57, 1.6), (3, 3, 2))
    x, y, z = high.points.T
    bulge = 0.2 * ((x - 1.03) ** 2 + (y - 1.07) ** 2) * (1.6 - z) / 0.6
    high = replace(high, points=np.column_stack([x, y, z + bulge]))
    bodies = {
        name: Body(replace(mesh, points=mesh.points @ rotation.T), material)
        for name, mesh, material in (("low", low, NeoHooke(1.0, 0.3)), ("high", high, NeoHooke(5.0, 0.3)))
    }
    pair = ContactPair(Surface("high", "z0"), Surface("low", "z1"), Coulomb(0.3), "mortar")
    ways = ((0.0, 0.0, -0.12), (0.15, 0.06, -0.12))
    return [
        Scene(bodies, [Support("low", "z0"), Support("high", "z1", tuple(rotation @ way))], contacts=[pair])
        for way in ways
    ]


def followed(
    scenes: list[Scene], comm: MPI.Comm, tolerance: float = 1e-10, **given: object
) -> list[DeformedState]:
    """Return the states of successive scenes that differ in their supports."""
    steps = [LoadStep(str(number), supports=scene.supports) for number, scene in enumerate(scenes)]
    problem = ContactProblem(scenes[0], comm, tolerance=tolerance, **given)  # type: ignore[arg-type]
    states = solve_steps(problem, steps)
    assert all(isinstance(state, DeformedState) for state in states)
    return list(states)  # type: ignore[arg-type]

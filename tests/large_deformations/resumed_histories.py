"""Small load histories that are interrupted: rubber that is drawn, metal that yields."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from fenics_contact import (
    Body,
    ContactPair,
    ContactProblem,
    Coulomb,
    DeformedState,
    LoadSequence,
    LoadStep,
    Pressure,
    RigidSphere,
    Scene,
    Support,
    Surface,
    box_partition,
)
from fenics_contact.gallery import rectangle
from fenics_contact.materials import FinitePlasticity, NeoHooke

SOFT, HARD = NeoHooke(1.0, 0.32), NeoHooke(10.0, 0.32)


def drawn() -> tuple[Scene, list[LoadStep]]:
    """A round slider drawn over a soft bed, with a pressure that follows its side."""
    bed, slider = rectangle((0.0, 0.0), (4.0, 2.0), (16, 6)), rectangle((1.0, 2.0), (2.2, 3.0), (6, 4))
    x, y = slider.points.T
    rim = 2.0 + 0.3 * (x - 1.6) ** 2
    slider = replace(slider, points=np.column_stack([x, rim + (3.0 - rim) * (y - 2.0)]))

    def held(x: float, y: float) -> list[Support]:
        return [Support("bed", "y0"), Support("slider", "y1", (x, y))]

    scene = Scene(
        {"bed": Body(bed, SOFT), "slider": Body(slider, HARD)},
        held(0.0, 0.0),
        contacts=[ContactPair(Surface("slider", "y0"), Surface("bed", "y1"), Coulomb(0.3))],
    )
    wind = [Pressure("slider", "x0", 0.02)]
    places = (("press", 0.0, -0.2), ("slide", 0.3, -0.2), ("on", 0.6, -0.2))
    return scene, [LoadStep(name, wind, held(x, y)) for name, x, y in places]


def yielding() -> tuple[Scene, list[LoadStep]]:
    """A ball pressed into metal and withdrawn; large strains."""
    metal = FinitePlasticity(100.0, 0.3, 0.5, isotropic_hardening=2.0)
    body = Body(rectangle((0.0, 0.0), (1.0, 1.0), (8, 8)), metal)
    pair = ContactPair(Surface("block", "y1"), RigidSphere((0.5, 2.0), 1.0), Coulomb(0.2))
    scene = Scene({"block": body}, [Support("block", "y0")], contacts=[pair])
    steps = [
        LoadStep(f"{rise}", supports=[Support("block", "y0", (0.02 * rise, rise))])
        for rise in (0.03, 0.05, 0.06)
    ]
    return scene, steps


def problem(scene: Scene, comm: MPI.Comm = MPI.COMM_SELF) -> ContactProblem:
    parts = {name: box_partition(body.mesh, (2, 1)) for name, body in scene.bodies.items()}
    return ContactProblem(scene, comm, partitions=parts, tolerance=1e-9)


def advanced(sequence: LoadSequence, steps: Sequence[LoadStep]) -> DeformedState:
    state = [sequence.advance(step) for step in steps][-1]
    assert isinstance(state, DeformedState)
    return state

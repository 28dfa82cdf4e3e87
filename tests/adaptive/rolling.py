"""Load steps: a block rolls over a roller, so that its spot moves on, and a die presses one of metal."""

from __future__ import annotations

import numpy as np

from fenics_contact import (
    Body,
    ContactPair,
    Coulomb,
    LoadStep,
    RigidSphere,
    RigidSurface,
    Scene,
    State,
    Support,
    Surface,
    gallery,
    quantity,
)
from fenics_contact.design import Objective
from fenics_contact.materials import J2Plasticity, PlaneStrain

RADIUS, DEPTH = 400.0, 0.02


def block(across: int, high: int) -> Scene:
    """A long block on the roller, on a mesh that knows nothing of where they touch."""
    mesh = gallery.rectangle((-10.0, 0.0), (10.0, 4.0), (across, high))
    pair = ContactPair(Surface("block", "y0"), RigidSphere((0.0, -RADIUS), RADIUS), Coulomb(0.3))
    return Scene({"block": Body(mesh, PlaneStrain(1000.0, 0.3))}, contacts=[pair])


def rolled() -> list[LoadStep]:
    """Turned by small angles θ about the middle, so that the spot is at −R θ, and drawn along a little."""
    steps = []
    for number, angle in enumerate(0.014 * np.array([-1.0, 0.0, 1.0])):
        way = 0.003 * (number + 1), 0.5 * RADIUS * angle**2 - DEPTH
        top = RigidSurface("block", "y1", (0.0, 0.0), way, angle)
        steps.append(LoadStep(f"turned by {angle:g}", supports=[top]))
    return steps


def upwards(scene: Scene) -> Objective:
    """The force of the roller on the block."""
    return quantity("contact_force", rolled()[0].applied_to(scene), direction=(0, 1))


def pressed(n: int) -> tuple[Scene, list[LoadStep]]:
    """A metal block that is pressed onto a round die and then pulled along it."""
    mesh = gallery.rectangle((-4.0, 0.0), (4.0, 4.0), (2 * n, n))
    metal = J2Plasticity(1000.0, 0.3, 5.0, 20.0, mean_dilatation=True)
    die = RigidSphere((0.0, -10.0), 10.0)
    scene = Scene(
        {"block": Body(mesh, metal)}, contacts=[ContactPair(Surface("block", "y0"), die, Coulomb(0.2))]
    )
    ways = ((0.0, -0.05), (0.02, -0.1))
    return scene, [LoadStep(f"{way}", supports=[Support("block", "y1", way)]) for way in ways]


def forces(state: State) -> np.ndarray:
    """Return the sum of the contact forces, (dim,)."""
    return np.asarray(state.contact.force.sum(axis=0))

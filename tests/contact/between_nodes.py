"""Scenes whose contact is smaller than the cells of the slave, anywhere between its nodes."""

from __future__ import annotations

from typing import Any

import numpy as np

from fenics_contact import Body, ContactPair, RigidSphere, Scene, Support, Surface
from fenics_contact.gallery import rectangle
from fenics_contact.materials import NeoHooke, PlaneStrain

RADIUS, DEPTH = 10.0, 0.01  # mm


def pressed_on_disc(offset: float, cell: float = 1.0, *, rubber: bool = False, friction: Any = None) -> Scene:
    """Return a plate that is pressed onto a rigid disc, which meets it an offset beside a node, in cells."""
    layers = int(np.ceil(6.0 / cell))
    half = layers * cell
    mesh = rectangle((-half, 0.0), (half, 6.0), (2 * layers, layers))
    mesh = mesh.moved(mesh.points + np.array([offset * cell, 0.0]))
    body = Body(mesh, NeoHooke(5.0, 0.4) if rubber else PlaneStrain(2.1e5, 0.3))
    pair = ContactPair(Surface("plate", "y0"), RigidSphere((0.0, -RADIUS), RADIUS), friction)
    return Scene({"plate": body}, [Support("plate", "y1", (0.0, -DEPTH))], contacts=[pair])

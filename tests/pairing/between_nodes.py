"""Scenes whose contact is smaller than the cells of the slave, anywhere between its nodes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fenics_contact import (
    Body,
    ContactPair,
    MovingObstacle,
    RigidSphere,
    RigidTool,
    Scene,
    Support,
    Surface,
)
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, NeoHooke, PlaneStrain
from fenics_contact.shapes import Triangulation

RADIUS, DEPTH = 10.0, 0.01  # mm


def pressed_on_disc(
    offset: float, cell: float = 1.0, *, rubber: bool = False, friction: Any = None, material: Any = None
) -> Scene:
    """Return a plate that is pressed onto a rigid disc, which meets it an offset beside a node, in cells."""
    layers = int(np.ceil(6.0 / cell))
    half = layers * cell
    mesh = rectangle((-half, 0.0), (half, 6.0), (2 * layers, layers))
    mesh = mesh.moved(mesh.points + np.array([offset * cell, 0.0]))
    body = Body(mesh, material or (NeoHooke(5.0, 0.4) if rubber else PlaneStrain(2.1e5, 0.3)))
    pair = ContactPair(Surface("plate", "y0"), RigidSphere((0.0, -RADIUS), RADIUS), friction)
    return Scene({"plate": body}, [Support("plate", "y1", (0.0, -DEPTH))], contacts=[pair])


def on_tool(scene: Scene) -> Scene:
    """Return the scene on the same disc as a rigid tool."""
    tool = RigidTool("disc", RigidSphere((0.0, -RADIUS), RADIUS), at=(0.0, -RADIUS))
    return replace(scene, contacts=[replace(scene.contacts[0], master=tool)])


def met_by_disc(scene: Scene) -> Scene:
    """Return the scene in which the disc comes from below and moves as far into the plate."""
    below = RigidSphere((0.0, -RADIUS - DEPTH), RADIUS)
    disc = MovingObstacle(below, lambda time: (None, (0.0, 2.0 * DEPTH * time)))
    pair = replace(scene.contacts[0], master=disc)
    return replace(scene, supports=[Support("plate", "y1", (0.0, 0.0))], contacts=[pair])


STEEL = IsotropicElasticity(2.1e5, 0.3)


def pressed_on_ball(offset: tuple[float, float], half_width: float, master: Any = None, **pair: Any) -> Scene:
    """Return a block of unit cells pressed onto a ball, half a width of contact wide, offset in cells."""
    ball = RigidSphere((0.0, 0.0, -RADIUS), RADIUS) if master is None else master
    mesh = block((-4.5, -4.5, 0.0), (4.5, 4.5, 5.0), (9, 9, 5))
    mesh = mesh.moved(mesh.points + np.array([*offset, 0.0]))
    contact = ContactPair(Surface("plate", "z0"), ball, **pair)
    down = Support("plate", "z1", (0.0, 0.0, -(half_width**2) / RADIUS))
    return Scene({"plate": Body(mesh, STEEL)}, [down], contacts=[contact])


def hertz_on_ball(half_width: float) -> float:
    """Return Hertz's force of a ball on a half space, whose approach is a² / R."""
    modulus = 2.1e5 / (1.0 - 0.3**2)
    return 4.0 / 3.0 * modulus * half_width**3 / RADIUS


def ball_of_triangles(count: int = 40) -> Triangulation:
    """Return the ball as an STL file has it."""
    turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    height = np.linspace(-0.5 * np.pi, 0.5 * np.pi, count // 2 + 1)[1:-1]
    ring = np.array([(np.cos(h) * np.cos(t), np.cos(h) * np.sin(t), np.sin(h)) for h in height for t in turn])
    points = np.vstack([ring, [(0.0, 0.0, -1.0), (0.0, 0.0, 1.0)]]) * RADIUS - (0.0, 0.0, RADIUS)
    lower = np.arange(len(ring) - count).reshape(-1, count)
    along = np.roll(lower, -1, axis=1)
    sides = [np.stack([lower, along, along + count], -1), np.stack([lower, along + count, lower + count], -1)]
    first, last = np.arange(count), np.arange(count) + len(ring) - count
    caps = [
        np.stack([np.full(count, len(ring)), np.roll(first, -1), first], -1),
        np.stack([np.full(count, len(ring) + 1), last, np.roll(last, -1)], -1),
    ]
    return Triangulation(points, np.concatenate([*(side.reshape(-1, 3) for side in sides), *caps]))

"""Description of a scene as plain data for JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from typing import Any

from fenics_contact.io.json_file import plain
from fenics_contact.scene import Body, ContactPair, Material, MovingObstacle, Scene, Surface, Tie

#: Any value as plain data.
readable = partial(plain, lenient=True)


def described_scene(scene: Scene, subdomains: Mapping[str, int], time: float = 0.0) -> dict[str, Any]:
    """Return bodies, supports, loads and pairs of a scene as plain data.

    Returns:
        See `fenics_contact.io.write_result`. Functions are given by their names, numbers by their values.
    """
    return {
        "dimension": scene.dim,
        "bodies": {name: _body(body, subdomains[name]) for name, body in scene.bodies.items()},
        "supports": readable(scene.supports),
        "loads": readable(scene.loads),
        "contacts": [_pair(pair, time) for pair in scene.contacts],
        "ties": [_pair(tie, time) for tie in scene.ties],
    }


def _body(body: Body, subdomains: int) -> dict[str, Any]:
    mesh = body.mesh
    return {
        "cells": mesh.n_cells,
        "cell_type": mesh.cell_type,
        "nodes": mesh.n_nodes,
        "subdomains": subdomains,
        "box": [mesh.points.min(axis=0).tolist(), mesh.points.max(axis=0).tolist()],
        "material": _materials(body.material),
    }


def _materials(material: Material | Mapping[str, Material]) -> dict[str, Any]:
    if isinstance(material, Mapping):
        return {"regions": {region: _material(part) for region, part in material.items()}}
    return _material(material)


def _material(material: Material) -> dict[str, Any]:
    """Return the fields of a material, or its parameters if it is not a dataclass."""
    known = readable(material)
    return known if is_dataclass(material) else {**known, "parameters": readable(material.parameters)}


def _pair(pair: ContactPair | Tie, time: float) -> dict[str, Any]:
    entries = {part.name: readable(getattr(pair, part.name)) for part in fields(pair)}
    for side in ("slave", "master"):
        surface = getattr(pair, side)
        if isinstance(surface, Surface):
            entries[side] = {"body": surface.body, "surface": surface.name}
        if isinstance(surface, MovingObstacle):
            rotation, translation = surface.frame(time)
            moved = {"rotation": rotation.tolist(), "translation": translation.tolist()}
            entries[side] = {**entries[side], **moved}
    return entries

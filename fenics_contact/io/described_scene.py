"""What a scene consists of, in words and numbers that a JSON file can hold."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import partial
from typing import Any

import numpy as np

from fenics_contact.scene import Body, ContactPair, Load, Material, Scene, Support, Surface, Tie


def described_scene(scene: Scene, subdomains: Mapping[str, int]) -> dict[str, Any]:
    """Return bodies, supports, loads and pairs of a scene as plain data.

    Args:
        scene: The scene.
        subdomains: Body name -> number of its subdomains.

    Returns:
        See `fenics_contact.io.write_result`. Functions are told by their names, numbers as they are.
    """
    return {
        "dimension": scene.dim,
        "bodies": {name: _body(body, subdomains[name]) for name, body in scene.bodies.items()},
        "supports": [_part(support) for support in scene.supports],
        "loads": [_part(load) for load in scene.loads],
        "contacts": [_pair(pair) for pair in scene.contacts],
        "ties": [_pair(tie) for tie in scene.ties],
    }


def readable(value: Any) -> Any:
    """Return any value as plain data: dataclasses by type and fields, functions by name, NaN as None."""
    if isinstance(value, Enum):
        return readable(value.value)
    if isinstance(value, np.ndarray | np.generic):
        return readable(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, Mapping):
        return {str(key): readable(part) for key, part in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return {"type": type(value).__name__, **_fields(value)}
    if isinstance(value, Sequence) and not isinstance(value, bytes | bytearray):
        return [readable(part) for part in value]
    if isinstance(value, partial):
        return readable(value.func)
    return (
        {"function": value.__qualname__} if hasattr(value, "__qualname__") else {"type": type(value).__name__}
    )


def _fields(value: Any) -> dict[str, Any]:
    return {part.name: readable(getattr(value, part.name)) for part in fields(value)}


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
    """Return the fields of a material, or its parameters where it is no dataclass."""
    known = _fields(material) if is_dataclass(material) else {"parameters": readable(material.parameters)}
    return {"type": type(material).__name__, **known}


def _part(part: Support | Load) -> dict[str, Any]:
    return {"type": type(part).__name__, **_fields(part)}


def _pair(pair: ContactPair | Tie) -> dict[str, Any]:
    found = _fields(pair)
    for side in ("slave", "master"):
        surface = getattr(pair, side)
        if isinstance(surface, Surface):
            found[side] = {"body": surface.body, "surface": surface.name}
    return found

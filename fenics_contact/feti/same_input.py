"""Check that every rank has the same scene: numbers, topology, and values of functions."""

from __future__ import annotations

from typing import Any

import numpy as np

from fenics_contact._base.fingerprint import described, described_by_names, require_alike
from fenics_contact._base.libraries import MPI
from fenics_contact._scene.fields import evaluate
from fenics_contact._scene.loads import Load
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.supports import AnySupport
from fenics_contact.errors import together
from fenics_contact.errors.kinds import user_code


def check_same_input(comm: MPI.Comm, scene: Scene, **settings: Any) -> None:
    """Reject a scene or settings that differ from rank to rank. Collective on ``comm``.

    Compares hashes of all arrays, the text of all numbers, the parameters of materials, and values of
    functions of position at a few nodes; of other functions and objects only the names. One message of some
    bytes per rank; the cost is the hashing of the meshes.
    """
    if comm.size == 1:
        return
    with together(comm):
        descriptions = {**described_by_names(scene, "scene"), **_values(scene)}
        for name, value in settings.items():
            descriptions.update(described_by_names(value, name))
    require_alike(comm, descriptions)


def _values(scene: Scene) -> dict[str, str]:
    """Describe what the user's functions and materials return."""
    descriptions: dict[str, str] = {}
    for name, body in scene.bodies.items():
        for material in body.materials:
            kind = type(material).__name__
            with user_code(f"the parameters of material {kind}"):
                numbers = np.asarray(material.parameters, dtype=np.float64)
            descriptions.update(described(numbers.tolist(), f"parameters of {kind} in body {name!r}"))
    for number, support in enumerate(scene.supports):
        if support.varies:
            values = support.values(_some(support, scene))
            descriptions.update(described(values, f"scene.supports[{number}] at some nodes"))
    for number, load in enumerate(scene.loads):
        if load.is_function:
            name, shape = f"{type(load).__name__} on body {load.body!r}", load.width(scene.components)
            values = evaluate(name, load.function, _some(load, scene), shape)
            descriptions.update(described(values, f"scene.loads[{number}] at some nodes"))
    return descriptions


def _some(part: AnySupport | Load, scene: Scene, compared: int = 8) -> np.ndarray:
    """Return the coordinates of some nodes that a load or support acts on, shape (n, dim).

    `compared`: number of nodes at which functions are compared: different functions differ nearly everywhere.
    """
    mesh = scene.bodies[part.body].mesh
    nodes = part.nodes_in(mesh)
    return mesh.points[nodes[np.linspace(0, len(nodes) - 1, min(compared, len(nodes))).astype(int)]]

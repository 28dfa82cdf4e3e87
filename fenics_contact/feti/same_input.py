"""Check that every rank has the same scene: numbers, topology, and values of functions."""

from __future__ import annotations

from typing import Any

import numpy as np

from fenics_contact._base.fingerprint import described, require_alike
from fenics_contact._base.libraries import MPI
from fenics_contact._fem.load_forms import is_scalar
from fenics_contact._scene.fields import Ufl, evaluate
from fenics_contact._scene.loads import InitialStress, PointForce, SurfaceLoad
from fenics_contact._scene.scene import Scene
from fenics_contact._scene.supports import Roller, Support
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
        descriptions = {**described(scene, "scene", carried=False), **_values(scene)}
        for name, value in settings.items():
            descriptions.update(described(value, name, carried=False))
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
        if isinstance(support, Roller) and callable(support.displacement):
            values = support.amounts(_nodes(scene, support))
            descriptions.update(described(values, f"scene.supports[{number}] at some nodes"))
        if isinstance(support, Support) and any(callable(component) for component in support.value):
            values = support.values(_nodes(scene, support))
            descriptions.update(described(values, f"scene.supports[{number}] at some nodes"))
    for number, load in enumerate(scene.loads):
        if callable(load.value) and not isinstance(load.value, Ufl):
            points, width = _nodes(scene, load), 6 if isinstance(load, InitialStress) else scene.components
            shape = () if is_scalar(load) else (width,)
            values = evaluate(f"{type(load).__name__} on body {load.body!r}", load.value, points, shape)
            descriptions.update(described(values, f"scene.loads[{number}] at some nodes"))
    return descriptions


def _nodes(scene: Scene, part: Any, compared: int = 8) -> np.ndarray:
    """Return the coordinates of some nodes that a load or support acts on, shape (n, dim).

    `compared`: number of nodes at which functions are compared: different functions differ nearly everywhere.
    """
    mesh = scene.bodies[part.body].mesh
    nodes = np.arange(mesh.n_nodes)
    if isinstance(part, Support | Roller | SurfaceLoad | PointForce):
        nodes = mesh.nodes_of(part.nodes if isinstance(part, PointForce) else part.surface)
    return mesh.points[nodes[np.linspace(0, len(nodes) - 1, min(compared, len(nodes))).astype(int)]]

"""The fields of a state as plain arrays in the order of the bodies' meshes, the same on all ranks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fenics_contact.contact.cell_stress import components_of, principal, von_mises_of
from fenics_contact.contact.result import ContactResult
from fenics_contact.display import displayed
from fenics_contact.pairing import NodeNumbers
from fenics_contact.scene import Scene
from fenics_contact.surfaces import filled_at_corners


@displayed
@dataclass(frozen=True, eq=False)
class GatheredFields:
    """The fields of one body, replicated on all ranks.

    Attributes:
        points: Fields on nodes by their names: ``displacement``, (n_nodes, dim), [length], what
            `contact_fields` returns, and ``nodal_stress``, ``nodal_principal_stress`` and
            ``nodal_von_mises``, averaged around each node within one material, [force / length²]. Where
            materials meet they are those of the material in which the von Mises stress is largest.
        cells: Fields on cells: ``von_mises``, (n_cells,), ``stress``, the components xx, yy, zz, xy, yz, xz,
            (n_cells, 6), and ``principal_stress``, the largest first, (n_cells, 3), all means over the cell,
            [force / length²]; ``subdomain``, numbered over all bodies, (n_cells,) int.
    """

    points: dict[str, np.ndarray]
    cells: dict[str, np.ndarray]


def contact_fields(
    contact: ContactResult, scene: Scene, numbers: NodeNumbers, body: str
) -> dict[str, np.ndarray]:
    """Return the contact result of a body's surfaces as fields on all its nodes.

    Args:
        contact: Result on all contact surfaces.
        scene: The scene.
        numbers: Numbers of the nodes of all bodies.
        body: Name of the body.

    Returns:
        ``contact_status``, (n_nodes,) int: the value of `Status`, −1 on nodes that are not contact points;
        and, zero on those, ``contact_pressure``, (n_nodes,), [force / length²], ``contact_force`` on the
        slave and ``contact_slip``, (n_nodes, 3), [force] and [length]; where a body of the scene deforms much
        ``contact_nominal_pressure``, too. At the corners of quadratic triangles pressures and slip are
        interpolated, see `filled_at_corners`. A node that belongs to several pairs has
        their sum, and the status of the last.
    """
    start, end = numbers.node_offset[numbers.body_names.index(body) :][:2]
    count = int(end - start)
    nodes = contact.points.slave - start
    mine = np.flatnonzero((nodes >= 0) & (nodes < count))

    def summed(values: np.ndarray, filled: bool = False) -> np.ndarray:
        total = np.zeros((count, *values.shape[1:]))
        for pair in np.unique(contact.points.pair[mine]):
            field, own = np.zeros_like(total), mine[contact.points.pair[mine] == pair]
            field[nodes[own]] = values[own]
            facets = scene.bodies[body].mesh.surfaces[scene.contacts[pair].slave.name]
            total += filled_at_corners(facets, field) if filled else field
        return total

    status = np.full(count, -1, dtype=np.int32)
    status[nodes[mine]] = contact.status[mine]
    pressures = {"contact_pressure": contact.pressure}
    if scene.deforms_much:
        pressures["contact_nominal_pressure"] = contact.nominal_pressure
    return {
        "contact_status": status,
        **{name: np.maximum(summed(values, filled=True), 0.0) for name, values in pressures.items()},
        "contact_force": summed(contact.force),
        "contact_slip": summed(contact.slip_in_space, filled=True),
    }


def stress_fields(tensor: np.ndarray, prefix: str = "") -> dict[str, np.ndarray]:
    """Return components, principal values and von Mises stress of tensors, shape (n, 3, 3), by name.

    Von Mises stress of a mean is below the mean of von Mises stress.
    """
    return {
        f"{prefix}von_mises": von_mises_of(tensor),
        f"{prefix}stress": components_of(tensor),
        f"{prefix}principal_stress": principal(tensor),
    }


def most_stressed(by_material: np.ndarray) -> np.ndarray:
    """Return the stress of each node in the material with the largest von Mises stress there.

    A mean over materials would be the stress of none of them.

    Args:
        by_material: Shape (n_materials, n_nodes, 3, 3), NaN where a node has no cell of a material.

    Returns:
        Shape (n_nodes, 3, 3).
    """
    size = von_mises_of(by_material)
    chosen = np.where(np.isnan(size), -1.0, size).argmax(axis=0)
    return np.asarray(by_material[chosen, np.arange(by_material.shape[1])])


def in_space(values: np.ndarray) -> np.ndarray:
    """Give points and vectors of plane bodies, (n, 2), a third component that is zero; leave others alone."""
    plane = values.ndim == 2 and values.shape[1] == 2
    return np.pad(values, ((0, 0), (0, 1))) if plane else values

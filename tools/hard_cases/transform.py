"""The same scene written down otherwise: in other units, turned or mirrored, with other numbers of nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import is_dataclass, replace
from typing import Any

import numpy as np

from fenics_contact import (
    Body,
    BodyForce,
    BodyMesh,
    ClosureLaw,
    ClosureTable,
    ContactPair,
    Coulomb,
    ElasticFoundation,
    ExponentialClosure,
    FrictionTable,
    LinearClosure,
    LoadStep,
    Pressure,
    RigidCylinder,
    RigidPlane,
    RigidSphere,
    Roller,
    Scene,
    Support,
    ThermalStrain,
    TotalForce,
    Traction,
    Tresca,
)
from fenics_contact.mesh.faces import orient

#: Powers of length and force in the value of each load.
DIMENSIONS = {
    Traction: (-2, 1),
    Pressure: (-2, 1),
    TotalForce: (0, 1),
    BodyForce: (-3, 1),
    ThermalStrain: (0, 0),
}
MODULI = ("young_modulus", "young_moduli", "shear_modulus", "shear_moduli")


def in_units(scene: Scene, length: float, force: float) -> Scene:
    """Return the scene in other units: a length of 1 becomes ``length``, a force of 1 becomes ``force``.

    In the plane forces are per unit of thickness, which is one in the old units and in the new ones; those of
    bodies of revolution are per revolution.
    """
    dim = 3 if scene.axisymmetric else scene.dim
    area = length ** (dim - 1)
    bodies = {name: _body_in_units(body, length, force / area) for name, body in scene.bodies.items()}
    contacts = [_pair_in_units(pair, length, force / area) for pair in scene.contacts]
    return replace(
        scene,
        bodies=bodies,
        supports=[_support_in_units(support, length) for support in scene.supports],
        loads=[_load_in_units(load, length, force, dim) for load in scene.loads],
        contacts=contacts,
        foundations=[_foundation_in_units(part, length, force / area) for part in scene.foundations],
    )


def _foundation_in_units(foundation: ElasticFoundation, length: float, stress: float) -> ElasticFoundation:
    factor = stress * length if foundation.total else stress / length
    return replace(foundation, stiffness=_of_position(foundation.stiffness, length, factor))


def steps_in_units(
    steps: tuple[LoadStep, ...], length: float, force: float, dim: int
) -> tuple[LoadStep, ...]:
    """Return load steps in other units, as `in_units`."""
    return tuple(
        replace(
            step,
            loads=None if step.loads is None else [_load_in_units(x, length, force, dim) for x in step.loads],
            supports=None if step.supports is None else [_support_in_units(x, length) for x in step.supports],
        )
        for step in steps
    )


def _body_in_units(body: Body, length: float, stress: float) -> Body:
    def scaled(material: Any) -> Any:
        assert is_dataclass(material)
        moduli = {name: getattr(material, name) for name in MODULI if hasattr(material, name)}
        assert moduli, material
        return replace(
            material, **{name: tuple(stress * np.atleast_1d(value)) if np.ndim(value) else stress * value
                         for name, value in moduli.items()}
        )  # fmt: skip

    material = body.material
    if isinstance(material, dict):
        material = {region: scaled(part) for region, part in material.items()}
    else:
        material = scaled(material)  # type: ignore[arg-type]
    return replace(body, mesh=body.mesh.moved(length * body.mesh.points), material=material)


def _of_position(value: Any, length: float, factor: float) -> Any:
    """Scale a number, numbers or a function of position; positions come in the new unit of length."""
    if value is None:
        return None
    if callable(value):
        function: Callable[[np.ndarray], np.ndarray] = value
        return lambda points: factor * function(points / length)
    return tuple(factor * np.asarray(value)) if np.ndim(value) else factor * value


def _support_in_units(support: Support | Roller, length: float) -> Support | Roller:
    if isinstance(support, Roller):
        return replace(support, displacement=_of_position(support.displacement, length, length))
    return replace(support, value=tuple(_of_position(value, length, length) for value in support.value))


def _load_in_units(load: Any, length: float, force: float, dim: int) -> Any:
    powers, forces = DIMENSIONS[type(load)]
    if type(load) is not TotalForce and powers:
        powers += 3 - dim
    if isinstance(load, TotalForce) and load.moment is not None:
        load = replace(load, moment=_of_position(load.moment, length, length * force))
    name = "temperature_change" if isinstance(load, ThermalStrain) else "value"
    return replace(load, **{name: _of_position(load.value, length, length**powers * force**forces)})


def _pair_in_units(pair: ContactPair, length: float, stress: float) -> ContactPair:
    master, friction = pair.master, pair.friction
    match master:
        case RigidPlane():
            master = replace(master, point=_of_position(master.point, length, length))
        case RigidSphere():
            centre = _of_position(master.centre, length, length)
            master = replace(master, centre=centre, radius=length * master.radius)
        case RigidCylinder():
            point = _of_position(master.point, length, length)
            master = replace(master, point=point, radius=length * master.radius)
    match friction:
        case Tresca(traction=traction):
            friction = replace(friction, traction=stress * traction)  # type: ignore[operator]
        case Coulomb(shear_limit=limit) if limit is not None:
            friction = replace(friction, shear_limit=stress * limit)  # type: ignore[operator]
    match friction:
        case Coulomb(friction_coefficient=FrictionTable() as table):
            pressure = tuple(stress * np.array(table.pressure))
            friction = replace(friction, friction_coefficient=replace(table, pressure=pressure))
    if friction is not None and friction.stick_stiffness is not None:
        friction = replace(friction, stick_stiffness=stress / length * friction.stick_stiffness)
    return replace(
        pair, master=master, friction=friction, closure=_closure_in_units(pair.closure, length, stress)
    )


def _closure_in_units(law: ClosureLaw | None, length: float, stress: float) -> ClosureLaw | None:
    match law:
        case LinearClosure():
            return LinearClosure(stress / length * law.stiffness)
        case ExponentialClosure():
            return ExponentialClosure(stress * law.pressure, length * law.clearance)
        case ClosureTable():
            values = length * np.array(law.closures), stress * np.array(law.pressures)
            return ClosureTable(*map(tuple, values))
    assert law is None
    return None


def turned(scene: Scene, turn: np.ndarray) -> Scene:
    """Return a scene of hexahedra or tetrahedra turned, or mirrored, by an orthogonal matrix.

    Supports must prescribe all components, or the matrix only swap axes and directions. Obstacles are planes.
    """

    def vector(value: Any) -> Any:
        return tuple(turn @ np.asarray(value))

    def support(part: Support) -> Support:
        given = [value is not None for value in part.value]
        if all(given):
            return replace(part, value=vector(part.value))
        axes = np.abs(turn).argmax(axis=1)
        assert np.allclose(np.abs(turn)[np.arange(len(turn)), axes], 1.0)
        return replace(part, value=tuple(
            None if part.value[axis] is None else turn[row, axis] * part.value[axis]
            for row, axis in enumerate(axes)
        ))  # fmt: skip

    def pair(part: ContactPair) -> ContactPair:
        if not isinstance(part.master, RigidPlane):
            return part
        plane = RigidPlane(vector(part.master.point), vector(part.master.normal))
        return replace(part, master=plane)

    return replace(
        scene,
        bodies={
            name: Body(turned_mesh(body.mesh, turn), body.material) for name, body in scene.bodies.items()
        },
        supports=[support(part) for part in scene.supports],
        loads=[replace(load, value=vector(load.value)) for load in scene.loads],
        contacts=[pair(part) for part in scene.contacts],
    )


def turned_mesh(mesh: BodyMesh, turn: np.ndarray) -> BodyMesh:
    """Return a mesh turned about the origin; a mirrored one lists the vertices of its cells the other way."""
    points = mesh.points @ turn.T
    if np.linalg.det(turn) > 0:
        return mesh.moved(points)
    other = {"hexahedron": [0, 3, 2, 1, 4, 7, 6, 5], "tetrahedron": [0, 2, 1, 3]}[mesh.cell_type]
    surfaces = {name: facets[:, ::-1] for name, facets in mesh.surfaces.items()}
    return BodyMesh(points, mesh.cells[:, other], surfaces, mesh.grid, mesh.regions)


def renumbered_mesh(mesh: BodyMesh, seed: int) -> tuple[BodyMesh, np.ndarray, np.ndarray]:
    """Number nodes and cells at random.

    Returns:
        The mesh, the new number of every old node, and the old cell of every new one.
    """
    random = np.random.default_rng(seed)
    new, order = random.permutation(mesh.n_nodes), random.permutation(mesh.n_cells)
    points = np.empty_like(mesh.points)
    points[new] = mesh.points
    surfaces = {name: new[facets] for name, facets in mesh.surfaces.items()}
    grid = None if mesh.grid is None else mesh.grid[order]
    old_cell = np.argsort(order)
    regions = {name: np.sort(old_cell[cells]) for name, cells in mesh.regions.items()}
    cells = new[mesh.cells[order]]
    return BodyMesh(points, cells, _facets_as_sides(cells, surfaces), grid, regions), new, order


def _facets_as_sides(cells: np.ndarray, surfaces: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Order the nodes of facets as the mesh asks for it."""
    return {name: orient(cells, facets, dim=3) for name, facets in surfaces.items()}

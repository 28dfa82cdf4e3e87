"""Meshes turned, mirrored, renumbered, moved far away, with cells near degenerate: one answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fenics_contact import Body, BodyMesh, Coulomb, Scene
from fenics_contact.gallery import block
from fenics_contact.mesh import scaled_jacobian
from fenics_contact.mesh.quality import jacobians
from tests.scenes import SOFT, block_on_plane, crowned, two_blocks
from tools.hard_cases.transform import renumbered_mesh, turned
from tools.hard_cases.trial import Answer, Trial, bisected, cut_trial, trial

GROUP = "meshes"
CELLS = ("hexahedron", "tetrahedron")


def rotation(*angles: float) -> np.ndarray:
    """Return a rotation by angles about x, y and z, one after the other."""
    result = np.eye(3)
    for axis, angle in enumerate(angles):
        c, s = np.cos(angle), np.sin(angle)
        turn = np.eye(3)
        first, second = (axis + 1) % 3, (axis + 2) % 3
        turn[np.ix_([first, second], [first, second])] = [[c, -s], [s, c]]
        result = turn @ result
    return result


def turned_back(trial_: Trial, turn: np.ndarray) -> Answer:
    """Return the answer of a turned trial in the directions before it was turned."""
    found = Answer.of(trial_.solve())
    return Answer(found.force @ turn, found.displacement @ turn, found.energy)


def with_twin(scene: Scene, name: str, twin: Callable[[], Answer]) -> Trial:
    """Return the trial of a scene with a twin; other cases of this scene are cut otherwise and on ranks."""
    return cut_trial(scene, twins={name: twin}, other=None, ranks=())


TURNS = {
    "turned by odd angles": rotation(0.3, -1.1, 2.3),
    "turned by right angles": rotation(np.pi / 2, 0.0, np.pi / 2),
    "mirrored": np.diag([1.0, -1.0, 1.0]),
    "mirrored in an odd plane": np.eye(3) - 2.0 * np.outer(*2 * [np.array([2.0, 3.0, 6.0]) / 7.0]),
}
for _cell in CELLS:
    for _words, _turn in TURNS.items():

        @trial(GROUP, f"two blocks of {_cell.replace('hedron', 'hedra')} {_words}")
        def two_blocks_turned(cell: str = _cell, turn: np.ndarray = _turn) -> Trial:
            scene = two_blocks(Coulomb(0.38), cell)
            twin = turned(scene, turn)
            return with_twin(scene, "turned", lambda: turned_back(cut_trial(twin), turn))

        _ = two_blocks_turned


def renumbered(scene: Scene) -> Answer:
    """Return the answer of the scene with random numbers of nodes and cells, in the old numbers."""
    new: list[np.ndarray] = []
    bodies, offset = {}, 0
    for seed, (name, body) in enumerate(scene.bodies.items()):
        mesh, number, _ = renumbered_mesh(body.mesh, seed)
        bodies[name] = Body(mesh, body.material)
        new.append(number + offset)
        offset += mesh.n_nodes
    number = np.concatenate(new)
    state = cut_trial(replace(scene, bodies=bodies)).solve()
    found = Answer.of(state)
    old = np.argsort(number)[state.torn.points.slave]
    order = np.lexsort((old, state.torn.points.pair))
    return Answer(found.force[order], found.displacement[number], found.energy)


for _cell in CELLS:

    @trial(GROUP, f"two blocks of {_cell.replace('hedron', 'hedra')} with random numbers of nodes and cells")
    def two_blocks_renumbered(cell: str = _cell) -> Trial:
        scene = two_blocks(Coulomb(0.38), cell)
        return with_twin(scene, "renumbered", lambda: renumbered(scene))

    _ = two_blocks_renumbered


@trial(GROUP)
def two_blocks_ten_thousand_lengths_from_the_origin() -> Trial:
    """Coordinates keep four digits fewer for the gaps; the answer may differ by as much as they do."""
    scene = two_blocks(Coulomb(0.38))
    away = np.array([1e4, -2e4, 1.5e4])
    bodies = {
        name: Body(body.mesh.moved(body.mesh.points + away), body.material)
        for name, body in scene.bodies.items()
    }
    twin = cut_trial(replace(scene, bodies=bodies))
    return with_twin(scene, "far away", lambda: Answer.of(twin.solve()))


def flattened(mesh: BodyMesh, node: int, towards: int, part: float) -> BodyMesh:
    """Move a node most of the way to another one, or as far as cells stay positive."""
    points = mesh.points.copy()
    points[node] += part * (points[towards] - points[node])
    return mesh.moved(points)


def near_degenerate(cell: str, part: float) -> Scene:
    """The block on the plane, every other inner node moved to near a neighbour's place."""
    scene = block_on_plane(Coulomb(0.6), cell)
    mesh = crowned(block((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (6, 3, 3), cell), 0.02)
    index = np.arange(mesh.n_nodes).reshape(7, 4, 4)
    for i in (1, 3, 5):
        for k in (1, 2):
            mesh = flattened(mesh, index[i, 1, k], index[i, 2, k], part)
    return replace(scene, bodies={"block": Body(mesh, SOFT)})


def smallest_height(mesh: BodyMesh) -> float:
    """Return the smallest determinant of the edges at a corner of unit length, one for a right angle."""
    return float(scaled_jacobian(mesh.points, mesh.cells).min())


for _cell, _part in (
    ("tetrahedron", 0.999),
    ("tetrahedron", 0.99999),
    ("hexahedron", 0.9),
    ("hexahedron", 0.999),
):

    @trial(GROUP, f"{_cell.replace('hedron', 'hedra')} with edges shrunk to {1 - _part:.0e} of their length")
    def shrunk(cell: str = _cell, part: float = _part) -> Trial:
        scene = near_degenerate(cell, part)
        assert smallest_height(scene.bodies["block"].mesh) > 0.0
        return cut_trial(scene, other=bisected(scene, 3))

    _ = shrunk


def slivers(thickness: float) -> Scene:
    """Tetrahedra on the plane, some so flat that their four nodes nearly lie in a plane."""
    scene = block_on_plane(Coulomb(0.6), "tetrahedron")
    mesh = scene.bodies["block"].mesh
    inner = np.setdiff1d(np.arange(mesh.n_nodes), np.unique(np.concatenate([*mesh.surfaces.values()])))
    points = mesh.points.copy()
    for node in inner[::3]:
        points[node] = flat_place(points, mesh.cells, int(node), thickness)
    return replace(scene, bodies={"block": Body(mesh.moved(points), SOFT)})


def flat_place(points: np.ndarray, cells: np.ndarray, node: int, part: float) -> np.ndarray:
    """Move a node until the smallest of its cells has a given part of its volume left."""
    own = cells[(cells == node).any(axis=1)]
    direction = points[own[0][own[0] != node]].mean(axis=0) - points[node]
    start = jacobians(points, own).min()
    low, high = 0.0, 2.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        moved = points.copy()
        moved[node] += middle * direction
        low, high = (middle, high) if jacobians(moved, own).min() > part * start else (low, middle)
    return points[node] + low * direction


for _thickness in (1e-2, 1e-4):

    @trial(GROUP, f"slivers: tetrahedra flattened to {_thickness:.0e} of their volume")
    def flat(thickness: float = _thickness) -> Trial:
        scene = slivers(thickness)
        assert smallest_height(scene.bodies["block"].mesh) < 10 * thickness
        return cut_trial(scene)

    _ = flat

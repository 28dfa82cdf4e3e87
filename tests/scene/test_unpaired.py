"""Which facets and cells of two bodies are looked at: all that may touch, overlap or pass."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_contact import Body, BodyMesh, Scene
from fenics_contact._equilibrium import warnings as warned
from fenics_contact._scene import pair_geometry
from fenics_contact._scene.pair_geometry import OVERLAPPING, TOUCHING, outline_of, unpaired
from fenics_contact.gallery import block, rectangle
from fenics_contact.materials import IsotropicElasticity, PlaneStrain


def meshes(dim: int, kind: str) -> tuple[BodyMesh, BodyMesh]:
    """Return two bodies of other cells each, the second one graded, of unit size."""
    if dim == 2:
        one, other = rectangle((0, 0), (1, 1), (4, 3), kind), rectangle((0, 0), (1, 1), (3, 5), kind)
    else:
        one = block((0, 0, 0), (1, 1, 1), (3, 4, 3), kind)
        other = block((0, 0, 0), (1, 1, 1), (2, 3, 5), kind)
    return one, other.moved(other.points**1.7)


def counted(
    first: BodyMesh, second: BodyMesh, moved: dict[str, np.ndarray], monkeypatch: pytest.MonkeyPatch
) -> tuple[tuple[int, int, int], tuple[int, int, int], int]:
    """Return what is counted of two bodies, the same of all facets in all cells, and how many it spares."""
    material = PlaneStrain(1.0, 0.3) if first.dim == 2 else IsotropicElasticity(1.0, 0.3)
    scene = Scene({"one": Body(first, material), "other": Body(second, material)})
    outlines = {name: outline_of(body.mesh) for name, body in scene.bodies.items()}
    reach = max(float(np.linalg.norm(each, axis=1).max()) for each in moved.values())
    found = unpaired(scene, ("one", "other"), outlines, moved, reach)
    near, left_out = pair_geometry._near, []

    def all_of_them(
        facets: np.ndarray, deep: float, points: np.ndarray, cells: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        left_out.append(np.count_nonzero(~near(facets, deep, points, cells)[0]))
        return np.ones(facets.shape[1], dtype=bool), np.ones(len(cells), dtype=bool)

    with monkeypatch.context() as patched:
        patched.setattr(pair_geometry, "_near", all_of_them)
        whole = unpaired(scene, ("one", "other"), outlines, moved, reach)
    return found.counts, whole.counts, sum(left_out)


@pytest.mark.parametrize("kind", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_no_facet_is_left_out_that_touches_overlaps_or_passes(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bodies that nearly do, do by little, and by much; turned, and moved against each other afterwards."""
    dim, random = (2 if kind in ("triangle", "quadrilateral") else 3), np.random.default_rng(2)
    seen, quiet, left_out = np.zeros(3, dtype=int), 0, 0
    first, second = meshes(dim, kind)
    slacks = np.array([TOUCHING, -OVERLAPPING]) / 4.0
    for apart in [*(factor * slack for slack in slacks for factor in (0.9, 1.1)), 0.0, 0.05, 0.3, -0.3]:
        turn = np.linalg.qr(random.standard_normal((dim, dim)))[0] if apart in (0.3, -0.3) else np.eye(dim)
        turn[:, 0] *= np.sign(np.linalg.det(turn))
        placed = second.moved((second.points - 0.5) @ turn.T + 0.5 + np.eye(dim)[-1] * (1.0 + apart))
        for way in (0.0, 1e-3, 0.1, 0.6):
            bent = 1.0 + 0.3 * random.standard_normal(dim) * (placed.points - placed.points.min(axis=0))
            moved = {"one": np.zeros_like(first.points), "other": -way * np.eye(dim)[-1] * bent}
            found, whole, out = counted(first, placed, moved, monkeypatch)
            assert found == whole
            seen, quiet, left_out = seen + found, quiet + (not any(found)), left_out + out
    assert (seen > 0).all()
    assert quiet > 0
    assert left_out > 0


def test_bodies_of_the_same_cells_have_one_boundary(monkeypatch: pytest.MonkeyPatch) -> None:
    made, steel = [], IsotropicElasticity(1.0, 0.3)
    mesh, other = (block((0, 0, 0), (1, 1, 1), (count, 1, 1)) for count in (2, 3))
    bodies = {"one": mesh, "moved": mesh.moved(mesh.points + 1.0), "other": other}
    scene = Scene({name: Body(each, steel) for name, each in bodies.items()})
    monkeypatch.setattr(warned, "outline_of", lambda each: made.append(each) or outline_of(each))
    known = warned.ContactWarnings()
    facets = [len(known._outline(scene, name)[0]) for name in [*bodies, *bodies]]
    assert facets == 2 * [10, 10, 14]
    assert len(made) == 2
